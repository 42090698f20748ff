# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which AVs drive: alternatives on one spot, and exported runs that are driven again."""

from dataclasses import replace
import math
from pathlib import Path

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.errors import InputError
from crgame_ros.game.game import AvSpec, Game, HumanSpec, load_game
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.export import write_scenario
from crgame_ros.recording.run_trajectories import trajectories_of
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.simulation.av_assignment import assign_avs
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from lxml import etree
import numpy as np
import pytest

MERGE = 'more/C-DEU_MONAMerge-2_1_T-299.xml'
HUMAN = (HumanSpec('hv0', 'idle'),)


def problems_of(game: Game) -> list[int]:
    """Return the planning problems that are driven."""
    return [av.planning_problem.planning_problem_id for av in build_setup(game).avs]


def test_problems_on_one_spot_are_alternatives(shared_scenarios: Path) -> None:
    """Four starts within 8 m: the first drives, alone and without a contact at n = 0."""
    setup = build_setup(Game(shared_scenarios / MERGE, humans=HUMAN))
    assert [av.planning_problem.planning_problem_id for av in setup.avs] == [100025]
    told = [notice for notice in setup.notices if 'alternatives' in notice]
    assert len(told) == 1 and '100025, 100055, 100059, 100041 start on one spot' in told[0]
    result = run_offline(setup, duration_s=0.5)
    assert not [item for item in result.violations if item.collision]


def test_hundreds_of_alternatives_are_counted() -> None:
    """Of 500 problems on one spot the message names a few, and still shows the remedy."""
    game = load_game(scenarios_directory() / 'cut_in.yaml')
    loaded = load_scenario(game.scenario)
    problem = loaded.planning_problems[0]
    many = [PlanningProblem(number, problem.initial_state, problem.goal)
            for number in range(1000, 1500)]
    parts, (notice,) = assign_avs(Game(game.scenario, humans=HUMAN),
                                  replace(loaded, planning_problems=tuple(many)))
    assert len(parts) == 1 and len(notice) < 480
    assert 'problems 1000, 1001, 1002' in notice and 'and 491 more' in notice
    assert '--problem' in notice


def test_another_alternative_is_asked_for(shared_scenarios: Path) -> None:
    """The command line or the game asks; several of them drive if the user names them."""
    path = shared_scenarios / MERGE
    request = RunRequest(scenario=path, driver='idle', problems=(100059,))
    assert problems_of(effective_game(request)) == [100059]
    assert problems_of(Game(path, humans=HUMAN, avs=(
        AvSpec('av0', planning_problem=100041), AvSpec('av1', planning_problem=100025)))
    ) == [100041, 100025]
    assert problems_of(Game(path, humans=HUMAN, avs=(AvSpec('av0'),))) == [100025]
    with pytest.raises(InputError, match='av1: no planning problem is left .*planning_problem'):
        problems_of(Game(path, humans=HUMAN, avs=(AvSpec('av0'), AvSpec('av1'))))
    with pytest.raises(InputError, match='planning problem 7 does not exist'):
        problems_of(effective_game(replace(request, problems=(7,))))
    with pytest.raises(InputError, match='--problem: the game names its AVs'):
        effective_game(RunRequest(problems=(100,)))


def test_problems_that_start_apart_all_drive() -> None:
    """The two AVs of the package's own scenario, 40 m apart, both drive."""
    path = scenarios_directory() / 'C-ZAM_TwoAvs-1_1_T-1.xml'
    assert problems_of(Game(path, humans=HUMAN)) == [100, 101]


@pytest.mark.exhaustive
def test_an_exported_run_driven_again_has_the_same_cast(tmp_path: Path) -> None:
    """Run, XML, run, XML, run: hv0 plays back to 0.1 mm, av0 drives its own problem equally."""
    first = run_offline(build_setup(load_game(scenarios_directory() / 'cut_in.yaml')),
                        duration_s=8.0)
    log = trajectories_of(first)
    _, exported = write_scenario(log, tmp_path / 'first.xml')
    human = f'o{exported.obstacle_ids["hv0"]}'
    centers = log.vehicle_states[:, 0, :2] + 1.4227 * np.column_stack(
        (np.cos(log.vehicle_states[:, 0, 2]), np.sin(log.vehicle_states[:, 0, 2])))
    for number in (1, 2):
        path = tmp_path / ('first.xml' if number == 1 else 'second.xml')
        setup = build_setup(effective_game(RunRequest(scenario=path)))
        assert setup.vehicle_ids == ('av0',)
        assert setup.avs[0].planning_problem.planning_problem_id == 100
        assert setup.obstacles.ids == (human,)
        result = run_offline(setup, duration_s=7.9)
        played = result.object_poses[:, 0]
        assert np.abs(played[:, :2] - centers[:len(played)]).max() < 1e-4
        # The AV sees the same human, with four decimals and speeds as differences of positions.
        drift = result.states_of('av0')[:, :2] - first.states_of('av0')[:791, :2]
        assert np.abs(drift).max() < 0.5
        write_scenario(trajectories_of(result), tmp_path / 'second.xml')
    assert math.dist(result.states_of('av0')[-1, :2], first.states_of('av0')[0, :2]) > 80.0


def test_the_file_names_the_human_vehicles(tmp_path: Path) -> None:
    """The source, which the schema leaves free, names them, for the last run only."""
    game = load_game(scenarios_directory() / 'cut_in.yaml')
    _, exported = write_scenario(
        trajectories_of(run_offline(build_setup(game), duration_s=0.3)), tmp_path / 'run.xml')
    source = etree.fromstring(exported.xml_text.encode()).get('source')
    assert source.endswith(
        f'ZAM_CutIn-1_1_T-1 driven in crgame_ros (human: planning problem '
        f'{exported.problem_ids["hv0"]} is obstacle {exported.obstacle_ids["hv0"]})')
    asked = build_setup(effective_game(RunRequest(scenario=tmp_path / 'run.xml', driver='idle')))
    assert asked.vehicle_ids == ('hv0', 'av0')
    assert f'o{exported.obstacle_ids["hv0"]}' in asked.obstacles.ids
    _, again = write_scenario(trajectories_of(run_offline(asked, duration_s=0.2)),
                              tmp_path / 'again.xml')
    told = etree.fromstring(again.xml_text.encode()).get('source')
    # Two humans by now: the one that drove, and the one played back.
    assert told.count('(humans: ') == 1 and told.count('driven in crgame_ros') == 2
    assert f'planning problem {exported.problem_ids["hv0"]} is obstacle ' in told
    assert asked.loaded.human_problems == {
        exported.problem_ids['hv0']: exported.obstacle_ids['hv0']}
    # If the user removes the obstacle to solve its problem, it becomes an AV.
    root = etree.parse(str(tmp_path / 'run.xml')).getroot()
    root.remove(root.find(f'dynamicObstacle[@id="{exported.obstacle_ids["hv0"]}"]'))
    (tmp_path / 'solved.xml').write_bytes(etree.tostring(root))
    solved = problems_of(Game(tmp_path / 'solved.xml', humans=HUMAN))
    assert set(solved) == {100, exported.problem_ids['hv0']}
