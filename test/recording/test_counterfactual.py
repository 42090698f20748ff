# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The recorded human against the same planner, and against others."""

from collections.abc import Callable
import json
from pathlib import Path
import re
from typing import Any

from crgame_ros.analysis.outcome_line import NO_PLANS
from crgame_ros.cli import main
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest

OWN_PLANNER = '''
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner


class Mine(ConstantVelocityPlanner):
    """Somebody's own."""
'''
STANDING_PLANNER = '''
from dataclasses import replace

from crgame_ros.planner.path_following import braking_plan
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner


class Standing(ConstantVelocityPlanner):
    """Stops where it is."""

    def setup(self, context):
        super().setup(context)
        self.vehicle = context.vehicle

    def plan(self, request):
        return replace(braking_plan(request, None, self.vehicle), fallback=False)
'''
FAILING_PLANNER = '''
from crgame_ros import Planner


class Failing(Planner):
    """Knows no way."""

    name = 'failing'

    def setup(self, context):
        pass

    def plan(self, request):
        raise ValueError('no way')
'''
PLANNERS = {'cut_in': 'idm', 'occluded_pedestrian': 'idm', 'dense_merge': 'idm'}


@pytest.fixture(scope='module')
def record(recorder: Any, tmp_path_factory: pytest.TempPathFactory,
           ) -> Callable[[str], tuple[Path, OfflineResult]]:
    """Return a function that runs a game with uneven steps, and records it, once."""
    known: dict[str, tuple[Path, OfflineResult]] = {}

    def run(name: str) -> tuple[Path, OfflineResult]:
        if name not in known:
            setup = build_setup(load_game(scenarios_directory() / f'{name}.yaml'))
            intervals_s = np.random.default_rng(3).uniform(0.006, 0.014, 800)
            drivers, _ = recorded_inputs(setup)
            result = run_offline(setup, duration_s=8.0, drivers=drivers, intervals_s=intervals_s)
            folder = tmp_path_factory.mktemp(name) / 'run'
            recorder.ours(folder / 'bag', recorder.messages(result, intervals_s=intervals_s))
            known[name] = folder, result
        return known[name]
    return run


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize('name', PLANNERS)
def test_the_same_human_against_the_same_planner_and_another(
        name: str, record: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    """
    The same planner repeats the recorded run to the last bit; another one moves the AV otherwise.

    This holds with traffic and with perception, too; the human repeats its motion in each.
    """
    folder, result = record(name)
    (tmp_path / 'own.py').write_text(OWN_PLANNER)
    monkeypatch.chdir(tmp_path)
    own = PLANNERS[name]
    assert main(['replay', str(folder), '--planner', own, '--planner', 'own.py:Mine',
                 '--out', 'out']) == 0
    text, told = capsys.readouterr()
    own_line, other_line = told.splitlines()[-2:]
    assert own_line.startswith(f'{own}: ') and other_line.startswith('own.py:Mine: ')
    assert all(re.search(r'80 of 80 plans accepted, nuPlan score hv0 [0-9.]+, av0', line)
               for line in (own_line, other_line))
    recorded, same, other = json.loads(Path('out/comparison.json').read_text())
    assert same['state_hash'] == result.state_hash != other['state_hash']
    assert same['human_differs_s'] is same['others_differ_s'] is other['human_differs_s'] is None
    expected = recorded['criticality']['vehicles']
    for vehicle, found in same['criticality']['vehicles'].items():
        assert found['exposures']['tet_s']['value'] == pytest.approx(
            expected[vehicle]['exposures']['tet_s']['value'])
        assert found['worst']['min_distance']['value'] == pytest.approx(
            expected[vehicle]['worst']['min_distance']['value'], abs=1e-6)
    human = recorded['criticality']['vehicles']['hv0']
    assert human['worst'] and 'own.py:Mine' in text and 'others differ' in text
    for file in ('idm.xml', 'own_py_Mine.xml'):
        written = load_scenario(Path('out') / file).scenario
        assert len(written.dynamic_obstacles) >= 2


@pytest.mark.slow
def test_a_planner_that_fails_is_told_of_and_costs_the_others_nothing(
        record: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, _ = record('cut_in')
    (tmp_path / 'failing.py').write_text(FAILING_PLANNER)
    failing = f'{tmp_path / "failing.py"}:Failing'
    assert main(['replay', str(folder), '--planner', failing, '--planner', 'idm',
                 '--out', str(tmp_path / 'out')]) == NO_PLANS
    *_, error, own_line, other_line = told = capsys.readouterr().err.splitlines()
    assert f'  File "{tmp_path / "failing.py"}", line 14, in plan' in told
    assert error == 'error: av0: no plan of its planner was driven: ValueError: no way'
    assert own_line.startswith(f'{failing}: ') and '0 of 80 plans' in own_line
    assert other_line.startswith('idm: ') and '80 of 80 plans' in other_line
    _, fails, drives = json.loads((tmp_path / 'out' / 'comparison.json').read_text())
    assert (fails['accepted_ratio'], drives['accepted_ratio']) == ({'av0': 0.0}, {'av0': 1.0})


@pytest.mark.exhaustive
def test_traffic_that_reacts_makes_another_world(
        record: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An AV stops in the merge: agents behind it brake, and the table has the time."""
    folder, _ = record('dense_merge')
    (tmp_path / 'standing.py').write_text(STANDING_PLANNER)
    assert main(['replay', str(folder), '--planner', f'{tmp_path / "standing.py"}:Standing',
                 '--out', str(tmp_path / 'out')]) == 0
    _, other = json.loads((tmp_path / 'out' / 'comparison.json').read_text())
    assert 0.0 < other['others_differ_s'] < 8.0
    assert f'from {other["others_differ_s"]:.1f} s' in capsys.readouterr().out


@pytest.mark.exhaustive
def test_folders_are_new_and_files_have_names_of_their_own(
        record: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Beside the run, numbered; two planners of one name in two folders."""
    folder, _ = record('cut_in')
    words = []
    for part in ('a', 'b'):
        (tmp_path / part).mkdir()
        (tmp_path / part / 'own.py').write_text(OWN_PLANNER)
        words += ['--planner', f'{tmp_path / part / "own.py"}:Mine']
    for number in ('', '_2'):
        assert main(['replay', str(folder), *words]) == 0
        made = folder / f'replays{number}'
        assert {path.name for path in made.iterdir()} == {
            'comparison.json', 'own_py_Mine_1.xml', 'own_py_Mine_2.xml'}
    assert str(folder / 'replays_2') in capsys.readouterr().out


@pytest.mark.slow
def test_a_human_without_inputs_takes_its_recorded_way(
        record: Any, recorder: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recording without cycles has no inputs, but the paths are known."""
    _, result = record('cut_in')
    messages = [each for each in recorder.messages(result) if each[0] != '/timing/cycle']
    bag = recorder.ours(tmp_path / 'run' / 'bag', messages)
    words = ['replay', str(bag), '--planner', 'idm', '--planner', 'constant-velocity', '--out']
    assert main([*words, str(tmp_path / 'inputs')]) == 2
    assert '/timing/cycle' in capsys.readouterr().err
    assert main([*words, str(tmp_path / 'out'), '--human', 'trajectory']) == 0
    recorded, same, other = json.loads((tmp_path / 'out' / 'comparison.json').read_text())
    assert same['human_differs_s'] is other['human_differs_s'] is None
    gaps = [each['criticality']['vehicles']['av0']['worst']['gap']
            for each in (recorded, same, other)]
    assert gaps[1]['value'] == pytest.approx(gaps[0]['value'], abs=1e-9)
    assert gaps[2]['value'] > gaps[0]['value'] + 1.0


def test_a_run_is_named_by_its_folder_or_its_recording(
        record: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, result = record('cut_in')
    for words in (('info',), ('recover',), ('convert', '--out', str(tmp_path / 'run.xml'))):
        said = []
        for place in (folder, folder / 'bag'):
            assert main([words[0], str(place), *words[1:]]) == 0
            said.append(capsys.readouterr())
        assert said[0] == said[1]
    assert main(['offline', '--driver', f'replay:{folder}', '--planner', PLANNERS['cut_in'],
                 '--duration', '8']) == 0
    assert json.loads(capsys.readouterr().out)['state_hash'] == result.state_hash


@pytest.mark.parametrize('words', [
    ('missing', '--planner', 'idm'), ('{run}', '--planner', 'nobody'), ('{run}',),
    ('{run}', '--planner', 'idm', '--latency', '-1'),
    ('{run}', '--planner', 'idm', '--live', '--latency', '3'),
    ('{run}', '--planner', 'idm', '--live', '--human', 'trajectory'),
    ('{run}', '--planner', 'idm', '--headless'),
    ('{run}', '--planner', 'idm', '--out', '/proc/none')])
def test_what_cannot_be_replayed_is_told_in_a_line(
        words: tuple[str, ...], record: Any, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is driven, nothing written."""
    folder, _ = record('cut_in')
    before = sorted(folder.rglob('*'))
    assert main(['replay', *(word.format(run=folder) for word in words)]) == 2
    error = capsys.readouterr().err
    assert error.startswith('error: ') and error.count('\n') == 1
    assert sorted(folder.rglob('*')) == before
