# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Successive runs in a process share what was read, and do not affect each other."""

from dataclasses import replace
from typing import ClassVar

from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.planner.idm import IdmPlanner
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.roads.boundary import _tile_at, _united, RoadBoundary
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np

DURATION_S = 1.0


class WreckingPlanner(IdmPlanner):
    """A planner that drives as `idm` does, and destroys the scenario that it was given."""

    name: ClassVar[str] = 'wrecking'

    def setup(self, context: PlannerContext) -> None:
        """Move every part of the map."""
        super().setup(context)
        network = context.scenario.lanelet_network
        for lanelet in list(network.lanelets):
            lanelet.center_vertices[:] += 50.0
            lanelet.left_vertices[:] += 50.0
            lanelet.right_vertices[:] += 50.0
            network.remove_lanelet(lanelet.lanelet_id)
        context.planning_problem.initial_state.position[:] += 50.0


def _run(name: str, planner: str = 'idm') -> OfflineResult:
    game = load_game(scenarios_directory() / name)
    assert game.avs is not None
    return run_offline(build_setup(replace(game, avs=tuple(
        replace(av, planner=planner) for av in game.avs))), duration_s=DURATION_S)


def test_a_run_is_the_same_whatever_ran_before_it() -> None:
    """Runs in between have other roads, and the same roads destroyed by a planner."""
    first = _run('cut_in.yaml')
    other = _run('merge.yaml')
    wrecked = _run('cut_in.yaml', f'{__file__}:WreckingPlanner')
    again = _run('cut_in.yaml')
    assert again.state_hash == first.state_hash
    assert again.violations == first.violations
    assert other.state_hash != first.state_hash
    assert not wrecked.setup.loaded.scenario.lanelet_network.lanelets
    assert first.setup.loaded.scenario is not again.setup.loaded.scenario


def test_a_check_of_the_road_knows_nothing_of_other_runs() -> None:
    """It does not use tiles that other runs have prepared elsewhere, however near they are."""
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    network = setup.loaded.scenario.lanelet_network
    elsewhere, here = RoadBoundary(network), RoadBoundary(network)
    elsewhere.prepare([(0.0, 0.0)])
    here.prepare([(100.0, 3.0)])
    alone = RoadBoundary(network)
    _tile_at.cache_clear()
    _united.cache_clear()
    alone.prepare([(100.0, 3.0)])
    random = np.random.default_rng(5)
    shape = setup.avs[0].vehicle.shape
    for x, y, yaw in random.uniform((0.0, -8.0, -3.0), (300.0, 12.0, 3.0), (300, 3)).tolist():
        assert here.is_off_road(x, y, yaw, shape) == alone.is_off_road(x, y, yaw, shape)
