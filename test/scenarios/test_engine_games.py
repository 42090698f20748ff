# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The games with objects, traffic and perception: no contacts, and the human has an effect."""

from dataclasses import replace
from pathlib import Path

from commonroad.common.file_reader import CommonRoadFileReader
from crgame_ros.drivability.monitor import VehicleDrivability
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.export import write_scenario
from crgame_ros.recording.run_trajectories import trajectories_of
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from engine_games_support import (
    distances,
    play,
    played,
    speeds,
    touching,
    without_human,
)
import numpy as np
import pytest

# They share the games that are played as they are.
pytestmark = pytest.mark.xdist_group('scenarios/games')

NAMES = ('occluded_pedestrian', 'dense_merge', 'blocked_lane', 'fog')
GAMES = [pytest.param(name, id=name) for name in NAMES]
# Least loss of speed that the human causes [m/s], and bounds of the distance to the human [m].
HUMAN_MATTERS = {'occluded_pedestrian': (2.0, 10.0, 30.0), 'dense_merge': (2.0, 5.0, 50.0),
                 'blocked_lane': (8.0, 0.8, 2.5), 'fog': (3.0, 1.9, 8.0)}


@pytest.fixture(autouse=True)
def _packages(request: pytest.FixtureRequest) -> None:
    """Skip games of the reactive planner if its package is not installed."""
    if 'fog' in request.node.nodeid:
        pytest.importorskip('commonroad_rp')


def _invalid(result: OfflineResult) -> list[VehicleDrivability]:
    return [verdict for verdict in result.violations if not verdict.is_valid]


def test_every_game_with_engines_is_here() -> None:
    """The tests below leave out no game with objects, traffic or perception, but families."""
    games = {path.stem: load_game(path) for path in scenarios_directory().glob('*.yaml')
             if path.suffixes == ['.yaml']}
    assert set(NAMES) == {name for name, game in games.items() if not game.vary and (
        game.objects or game.traffic or any(av.perception for av in game.avs or ()))}


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize('name', GAMES)
def test_no_bodies_touch(name: str) -> None:
    """No driven vehicle, agent or object touches another, by exact geometry at every tick."""
    result = played(name)
    assert _invalid(result) == []
    assert touching(result) == []
    for record in result.planners.values():
        assert record.counters.refused == 0, record.counters.last_refusal
        assert record.accepted_ratio >= 0.95


@pytest.mark.exhaustive
@pytest.mark.parametrize('name', GAMES)
def test_runs_repeat_bit_for_bit(name: str) -> None:
    """All states, those of agents and objects too."""
    first, second = played(name), play(name)
    assert first.state_hash == second.state_hash
    assert first.object_poses.tobytes() == second.object_poses.tobytes()
    assert first.object_velocities.tobytes() == second.object_velocities.tobytes()


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize('name', GAMES)
def test_export_is_read_back(name: str, tmp_path: Path) -> None:
    """
    Writing checks CommonRoad's schema; commonroad-io finds all obstacles, to the last tick.

    A reused slot of traffic is another obstacle each time.
    """
    result = played(name)
    _, exported = write_scenario(trajectories_of(result), tmp_path)
    scenario, _ = CommonRoadFileReader(str(tmp_path / f'{exported.benchmark_id}.xml')).open()
    there = np.isfinite(result.object_poses[..., 0])
    lives = there[0].sum() + (there[1:] & ~there[:-1]).sum()
    assert len(scenario.obstacles) == lives + len(result.setup.vehicle_ids)
    assert max(obstacle.prediction.final_time_step for obstacle in scenario.dynamic_obstacles) \
        == len(result.object_poses) - 1


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize('name', GAMES)
def test_human_makes_the_av_slow_down(name: str) -> None:
    """Compared with the same game without the human, by the amount that the game intends."""
    slower, least, most = HUMAN_MATTERS[name]
    result, alone = played(name), play(name, without_human)
    assert (speeds(alone, 'av0') - speeds(result, 'av0')).max() > slower
    assert least < distances(result, 'av0', 'hv0').min() < most


@pytest.mark.matrix('occluded_pedestrian')
@pytest.mark.slow
@pytest.mark.parametrize('name', GAMES)
def test_script_survives_an_uneven_clock(name: str) -> None:
    """Like `test_scripts_survive_an_uneven_clock` of the other games; the objects stay."""
    game = load_game(scenarios_directory() / f'{name}.yaml')
    setup = build_setup(replace(game, avs=(), traffic=None))
    steps = setup.scheduler.steps_for(game.duration)
    random = np.random.default_rng(0)
    late = np.abs(random.normal(0.0, 1e-3, steps))
    late += np.where(random.random(steps) < 0.01, random.uniform(0.0, 0.05, steps), 0.0)
    times = np.maximum.accumulate(np.arange(1, steps + 1) * setup.scheduler.dt_s + late)
    intervals = np.clip(np.diff(times, prepend=0.0), 1e-3, 0.05)
    even, uneven = (run_offline(setup, intervals_s=series) for series in (None, intervals))
    assert _invalid(uneven) == []
    (x, y, yaw), (x_even, y_even, _) = (run.states_of('hv0')[-1, :3] for run in (uneven, even))
    assert abs((y - y_even) * np.cos(yaw) - (x - x_even) * np.sin(yaw)) < 0.9
