# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs that pictures are made of."""

from collections.abc import Callable
from dataclasses import replace

from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.recording.run_record import run_record_of, RunRecord
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import StateColumn
import numpy as np
import pytest


def _driven(name: str, duration_s: float) -> RunRecord:
    setup = build_setup(load_game(scenarios_directory() / f'{name}.yaml'))
    drivers, intervals_s = recorded_inputs(setup)
    return run_record_of(run_offline(setup, duration_s=duration_s, drivers=drivers,
                                     intervals_s=intervals_s, check_drivability=False))


@pytest.fixture(scope='session')
def cut_in() -> RunRecord:
    """Return 8 s of the cut-in game."""
    return _driven('cut_in', 8.0)


@pytest.fixture(scope='session')
def two_avs() -> RunRecord:
    """Return 5 s of a human and two AVs in a bend."""
    return _driven('two_avs', 5.0)


@pytest.fixture(scope='session')
def parked_cars() -> RunRecord:
    """Return 2 s of a street with other vehicles, and a pedestrian."""
    return _driven('parked_cars', 2.0)


@pytest.fixture
def cut_in_scene(cut_in: RunRecord) -> FrameScene:
    """Return the scene of that run for frames."""
    return FrameScene(cut_in.log)


@pytest.fixture
def straight(cut_in: RunRecord) -> Callable[..., RunTrajectories]:
    """Return a function that drives human and AV of the cut-in game as given."""
    def make(human_x: list[float], human_speed: list[float], av_x: float) -> RunTrajectories:
        states = np.zeros((len(human_x), 2, 8))
        y = cut_in.log.vehicle_states[0, 1, StateColumn.Y]
        states[:, :, StateColumn.Y] = y
        states[:, 0, StateColumn.X], states[:, 0, StateColumn.SPEED] = human_x, human_speed
        states[:, 1, StateColumn.X] = av_x
        return replace(
            cut_in.log, ks=cut_in.log.ks[:len(human_x)], vehicle_states=states,
            published_states=states,
            object_poses=cut_in.log.object_poses[:len(human_x)],
            object_velocities=cut_in.log.object_velocities[:len(human_x)])
    return make
