# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Offline runs in which nobody drives."""

from pathlib import Path

import numpy as np

from crgame_ros.scenario.game import Game, TrafficSpec
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup

DURATION_S = 6.0


def alone(scenario: Path, seed: int = 0) -> OfflineResult:
    """Let the recorded vehicles and 20 more drive."""
    game = Game(scenario, humans=(), avs=(), seed=seed,
                traffic=TrafficSpec(recorded='reactive', agents=20))
    return run_offline(build_setup(game), duration_s=DURATION_S)


def test_traffic_runs_alone(shared_scenarios: Path) -> None:
    """Agents drive over a real junction by themselves; the hash tells one run from another."""
    scenario = shared_scenarios / 'USA_Lanker-1_3_T-1.xml'
    result = alone(scenario)
    agents = result.setup.agent_columns
    assert result.setup.vehicle_ids == () and len(agents) > 20
    way = np.diff(result.object_poses[:, agents, :2], axis=0)
    # On green some go at least 20 of the 80 m that 6 s at 13 m/s are.
    assert np.nanmax(np.nansum(np.hypot(way[..., 0], way[..., 1]), axis=0)) > 20.0
    assert alone(scenario).state_hash == result.state_hash
    assert alone(scenario, seed=1).state_hash != result.state_hash
