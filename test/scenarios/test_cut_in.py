# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cut-in of the paper (CRG figures 8 to 11): idm stops behind the human, reactive passes."""

from dataclasses import replace
from pathlib import Path

from crgame_ros.game.game import Game, LaneletSpawn
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game, with_planners
from crgame_ros.recording.export import write_scenario
from crgame_ros.recording.run_trajectories import trajectories_of
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest

LANE_WIDTH = 3.75
# The human stands from 12 s on.
DURATION_S = 17.0


@pytest.fixture
def game(project_root: Path) -> Game:
    """Return the cut-in."""
    return effective_game(RunRequest(game=project_root / 'scenarios' / 'cut_in.yaml'))


def perturbed(game: Game, ahead: float, speed: float) -> Game:
    """Return the game with another start and speed of the human."""
    human = game.humans[0]
    assert isinstance(human.spawn, LaneletSpawn)
    spawn = replace(human.spawn, s=human.spawn.s + ahead, speed=speed)
    return replace(game, humans=(replace(human, spawn=spawn),))


def run(game: Game, planner: str, latency: int) -> OfflineResult:
    """Run the game, and check that the AV touches no vehicle and stays on the road."""
    result = run_offline(with_planners(build_setup(game), (planner,)), latency_steps=latency,
                         duration_s=DURATION_S)
    assert [item for item in result.violations if not item.is_valid] == []
    return result


def check_passed(result: OfflineResult) -> None:
    """Check that the AV went round the human through the lane beside, and drove on."""
    av, human = result.states_of('av0'), result.states_of('hv0')
    # The human stands in the AV's lane at the end, and the AV is far beyond, fast and back.
    assert abs(human[-1, 1]) < 0.5
    assert human[-1, 3] < 0.1
    assert av[-1, 0] > human[-1, 0] + 50.0
    assert av[-1, 3] > 15.0
    assert abs(av[-1, 1]) < 0.5
    beside = np.argmin(np.abs(av[:, 0] - human[:, 0]) + 1e3 * (np.abs(av[:, 1]) < 1.0))
    assert abs(av[beside, 1] - human[beside, 1]) == pytest.approx(LANE_WIDTH, abs=1.0)
    record = result.planners['av0']
    # All answers come from the package: none is a fallback, and none is refused.
    assert record.accepted_ratio == 1.0
    assert record.statistics.fallbacks == record.counters.refused == 0


@pytest.mark.parametrize('latency', [0, 5])
def test_idm_brakes_behind_the_human_and_stops(game: Game, latency: int) -> None:
    result = run(game, 'idm', latency)
    av, human = result.states_of('av0'), result.states_of('hv0')
    assert av[-1, 3] < 0.3
    assert np.abs(av[:, 1]).max() < 0.1
    # Rear axle to rear axle: a car's length of 4.5 m and a gap of about s0 = 2 m.
    assert 5.5 < human[-1, 0] - av[-1, 0] < 9.5


@pytest.mark.exhaustive
@pytest.mark.parametrize('latency', [0, 5])
def test_reactive_passes_beside(game: Game, latency: int) -> None:
    check_passed(run(game, 'reactive', latency))


@pytest.mark.exhaustive
@pytest.mark.parametrize(('ahead', 'speed'), [(-6.0, 26.0), (4.0, 24.0)],
                         ids=['later', 'slower'])
def test_both_do_so_in_other_games(game: Game, ahead: float, speed: float) -> None:
    other = perturbed(game, ahead, speed)
    check_passed(run(other, 'reactive', 5))
    assert run(other, 'idm', 5).states_of('av0')[-1, 3] < 0.3


@pytest.mark.exhaustive
def test_exported_cut_in_stays_on_the_road_driven_again(game: Game, tmp_path: Path) -> None:
    """
    Also with the human's planning problem, whose route changes lanes to the right.

    The lanelets of that lane change once shared parts of the path. The bounds of one were used
    for the other, and the AV left the road for 1.8 s.
    """
    first = run(game, 'reactive', 0)
    path = tmp_path / 'driven.xml'
    write_scenario(trajectories_of(first), path)
    again = effective_game(RunRequest(scenario=path, driver='idle', duration_s=10.0))
    setup = with_planners(build_setup(again), ('reactive',))
    result = run_offline(setup)
    violations = [item for item in result.violations if item.vehicle_id.startswith('av')]
    assert not any(item.off_road for item in violations)
    for av in setup.avs:
        assert result.planners[av.id].accepted_ratio >= 0.95
