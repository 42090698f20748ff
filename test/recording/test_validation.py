# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame validate`: it reports the faults of a file, and nothing for a correct one."""

import json
from pathlib import Path
import shutil
from typing import Any

from crgame_ros.cli import main
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory, share_directory
from crgame_ros.recording.finish import finish_run
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.verdict.validation import validate
import pytest


@pytest.fixture(scope='module')
def run(recorder: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a second of a game, with all files of a run."""
    folder = tmp_path_factory.mktemp('runs') / 'run'
    setup = build_setup(load_game(scenarios_directory() / 'parked_cars.yaml'))
    result = run_offline(setup, duration_s=1.0)
    recorder.ours(folder / 'bag', recorder.messages(result))
    assert finish_run(folder, print) == 0
    return folder


def _told(path: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    code = main(['validate', str(path)])
    said = capsys.readouterr()
    return code, said.out, said.err


@pytest.mark.parametrize(('name', 'kind'), [
    ('scenarios/cut_in.yaml', 'game file'), ('scenarios/cut_in.keys.yaml', 'scripted driver'),
    ('config/control.yaml', 'gains and lags'), ('config/vehicles/bmw_320i.yaml', 'vehicle'),
    ('config/devices/keyboard.yaml', 'device map'),
    ('config/vehicles/steering_ratio.yaml', 'table of steering ratios'),
    ('scenarios/ZAM_CutIn-1_1_T-1.xml', 'CommonRoad scenario of version 2020a')])
def test_own_files_are_valid_and_of_their_kind(name: str, kind: str,
                                               capsys: pytest.CaptureFixture[str]) -> None:
    path = share_directory() / name
    assert _told(path, capsys) == (0, f'{path}: {kind}, valid\n', '')


def test_the_folder_of_a_run_is_all_its_files(run: Path,
                                              capsys: pytest.CaptureFixture[str]) -> None:
    """Recording, scenario and timing report, each by itself; a note of scores is none of them."""
    note = run / 'scores.json'
    note.write_text('[]')
    code, out, err = _told(run, capsys)
    note.unlink()
    assert (code, err) == (0, '')
    lines = [line.partition(': ')[2] for line in out.splitlines() if not line.startswith('  ')]
    assert len(lines) == 3 and all(line.endswith(', valid') for line in lines)
    assert {line.split(' of ')[0].split(',')[0] for line in lines} == {
        'recording', 'CommonRoad scenario', 'timing report'}


@pytest.mark.parametrize(('given', 'wrong', 'words'), [
    ('key: objects.b0.deceleration', 'key: objects.b7.deceleration',
     "vary[2]: there is no entry 'b7'; there are b0"),
    ('measure: collision', 'measure: colision',
     "expect[0]: there is no measure 'colision'; did you mean collision or time_to_collision?")])
def test_what_cannot_vary_or_be_expected_is_told(
        given: str, wrong: str, words: str, tmp_path: Path,
        capsys: pytest.CaptureFixture[str]) -> None:
    text = (scenarios_directory() / 'cut_in_family.yaml').read_text().replace(
        'scenario: ', f'scenario: {scenarios_directory()}/')
    file = tmp_path / 'game.yaml'
    file.write_text(text)
    assert _told(file, capsys)[0] == 0
    file.write_text(text.replace(given, wrong))
    code, out, err = _told(file, capsys)
    assert (code, out) == (2, f'{file}: game file, not valid\n')
    assert words in err


def test_all_that_is_wrong_with_a_game_is_told(tmp_path: Path,
                                               capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'game.yaml'
    file.write_text('scenario: none.xml\nseed: many\nduration: -3\ncolour: red\n')
    code, out, err = _told(file, capsys)
    assert code == 2 and out == f'{file}: game file, not valid\n'
    assert len(err.splitlines()) == 3
    assert all(word in err for word in ('seed', 'duration', 'colour'))
    file.write_text('scenario: none.xml\n')
    assert 'none.xml' in _told(file, capsys)[2]


def test_a_scenario_is_checked_by_the_schema(tmp_path: Path,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    """It reports an element that the schema does not know, and an unread document type."""
    text = (scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml').read_text()
    file = tmp_path / 'changed.xml'
    file.write_text(text.replace('</commonRoad>', '<weather/></commonRoad>'))
    code, out, err = _told(file, capsys)
    assert code == 2 and 'not valid' in out and 'weather' in err
    start = text.index('<commonRoad')
    file.write_text(text[:start] + '<!DOCTYPE a [<!ENTITY b "c">]>' + text[start:])
    code, _, err = _told(file, capsys)
    assert code == 2 and len(err.splitlines()) == 1 and 'document type' in err.lower()


def test_a_recording_that_was_cut_off_is_none(run: Path, tmp_path: Path,
                                              capsys: pytest.CaptureFixture[str]) -> None:
    """The report names the command that finishes it."""
    shutil.copytree(run / 'bag', tmp_path / 'bag')
    (file,) = (tmp_path / 'bag').glob('*.mcap')
    file.write_bytes(file.read_bytes()[:-100])
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    code, _, err = _told(tmp_path / 'bag', capsys)
    assert code == 2 and 'crgame recover' in err


def test_a_timing_report_tells_why_steps_were_late(run: Path, tmp_path: Path,
                                                   capsys: pytest.CaptureFixture[str]) -> None:
    """It may have them, be of an earlier version without them, or have them in part."""
    report = json.loads((run / 'timing.json').read_text())
    assert report['late_steps'] is not None
    file = tmp_path / 'timing.json'
    for late in (report['late_steps'], None):
        file.write_text(json.dumps(report | {'late_steps': late}))
        assert _told(file, capsys)[0] == 0
    file.write_text(json.dumps(report | {'late_steps': {'count': 1}}))
    code, _, err = _told(file, capsys)
    assert code == 2 and 'lacks late_steps.by_cause, late_steps.late_ms' in err


def test_tables_are_checked_by_their_dictionary(run: Path, tmp_path: Path,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    """Both formats; a file that was changed, one that is missing, a column of another type."""
    for kind in ('parquet', 'csv'):
        out = tmp_path / kind
        assert main(['export', str(run), '--to', kind, '--out', str(out)]) == 0
        capsys.readouterr()
        code, said, err = _told(out, capsys)
        assert (code, err) == (0, '') and said.endswith(' tables, valid\n')
    states = tmp_path / 'csv' / 'states.csv'
    states.write_text(states.read_text().replace('hv0', 'hv9', 1))
    (tmp_path / 'csv' / 'events.csv').unlink()
    code, _, err = _told(tmp_path / 'csv', capsys)
    assert code == 2 and len(err.splitlines()) == 2
    assert 'states.csv: was changed' in err and 'events.csv: cannot be read' in err
    package = tmp_path / 'parquet' / 'datapackage.json'
    package.write_text(package.read_text().replace('"name": "time_s",\n      "type": "number"',
                                                   '"name": "time_s",\n      "type": "integer"'))
    assert 'other columns or types than the dictionary: time_s' in _told(
        tmp_path / 'parquet', capsys)[2]
    package.write_text('{"resources": [{"path": "../a"}]}')
    code, said, err = _told(tmp_path / 'parquet', capsys)
    assert (code, said) == (2, f'{tmp_path / "parquet"}: tables, not valid\n')
    assert 'no data dictionary of ours' in err


def test_solutions_are_checked_by_their_schema(run: Path, tmp_path: Path,
                                               capsys: pytest.CaptureFixture[str]) -> None:
    """One is our own, and one has a bad number."""
    assert main(['score', str(run), '--out', str(tmp_path / 'scores')]) == 0
    capsys.readouterr()
    file = next(iter(sorted((tmp_path / 'scores').glob('solution_*.xml'))))
    assert _told(file, capsys)[1] == f'{file}: CommonRoad solution of 1 planning problems, valid\n'
    text = file.read_text()
    start, end = text.index('<x>') + 3, text.index('</x>')
    file.write_text(f'{text[:start]}far{text[end:]}')
    code, _, err = _told(file, capsys)
    assert code == 2 and 'far' in err


def test_a_number_of_400_digits_is_no_time(tmp_path: Path) -> None:
    journal = tmp_path / 'journal.jsonl'
    begun = '{"entry": "begun", "at": 1, "participant": "P01", "place": 0, "items": []}'
    wrong = ['{"entry": "x", "at": 1' + 400 * '0' + '}', '{"entry": "begun", "at": 1}', '[1]', '{']
    journal.write_text('\n'.join([begun, *wrong, '']))
    found = validate(journal)
    assert found.kind == 'journal of a session of 1 entries'
    assert [(f'{journal}: line {number} cannot be read as an entry' in fault, words in fault)
            for number, (fault, words) in enumerate(zip(found.faults, (
                'at is 1000', 'has no participant', 'is no entry', 'Expecting'), strict=True), 2)
            ] == [(True, True)] * 4


@pytest.mark.parametrize(('name', 'content', 'words'), [
    ('missing.xml', None, 'no such file'), ('a.txt', 'hello', 'no kind of file'),
    ('a.yaml', 'weather: fine\n', 'no keys of a game'), ('a.json', '{"gaps": 0}', 'lacks'),
    ('b.json', '[' * 100_000, 'no JSON'), ('a.xml', '<html/>', '<html>')])
def test_what_is_nothing_is_said_in_a_line(name: str, content: str | None, words: str,
                                           tmp_path: Path,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    if content is not None:
        (tmp_path / name).write_text(content)
    code, _, err = _told(tmp_path / name, capsys)
    assert code == 2 and words in err and len(err.splitlines()) == 1
