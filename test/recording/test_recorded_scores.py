# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scores of whole runs: from a recording as from the run, as a command, and of its solutions."""

import json
from pathlib import Path
from typing import Any

from commonroad.common.solution import CommonRoadSolutionReader
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import (
    create_collision_checker,
)
from commonroad_dc.feasibility import solution_checker
from crgame_ros.analysis.scores.commonroad_costs import COSTS
from crgame_ros.analysis.scores.scored_run import score_run
from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
from crgame_ros.analysis.scores.vehicle import SCORE_MEASURES
from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.recording.recorded_plans import plans_of_result
from crgame_ros.recording.run_record import run_record_of, RunRecord
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import polars
import pytest

# Columns of the table of vehicles, and the places of their values in `crgame score`'s output.
COLUMNS = {
    'score_nuplan': ('nuplan', 'score'),
    **{f'score_{name}': ('nuplan', 'multipliers', name) for name in (
        'no_collision_at_fault', 'drivable_area', 'driving_direction', 'making_progress')},
    **{f'score_{name}': ('nuplan', 'weighted', name, 'value') for name in (
        'progress', 'time_to_collision', 'speed_limit', 'comfort')},
    **{f'score_{name.lower()}': ('commonroad', 'costs', name, 'total') for name in (
        'JB1', 'SA1', 'WX1', 'SM1', 'SM2', 'SM3', 'MW1', 'TR1')},
    'score_valid': ('commonroad', 'valid'),
    'score_feasible': ('commonroad', 'feasibility', 'feasible'),
    'score_failed_checks': ('commonroad', 'failed'), 'score_expert': ('nuplan', 'expert'),
    'score_reached_s': ('goal', 'reached_s'), 'score_last_distance': ('goal', 'last_distance_m'),
    'score_accepted_share': ('plans', 'accepted_share'),
    'score_age_p50_s': ('plans', 'age_ms', 'p50')}


@pytest.fixture(scope='module')
def result() -> OfflineResult:
    """Drive the cut-in for three seconds."""
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    drivers, intervals_s = recorded_inputs(setup)
    return run_offline(setup, duration_s=3.0, drivers=drivers, intervals_s=intervals_s)


@pytest.fixture(scope='module')
def record(result: OfflineResult) -> RunRecord:
    """Return its record."""
    return run_record_of(result)


@pytest.fixture(scope='module')
def run(result: OfflineResult, recorder: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of its recording, with an AV's plans in the diagnostics."""
    folder: Path = tmp_path_factory.mktemp('scored') / 'run'
    messages = recorder.messages(result)
    at_ns = messages[-1][2] + 1
    counts = {'requests': 30, 'accepted': 28, 'refused': 1, 'skipped': 0, 'timed_out': 0,
              'realigned': 0, 'steps_without_plan': 2, 'last_refusal': 'too far',
              'worst_lateral_error': 0.25}
    statuses = [
        ('sim_node: av0 plans', 'following its plan', {'age_ms': 40.0, **counts}),
        ('sim_node: av0 plans', 'following its plan', {'age_ms': 60.0, **counts}),
        ('planner_node: av0', 'braking: 3 m are missing',
         {'plans': 30, 'fallbacks': 3, 'plan_time_ms': 12.0}),
        ('planner_node: av0', 'braking: 4.5 m are missing',
         {'plans': 30, 'fallbacks': 4, 'plan_time_ms': 14.0})]
    messages += [('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', at_ns + number,
                  recorder.status(2_000_000_000, name, message, **values))
                 for number, (name, message, values) in enumerate(statuses)]
    recorder.ours(folder / 'bag', messages)
    return folder


@pytest.fixture(scope='module')
def told(run: Path, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """Return the output of `crgame score` for the vehicles of the recording."""
    out = tmp_path_factory.mktemp('scores')
    assert main(['score', str(run), '--out', str(out)]) == 0
    found: list[dict[str, Any]] = json.loads((out / 'scores.json').read_text())['vehicles']
    return found


@pytest.fixture(scope='module')
def vehicles(run: Path, tmp_path_factory: pytest.TempPathFactory) -> polars.DataFrame:
    """Return the table of vehicles of the same recording."""
    out = tmp_path_factory.mktemp('tables')
    assert main(['export', str(run), '--out', str(out)]) == 0
    return polars.read_parquet(out / 'vehicles.parquet')


@pytest.mark.slow
@pytest.mark.parametrize('column', COLUMNS)
def test_the_table_has_what_the_command_says(
        column: str, told: list[dict[str, Any]], vehicles: polars.DataFrame) -> None:
    """It has each score of both driven vehicles; a human has no plans."""
    expected = []
    for vehicle in told:
        value: Any = vehicle
        for key in COLUMNS[column]:
            value = None if value is None else value[key]
        if isinstance(value, dict):
            value = ', '.join(value) or None
        expected.append(1e-3 * value if column.endswith('p50_s') and value else value)
    assert vehicles[column].to_list() == pytest.approx(expected, rel=1e-12)
    assert expected != [None, None]


def test_no_score_is_left_out_of_the_table(vehicles: polars.DataFrame) -> None:
    """Only latencies, which stand with the plans, are exempt."""
    assert {name for name in vehicles.columns if name.startswith('score_')} == set(COLUMNS)
    assert len(COLUMNS) == len(SCORE_MEASURES) - 1 + 2


def test_a_run_that_cannot_be_scored_has_its_tables_all_the_same(
        run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The table of runs has the reason; with `--no-scores` nothing is scored."""
    def refuse(*_: Any) -> None:
        raise InputError('has no step', 'the run', 'record again')
    monkeypatch.setattr(ScoredScenario, 'from_run', refuse)
    for words, notices in (((), 'no scores: the run: has no step; record again'),
                           (('--no-scores',), None)):
        assert main(['export', str(run), '--out', str(tmp_path), *words]) == 0
        table = polars.read_parquet(tmp_path / 'vehicles.parquet')
        assert [table[name].null_count() for name in COLUMNS] == [2] * len(COLUMNS)
        assert polars.read_parquet(tmp_path / 'runs.parquet')['notices'].to_list() == [notices]


def test_scores_of_an_offline_run(record: RunRecord, result: OfflineResult) -> None:
    """They cover both driven vehicles and everything that the table of measures names."""
    scores = score_run(record, plans=plans_of_result(result))
    told = scores.as_dict()
    assert json.loads(json.dumps(told, allow_nan=False)) == told
    human, av = told['vehicles']
    assert (human['vehicle'], human['role'], human['plans']) == ('hv0', 'human', None)
    assert (av['vehicle'], av['role'], av['planner']) == ('av0', 'autonomous', 'idm')
    assert human['commonroad']['vehicle'] == 'KS2' and human['commonroad']['exact_vehicle_type']
    assert set(human['commonroad']['costs']) == set(COSTS)
    for vehicle in (human, av):
        parts = {**vehicle['nuplan']['multipliers'], **vehicle['nuplan']['weighted'],
                 **vehicle['commonroad']['costs'], **(vehicle['plans'] or {}), **vehicle['goal'],
                 'nuplan_score': vehicle['nuplan']['score'],
                 'valid': vehicle['commonroad']['valid'],
                 'feasible': vehicle['commonroad']['feasibility']['feasible']}
        missing = set(SCORE_MEASURES) - set(parts)
        assert missing == (set() if vehicle is av else {'accepted_share', 'latency_ms', 'age_ms'})
    assert av['plans']['accepted_share'] == result.planners['av0'].accepted_ratio
    assert av['plans']['requests'] == result.planners['av0'].counters.requests
    assert 'drivability-checker 2025' in told['checker']
    assert 'weights and the table of the benchmark site differ' in told['remarks'][0]
    # 3 s at the scenario's 0.1 s; only the human has reached a goal, its last place.
    assert av['commonroad']['costs']['JB1']['total'] == pytest.approx(3.0)
    assert av['goal']['reached_s'] is None and human['goal']['reached_s'] is not None
    centre = record.log.vehicle_states[-1, 1, 0] + record.log.vehicles[1].rear_to_center
    problem = result.setup.avs[0].planning_problem
    goal = problem.goal.state_list[0].position.shapes[0].shapely_object.bounds
    assert av['goal']['last_distance_m'] == pytest.approx(goal[0] - centre, abs=0.01)


def test_the_vehicle_itself_is_no_obstacle_to_its_solution(record: RunRecord) -> None:
    """The exported scenario holds all vehicles; without the own vehicle there is no collision."""
    scored, exported = ScoredScenario.from_run(record.log)
    for name, number in exported.problem_ids.items():
        assert scored.own[number] == exported.obstacle_ids[name]
        left = {each.obstacle_id for each in scored.without_own({number}).obstacles}
        assert left == {each.obstacle_id for each in scored.loaded.scenario.obstacles} \
            - {exported.obstacle_ids[name]}
    # The same holds from the file alone, as for other users.
    assert ScoredScenario.from_file(scored.loaded).own == scored.own


def test_valid_solution_says_the_same(record: RunRecord,
                                      monkeypatch: pytest.MonkeyPatch) -> None:
    """The checker's own function agrees, but for the road: its check needs another package."""
    monkeypatch.setattr(solution_checker, '_construct_boundary_checker',
                        lambda scenario: create_collision_checker(type(scenario)(scenario.dt)))
    scored, _ = ScoredScenario.from_run(record.log)
    for vehicle in score_run(record).vehicles:
        number = vehicle.commonroad.solved.planning_problem_id
        scenario = scored.without_own({number})
        problems = PlanningProblemSet([scored.problem(number)])
        solution = vehicle.commonroad.solutions(scenario.scenario_id)['JB1']
        try:
            valid = solution_checker.valid_solution(scenario, problems, solution)[0]
        except solution_checker.SolutionCheckerException as error:
            valid = False
            assert str(error) in vehicle.commonroad.checks.failed.values()
        assert vehicle.commonroad.checks.is_valid is valid
    assert {vehicle.commonroad.checks.is_valid for vehicle in score_run(record).vehicles} \
        == {True, False}


@pytest.mark.exhaustive
def test_the_command_tells_the_same_of_the_recording(
        run: Path, record: RunRecord, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It agrees as JSON and in lines; commonroad-io reads its files, which score the same."""
    out = tmp_path / 'out'
    assert main(['score', str(run), '--json', '--out', str(out)]) == 0
    told = json.loads(capsys.readouterr().out)
    expected = score_run(record).as_dict()
    for found, own in zip(told['vehicles'], expected['vehicles'], strict=True):
        assert found['nuplan']['score'] == pytest.approx(own['nuplan']['score'], rel=1e-9)
        for name, cost in own['commonroad']['costs'].items():
            assert found['commonroad']['costs'][name]['total'] == pytest.approx(
                cost['total'], rel=1e-6), name
    assert json.loads((out / 'scores.json').read_text()) == told
    scenario = out / f'{told["scenario"]}.xml'
    assert len(list(out.iterdir())) == 2 + 2 * len(COSTS)
    file, = out.glob('solution_KS2_SM1_*.av0.xml')
    solution = CommonRoadSolutionReader.open(str(file))
    states = solution.planning_problem_solutions[0].trajectory.state_list
    speeds = [state.velocity for state in states]
    assert np.allclose(speeds, record.log.vehicle_states[:, 1, 3], atol=1e-9)
    assert main(['score', '--scenario', str(scenario), '--solution', str(file), '--json']) == 0
    again = json.loads(capsys.readouterr().out)['vehicles'][0]
    assert again['commonroad']['costs']['SM1']['total'] == pytest.approx(
        told['vehicles'][1]['commonroad']['costs']['SM1']['total'], rel=1e-4)
    assert again['nuplan']['expert'].startswith('recorded obstacle')
    assert again['nuplan']['weighted']['progress']['value'] == pytest.approx(1.0, abs=1e-4)
    assert main(['score', str(run)]) == 0
    text = capsys.readouterr().out
    for words in ('hv0 (human)', 'av0 (autonomous, idm)', 'nuPlan', 'free drive', 'SM1',
                  'feasible, 30 transitions', '80.0 % accepted', '2 x 3 m are missing',
                  'age 50 ms', 'tracking', 'lateral 0.25 m', 'm away at the end'):
        assert words in text, words


@pytest.mark.slow
def test_experts_and_solutions_of_a_run(run: Path, tmp_path: Path,
                                        capsys: pytest.CaptureFixture[str]) -> None:
    """A run is its own expert, so the human's progress is full; solutions are scored, too."""
    out = tmp_path / 'out'
    assert main(['score', str(run), '--expert', str(run), '--json', '--out', str(out)]) == 0
    human, av = json.loads(capsys.readouterr().out)['vehicles']
    assert human['nuplan']['weighted']['progress']['value'] == 1.0
    assert human['nuplan']['expert'] == f'hv0 of {run}'
    assert av['nuplan']['weighted']['progress']['value'] == pytest.approx(
        min(1.0, av['nuplan']['progress_m'] / av['nuplan']['expert_progress_m']))
    file, = out.glob('solution_KS2_JB1_*.hv0.xml')
    assert main(['score', str(run), '--solution', str(file), '--json']) == 0
    _, solutions = json.loads(capsys.readouterr().out)
    assert solutions['vehicles'][0]['vehicle'] == str(file)
    assert 'solved_all_problems' in solutions['vehicles'][0]['commonroad']['failed']


@pytest.mark.parametrize('words', [
    (), ('missing',), ('--scenario', 'missing.xml'),
    ('--scenario', 'missing.xml', '--solution', 'x'), ('.', '--scenario', 'x.xml')])
def test_what_cannot_be_scored_is_told_in_a_line(
        words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    """There is nothing to score, or nothing that can be read."""
    assert main(['score', *words]) == 2
    error = capsys.readouterr().err
    assert error.startswith('error: ') and error.count('\n') == 1


def test_solutions_of_other_scenarios_are_told(run: Path, tmp_path: Path,
                                               capsys: pytest.CaptureFixture[str]) -> None:
    """A solution of a problem that the scenario does not have is refused in a line."""
    out = tmp_path / 'out'
    assert main(['score', str(run), '--out', str(out)]) == 0
    capsys.readouterr()
    file, = out.glob('solution_KS2_JB1_*.hv0.xml')
    other = scenarios_directory() / 'ZAM_Merge-1_1_T-1.xml'
    assert load_scenario(other).planning_problems
    assert main(['score', '--scenario', str(other), '--solution', str(file)]) == 2
    assert 'it has no planning problem' in capsys.readouterr().err
