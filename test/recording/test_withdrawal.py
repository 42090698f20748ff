# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A withdrawal deletes one participant's data everywhere, and finishes after any interruption."""

import json
from pathlib import Path
import signal
import subprocess
import sys

from crgame_ros.cli import main
from crgame_ros.study.folder import WITHDRAWALS
from crgame_ros.study.groups import free_place
from crgame_ros.study.session_journal import SessionJournal
from personal_files import unlisted_files
import polars
import pytest
from study_maker import Studied

pytestmark = pytest.mark.xdist_group('study-data')
ID = 'P02'
PLANNER = 'constant-velocity'


def withdraw(folder: Path, *more: str) -> int:
    """Withdraw a participant without being asked."""
    return main(['study', 'withdraw', str(folder), '--participant', ID, '--yes', *more])


def traces(folder: Path) -> list[str]:
    """Return the files whose name or content tells of the participant."""
    found = []
    for path in sorted(folder.rglob('*')):
        name = path.relative_to(folder).as_posix()
        if ID in name:
            found.append(name)
        elif path.suffix == '.parquet':
            rows = polars.read_parquet(path)
            texts = rows.select(polars.col(polars.String))
            if any(texts[column].str.contains(ID).any() for column in texts.columns):
                found.append(name)
        elif path.suffix in ('.csv', '.tsv', '.json', '.jsonl', '.html') \
                and ID in path.read_text('utf-8', 'surrogateescape'):
            found.append(name)
    return found


@pytest.mark.slow
def test_nothing_of_the_participant_is_left(copied: Path,
                                            capsys: pytest.CaptureFixture[str]) -> None:
    """Tables, dictionary, BIDS, report, caches and reruns are gone or are of the others."""
    assert main(['study', 'report', str(copied)]) == 0
    assert main(['study', 'rerun', str(copied), '--planner', PLANNER, '--workers', '1']) == 0
    assert unlisted_files(copied) == []
    kept = set((copied / 'data' / '.runs').iterdir())
    (copied / 'data' / 'mine.R').write_text('# of the researcher\n')
    before = traces(copied)
    for part in ('journal.jsonl', 'bag', 'data/trials.csv', 'data/runs/vehicles.parquet',
                 'data/.runs/', 'data/bids/sub-P02', 'data/report.html', 'data/rerun/',
                 'data/provenance.json'):
        assert any(part in name for name in before), part
    capsys.readouterr()
    assert withdraw(copied) == 0
    told = capsys.readouterr().out
    assert f'deleted {copied / "data" / "rerun"}: ' in told and 'mine.R' in told
    assert traces(copied) == []
    people = polars.read_parquet(copied / 'data' / 'participants.parquet')
    assert people['participant'].to_list() == ['P01', 'P03', 'P04']
    # What was measured of the others is not measured again.
    assert set((copied / 'data' / '.runs').iterdir()) < kept
    assert (copied / 'data' / 'bids' / 'sub-P01').is_dir()
    report = (copied / 'data' / 'report.html').read_text('utf-8')
    assert 'withdrawn, data deleted' in report
    line, = (copied / WITHDRAWALS).read_text('utf-8').splitlines()
    assert json.loads(line).keys() == {'date', 'place', 'what'}
    assert json.loads(line)['place'] == 2
    # The next participant gets the place, so that the orders are balanced as planned.
    assert free_place(copied / 'participants') == 1
    assert main(['validate', str(copied)]) == 0


@pytest.mark.matrix('4')
@pytest.mark.parametrize('lines', [1, 4, 7])
def test_an_interrupted_withdrawal_finishes(copied: Path, lines: int) -> None:
    """It is killed behind that many printed lines; until it is finished, no table is written."""
    command = [sys.executable, '-m', 'crgame_ros.cli', 'study', 'withdraw', str(copied),
               '--participant', ID, '--yes']
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for _ in range(lines):
            assert process.stdout.readline().startswith('deleted ')
        process.send_signal(signal.SIGKILL)
    assert unlisted_files(copied) == []
    assert main(['study', 'data', str(copied)]) == 2
    assert withdraw(copied) == 0
    assert traces(copied) == [] and not (copied / '.withdrawing').exists()
    assert len((copied / WITHDRAWALS).read_text('utf-8').splitlines()) == 1
    assert polars.read_parquet(copied / 'data' / 'participants.parquet').height == 3


def test_data_are_gone_even_if_the_tables_cannot_be_written(
        copied: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The study file does not fit the journals any more, until it is put back."""
    file = copied / 'study' / 'study.yaml'
    usual = file.read_text('utf-8')
    file.write_text(usual.replace('after: [{questions: ssq}]', 'after: []'), 'utf-8')
    assert withdraw(copied) == 2
    assert 'all data of P02 are deleted, but' in capsys.readouterr().err
    assert traces(copied) == ['.withdrawing/P02', '.withdrawing/P02/withdrawal.json']
    file.write_text(usual, 'utf-8')
    assert withdraw(copied) == 0
    assert traces(copied) == [] and (copied / 'data' / 'trials.csv').exists()


def test_what_cannot_be_withdrawn_is_refused(copied: Path, studied: Studied,
                                             capsys: pytest.CaptureFixture[str],
                                             monkeypatch: pytest.MonkeyPatch) -> None:
    before = traces(copied)
    with SessionJournal(copied / 'participants' / ID):
        assert withdraw(copied) == 2
    assert 'takes part at the moment' in capsys.readouterr().err
    monkeypatch.setattr(sys, 'stdin', (copied / 'study' / 'study.yaml').open())
    assert main(['study', 'withdraw', str(copied), '--participant', ID]) == 2
    assert 'there is no terminal' in capsys.readouterr().err
    assert main(['study', 'withdraw', str(copied), '--participant', 'P99', '--yes']) == 2
    assert main(['study', 'withdraw', str(copied / 'data'), '--participant', ID, '--yes']) == 2
    assert traces(copied) == before and not (copied / WITHDRAWALS).exists()


def test_everybody_can_withdraw(copied: Path) -> None:
    """The tables are empty then."""
    for name in ('P01', 'P02', 'P03', 'P04'):
        assert main(['study', 'withdraw', str(copied), '--participant', name, '--yes']) == 0
    assert polars.read_parquet(copied / 'data' / 'trials.parquet').height == 0
    assert len((copied / WITHDRAWALS).read_text('utf-8').splitlines()) == 4
