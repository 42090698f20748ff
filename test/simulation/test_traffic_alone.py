# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Offline runs without humans and AVs."""

from pathlib import Path

from crgame_ros.game.game import Game, TrafficSpec
from crgame_ros.recording.export import write_scenario
from crgame_ros.recording.run_trajectories import trajectories_of
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest

DURATION_S = 6.0


def alone(scenario: Path, seed: int = 0) -> OfflineResult:
    """Run the recorded vehicles and 20 more."""
    game = Game(scenario, humans=(), avs=(), seed=seed,
                traffic=TrafficSpec(recorded='reactive', agents=20))
    return run_offline(build_setup(game), duration_s=DURATION_S)


@pytest.mark.exhaustive
def test_traffic_runs_alone(shared_scenarios: Path, tmp_path: Path) -> None:
    """
    Agents alone drive over a real junction; the hashes of different runs differ.

    The written run has the scenario's own problem, because the schema requires one.
    """
    scenario = shared_scenarios / 'USA_Lanker-1_3_T-1.xml'
    result = alone(scenario)
    agents = result.setup.agent_columns
    assert result.setup.vehicle_ids == () and len(agents) > 20
    way = np.diff(result.object_poses[:, agents, :2], axis=0)
    # On green some drive at least 20 m of the 80 m that 6 s at 13 m/s give.
    assert np.nanmax(np.nansum(np.hypot(way[..., 0], way[..., 1]), axis=0)) > 20.0
    _, exported = write_scenario(trajectories_of(result), tmp_path)
    written = load_scenario(tmp_path / f'{exported.benchmark_id}.xml')
    there = np.isfinite(result.object_poses[:, agents, 0]).any(axis=0).sum()
    assert len(written.scenario.dynamic_obstacles) >= there > 20
    assert len(written.planning_problems) == 1
    assert alone(scenario).state_hash == result.state_hash
    assert alone(scenario, seed=1).state_hash != result.state_hash
