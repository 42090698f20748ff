# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report of a recording: by its command, and at the end of a run."""

from collections.abc import Callable
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

from crgame_ros.analysis.scores.solution_judge import SolutionJudge
from crgame_ros.cli import main
from crgame_ros.game.game import AvSpec
from crgame_ros.launcher.finisher import Finisher
from crgame_ros.simulation.offline import OfflineResult
import pytest

TRAFFIC = 'ZAM_Traffic-1_1_T-1.xml'


@pytest.fixture(scope='module')
def recorded(tmp_path_factory: pytest.TempPathFactory, recorder: Any,
             drive: Callable[..., OfflineResult]) -> Path:
    """Record a run of 3 s."""
    folder = tmp_path_factory.mktemp('reported') / 'my run'
    recorder.ours(folder / 'bag', recorder.messages(drive(TRAFFIC, duration_s=3.0)))
    return folder


@pytest.fixture
def session(recorded: Path, tmp_path: Path) -> Path:
    """Copy the recording into a session of its own."""
    folder = tmp_path / 'session'
    (folder / 'bag').mkdir(parents=True)
    for path in (recorded / 'bag').iterdir():
        (folder / 'bag' / path.name).write_bytes(path.read_bytes())
    return folder


@pytest.mark.slow
def test_the_command_writes_one_file(recorded: Path, tmp_path: Path,
                                     capsys: pytest.CaptureFixture[str]) -> None:
    """It lies beside the recording or at a given place, with the same bytes each time."""
    assert main(['report', str(recorded)]) == 0
    report = recorded / 'report.html'
    assert capsys.readouterr().out == f'{report}\n'
    out = tmp_path / 'again.html'
    assert main(['report', str(recorded / 'bag'), '--out', str(out)]) == 0
    assert out.read_bytes() == report.read_bytes()
    text = out.read_text(encoding='utf-8')
    assert '<bdi>my run</bdi>' in text and 'recorded 2023-11-14 22:13:20 UTC' in text
    assert len(text) < 6_000_000
    report.unlink()
    assert not list(tmp_path.glob('.*'))


@pytest.mark.exhaustive
def test_several_runs_in_one_file(recorded: Path, tmp_path: Path) -> None:
    """They are compared."""
    out = tmp_path / 'both.html'
    assert main(['report', str(recorded), str(recorded), '--out', str(out)]) == 0
    text = out.read_text(encoding='utf-8')
    assert text.count('<article') == 2 and 'id="all-comparison"' in text


@pytest.mark.parametrize(('words', 'said'), [
    (['missing'], 'no such file'), (['.', '--out', 'report.pdf'], 'no name of an HTML file'),
    (['.', '--out', 'nowhere/report.html'], 'no such folder'), ([], 'RUN'),
    (['.'] * 13, 'give 12 at most')])
def test_bad_input_is_one_line(words: list[str], said: str, tmp_path: Path,
                               monkeypatch: pytest.MonkeyPatch,
                               capsys: pytest.CaptureFixture[str]) -> None:
    """It exits with 2, and no file is made."""
    monkeypatch.chdir(tmp_path)
    assert main(['report', *words]) == 2
    line = capsys.readouterr().err
    assert said in line and len(line.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_run_that_ends_writes_its_report_last(session: Path) -> None:
    """Scenario and timing are there before the report begins; it has its own duration."""
    there: list[list[str]] = []
    said: list[str] = []

    def say(line: str) -> None:
        said.append(line)
        if line.startswith('writing '):
            there.append(sorted(path.name for path in session.iterdir()))
    finisher = Finisher(session, say)
    assert finisher.finish_all() == 0
    assert not (session / 'report.html').exists()
    finisher.write_reports()
    assert there == [[TRAFFIC, 'bag', 'timing.json']]
    assert said[-1].startswith(f'  {session / "report.html"} (') and said[-1].endswith(' s)')
    text = (session / 'report.html').read_text(encoding='utf-8')
    assert 'Run and report are of crgame_ros' in text


def test_the_end_of_a_run_does_not_wait_for_the_checker(
        tmp_path: Path, recorder: Any, drive: Callable[..., OfflineResult],
        monkeypatch: pytest.MonkeyPatch) -> None:
    """Planners have nuPlan's score at once, and CommonRoad's by the command."""
    result = drive('ZAM_CutIn-1_1_T-1.xml', avs=(AvSpec('av0'),))
    recorder.ours(tmp_path / 'bag', recorder.messages(result))
    finisher = Finisher(tmp_path, lambda _: None)
    assert finisher.finish_all() == 0
    with monkeypatch.context() as patched:
        patched.setattr(SolutionJudge, 'judge', None)
        finisher.write_reports()
    text = (tmp_path / 'report.html').read_text(encoding='utf-8')
    assert 'nuPlan score, of 1' in text and 'CommonRoad cost' not in text
    assert main(['report', str(tmp_path)]) == 0
    text = (tmp_path / 'report.html').read_text(encoding='utf-8')
    assert 'nuPlan score, of 1' in text and 'CommonRoad cost SM1' in text


def test_a_wanted_end_before_the_start_is_no_failure(tmp_path: Path) -> None:
    """Ctrl-C may come while a run waits for its driver; without it a run records something."""
    assert Finisher(tmp_path, lambda _: None).finish_all(asked_to_end=True) == 0
    assert Finisher(tmp_path, lambda _: None).finish_all() == 1


def test_a_process_that_was_killed_leaves_its_run_to_the_end(
        session: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It may have said more than a pipe holds."""
    program = session.parent / 'killed.sh'
    program.write_text('#!/bin/sh\nhead -c 200000 /dev/zero | tr "\\0" x\nkill -9 $$\n')
    program.chmod(0o700)
    said: list[str] = []
    finisher = Finisher(session, said.append, reports=False)
    with monkeypatch.context() as patched:
        patched.setattr(sys, 'executable', str(program))
        until_s = time.monotonic() + 20.0
        while not said:
            assert time.monotonic() < until_s
            finisher.poll()
            time.sleep(0.05)
    assert said == ['x' * 200_000]
    assert finisher.finish_all() == 0
    assert (session / 'timing.json').exists()


def test_without_report_there_is_none(session: Path) -> None:
    """`--no-report` leaves it out."""
    finisher = Finisher(session, lambda _: None, reports=False)
    assert finisher.finish_all() == 0
    finisher.write_reports()
    assert sorted(path.name for path in session.iterdir()) == [TRAFFIC, 'bag', 'timing.json']


def test_two_signals_leave_the_report_out_and_all_else_whole(session: Path) -> None:
    """The first has an answer, the second ends the report alone."""
    said: list[str] = []

    def say(line: str) -> None:
        said.append(line)
        if line.startswith(('writing ', 'still writing the report')):
            os.kill(os.getpid(), signal.SIGINT)
    finisher = Finisher(session, say)
    assert finisher.finish_all() == 0
    before = signal.getsignal(signal.SIGINT)
    finisher.write_reports()
    assert signal.getsignal(signal.SIGINT) is before
    assert said[-1] == f'no report; `crgame report {session}` writes it'
    assert 'still writing the report; once more leaves it out' in said
    assert sorted(path.name for path in session.iterdir()) == [TRAFFIC, 'bag', 'timing.json']
    assert main(['report', str(session)]) == 0


@pytest.mark.exhaustive
@pytest.mark.parametrize('words', [[], ['--no-report']])
def test_beside_a_graph_that_goes_on(session: Path, words: list[str]) -> None:
    """The process that finishes a run while the program stays for another."""
    done = subprocess.run(
        [sys.executable, '-m', 'crgame_ros.launcher.finish_process', str(session), *words],
        capture_output=True, text=True, check=True)
    assert (session / '.finished').exists() and (session / 'timing.json').exists()
    assert (session / 'report.html').exists() == ('writing ' in done.stdout) == (not words)
