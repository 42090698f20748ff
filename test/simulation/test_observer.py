# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Observers get all that a live run publishes, and change nothing."""

from crgame_ros.game.game import load_game
from crgame_ros.game.objects import ObjectStates
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.observer import drivability_monitor
from crgame_ros.simulation.offline import observed_run, run_offline
from crgame_ros.simulation.setup import build_setup, Setup
import numpy as np
from numpy.typing import NDArray
import pytest

DURATION_S = 3.0


class Notebook:
    """An observer that records every call."""

    def __init__(self) -> None:
        self.steps: list[int] = []
        self.ages_s: list[float] = []
        self.states: list[NDArray[np.float64]] = []
        self.objects: dict[int, ObjectStates] = {}

    def observe(self, n: int, since_tick_s: float, vehicle_states: NDArray[np.float64],
                objects: ObjectStates | None) -> None:
        self.steps.append(n)
        self.ages_s.append(since_tick_s)
        self.states.append(vehicle_states.copy())
        if objects is not None:
            self.objects[n] = objects

    def report(self) -> int:
        return len(self.steps)


@pytest.fixture(scope='module')
def setup() -> Setup:
    """Set up a game with recorded objects."""
    return build_setup(load_game(scenarios_directory() / 'traffic.yaml'))


def test_every_state_and_every_tick_is_seen(setup: Setup) -> None:
    """In order, with objects at ticks alone; the run is the same as without observers."""
    notebook = Notebook()
    result = run_offline(setup, duration_s=DURATION_S, observers=[notebook])
    count = len(result.vehicle_states)
    assert notebook.steps == list(range(count)) and notebook.report() == 301 == count
    assert np.array_equal(notebook.states, result.vehicle_states)
    assert list(notebook.objects) == list(range(0, 301, 10))
    assert np.array_equal([item.poses for item in notebook.objects.values()],
                          result.object_poses, equal_nan=True)
    assert np.diff(notebook.ages_s[:11]) == pytest.approx([0.01] * 9 + [-0.09])
    assert run_offline(setup, duration_s=DURATION_S).state_hash == result.state_hash


def test_the_monitor_is_one_of_them(setup: Setup) -> None:
    """As an explicit observer it reports the same as the run."""
    monitor = drivability_monitor(observed_run(setup))
    result = run_offline(setup, duration_s=DURATION_S, observers=[monitor])
    assert monitor.report() == result.violations != ()
    unchecked = run_offline(setup, duration_s=DURATION_S, check_drivability=False)
    assert unchecked.violations == () and unchecked.state_hash == result.state_hash
