# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame submit`: solutions that the benchmark's own checks accept, and why others are not."""

import json
import math
from pathlib import Path
from typing import Any
import zipfile

from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.solution import CommonRoadSolutionReader
from commonroad.scenario.state import KSState
from commonroad_dc.feasibility import solution_checker
from crgame_ros.analysis.scores.driven_states import point_mass_states
from crgame_ros.analysis.scores.solution_file import ROOT
from crgame_ros.cli import main
from crgame_ros.evaluation.cell_grid import make_grid
from crgame_ros.evaluation.folder import EvaluationFolder
from crgame_ros.evaluation.plan import parse_plan
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.offline_recording import write_recording
from crgame_ros.scenario import guard
from crgame_ros.scenario.export_network import solution_schema_errors
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.submission.drives import DrivingChoice, find_drives
import numpy as np
import pytest

OWN = scenarios_directory()
JUNCTION, TWO = OWN / 'ZAM_TJunction-1_1_T-1.xml', OWN / 'C-ZAM_TwoAvs-1_1_T-1.xml'
NAME = 'solution_KS2:JB1:ZAM_TJunction-1_1_T-1:2020a.xml'


def solutions(path: Path) -> dict[str, str]:
    """Return the solution files of an archive."""
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name).decode() for name in archive.namelist()}


def check(scenario: Path, text: str) -> None:
    """Let the benchmark's tools judge a solution, from the files alone."""
    assert solution_schema_errors(guard.parse_hardened(text, 'solution', ROOT)) == []
    loaded, problems = CommonRoadFileReader(str(scenario)).open()
    solution = CommonRoadSolutionReader.fromstring(text)
    assert solution_checker.solved_all_problems(problems, solution)
    assert solution_checker.goal_reached(loaded, problems, solution)
    assert solution_checker.starts_at_correct_state(solution, problems)
    assert not solution_checker.obstacle_collision(loaded, problems, solution)
    assert not solution_checker.ego_collision(loaded, problems, solution)


def test_what_goes_in_is_accepted_and_what_does_not_has_a_reason(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Three: with headings a turn away, without a planning problem, with its AV as an obstacle."""
    text = JUNCTION.read_text()
    start = text.index('<planningProblem')
    turned, alone, doubled = (tmp_path / f'{name}.xml' for name in ('turned', 'alone', 'doubled'))
    turned.write_text(text[:start] + text[start:].replace(
        '<exact>0</exact>', f'<exact>{-2.0 * math.pi}</exact>', 1))
    assert f'<exact>{-2.0 * math.pi}</exact>' in turned.read_text()
    alone.write_text(text[:start] + '</commonRoad>')
    doubled.write_text(text[:start] + (
        '<dynamicObstacle id="900"><type>car</type><shape><rectangle><length>4.5</length>'
        '<width>1.6</width></rectangle></shape>') + text[
            text.index('<initialState', start):text.index('</initialState>', start)]
        + '</initialState></dynamicObstacle>' + text[start:])
    for name in ('one.zip', 'two.zip'):
        assert main(['submit', str(turned), str(alone), str(doubled), '--json', '--out',
                     str(tmp_path / name)]) == 0
        found: dict[str, dict[str, Any]] = {
            Path(each['faults'][0]).name if each['benchmark_id'] is None else
            each['benchmark_id'] + str(bool(each['faults'])): each
            for each in json.loads(capsys.readouterr().out)}
        assert [each['submitted'] for each in found.values()] == [True, False, False]
    # The run has no date, so the bytes are the same.
    assert (tmp_path / 'one.zip').read_bytes() == (tmp_path / 'two.zip').read_bytes()
    packed = solutions(tmp_path / 'one.zip')
    assert list(packed) == [NAME]
    check(turned, packed[NAME])
    good, without, collided = found.values()
    assert (good['cost'], good['states']) == (pytest.approx(9.1), 92)
    assert 'has no planning problem' in without['reason']
    assert any(fault.startswith('obstacle_collision') for fault in collided['faults'])
    assert 'obstacle 900 of the file starts where planning problem' in collided['remarks'][0]


def test_all_problems_of_a_collaborative_scenario_are_in_one_solution(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / 'new' / 'submission.zip'
    assert main(['submit', str(TWO), '--model', 'PM', '--cost', 'WX1', '--out', str(out)]) == 0
    packed = solutions(out)
    assert list(packed) == ['solution_[PM2,PM2]:[WX1,WX1]:C-ZAM_TwoAvs-1_1_T-1:2020a.xml']
    check(TWO, *packed.values())
    assert capsys.readouterr().out.startswith(
        'valid  C-ZAM_TwoAvs-1_1_T-1  idm  [PM2,PM2], [WX1,WX1] ')
    assert main(['submit', str(TWO), '--out', str(out)]) == 2
    assert f'{out}: is there already' in capsys.readouterr().err


def test_of_several_runs_of_a_scenario_the_best_goes_in(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Cells of an evaluation are driven again, to the same bits."""
    folder = EvaluationFolder(tmp_path / 'first')
    plan = parse_plan({
        'scenarios': [str(JUNCTION)], 'seeds': 1, 'duration': 11.0, 'planners': [
            {'planner': 'idm', 'label': 'slow', 'options': {'v0': 8.0}},
            {'planner': 'idm', 'label': 'usual'}]}, 'plan', tmp_path)
    folder.begin(plan, make_grid(plan, folder.store))
    out = tmp_path / 'a.zip'
    words = ['submit', str(folder.path), '--json', '--out', str(out)]
    assert main(words) == 2
    assert 'has the planners slow, usual; choose one' in capsys.readouterr().err
    assert main([*words, '--planner', 'slow']) == 1
    captured = capsys.readouterr()
    assert 'goal_reached' in captured.out and not out.exists()
    assert captured.err.endswith('none of 1 solutions is valid: no archive is written\n')
    # A scenario driven now gives the same.
    assert main([*words, '--planner', 'usual']) == 0
    first = solutions(out)[NAME]
    out.unlink()
    capsys.readouterr()
    assert main(['submit', str(JUNCTION), str(JUNCTION.resolve().parent / '..' / 'scenarios' /
                 JUNCTION.name), '--json', '--out', str(out)]) == 0
    assert solutions(out) == {NAME: first}
    found = json.loads(capsys.readouterr().out)
    assert [each['submitted'] for each in found] == [True, False]
    assert found[1]['valid'] and 'no more cost' in found[1]['reason']


def test_a_run_driven_offline_has_no_date(tmp_path: Path) -> None:
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    write_recording(run_offline(setup, duration_s=0.5, keep_messages=True), tmp_path)
    drive, = find_drives([str(tmp_path)], DrivingChoice())
    assert drive.make().when is None


@pytest.mark.parametrize(('words', 'said'), [
    (['--cost', 'SA1', '--model', 'PM'], '--cost: SA1 is not defined for the model PM'),
    (['--cost', 'ABC'], '--cost: is ABC; give one of JB1'),
    (['--duration', '0'], '--duration: is 0.0'),
    (['--planner', 'nobody'], 'nobody'),
    (['--planner', 'external'], '--planner: an external planner works in live runs only'),
    (['--out', 'folder'], 'folder: is no name of an archive'),
    (['ZAM_TJunktion-1_1_T-1'], 'did you mean ZAM_TJunction-1_1_T-1')])
def test_what_cannot_be_submitted_is_said_in_one_line(
        words: list[str], said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(['submit', str(JUNCTION), *words]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count('\n') == 1
    assert not list(tmp_path.iterdir())


def test_the_point_mass_moves_as_the_centre_does() -> None:
    """On a circle of radius R of the rear axle, the centre moves at v sqrt(1 + (b / R)^2)."""
    from commonroad.common.solution import vehicle_parameters, VehicleType
    kind = VehicleType.FORD_ESCORT
    known = vehicle_parameters[kind]
    radius, speed, b = 20.0, 5.0, known.b
    yaws = 0.3 + speed / radius * np.arange(0.0, 2.0, 1e-3)
    rear = radius * np.stack((np.sin(yaws), -np.cos(yaws)), axis=1)
    centres = rear + b * np.stack((np.cos(yaws), np.sin(yaws)), axis=1)
    states = [KSState(time_step=row, position=centre, velocity=speed, orientation=yaw,
                      steering_angle=math.atan((known.a + b) / radius))
              for row, (centre, yaw) in enumerate(zip(centres, yaws, strict=True))]
    found = np.array([(state.velocity, state.velocity_y)
                      for state in point_mass_states(states, kind)])
    assert np.hypot(*found.T) == pytest.approx(speed * math.hypot(1.0, b / radius))
    assert found[1:-1] == pytest.approx((centres[2:] - centres[:-2]) / 2e-3, abs=1e-5)
