# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""However a run ends, its files are there and no process is left behind."""

from collections.abc import Callable
import os
from pathlib import Path
import re
import shlex
import shutil
import signal
import subprocess
import sys

from crgame_ros.launcher.interruption import writing
from crgame_ros.launcher.main import ENDED_EARLY
from live_peer import Peer
from live_support import CUT_IN, is_node, Launcher, ROOT, wait_until
import pytest
from ros_domains import own_domain_id


def _files(folder: Path) -> None:
    assert len(list(folder.glob('*.xml'))) == 1
    assert (folder / 'timing.json').is_file() and (folder / 'game.yaml').is_file()
    assert list((folder / 'bag').glob('*.mcap'))


@pytest.mark.exhaustive
def test_a_closed_terminal_is_an_end_in_good_order(tmp_path: Path) -> None:
    with Launcher([CUT_IN], tmp_path / 'run') as launcher:
        launcher.wait_for('recording into')
        wait_until(lambda: (tmp_path / 'run' / 'bag').is_dir(), 'the bag')
        launcher.wait_for('planner idm is ready')
        # Some steps, so that there is something to export.
        wait_until(lambda: any(path.stat().st_size > 100_000 for path in (
            tmp_path / 'run' / 'bag').glob('*.mcap')), 'a recording')
        launcher.signal(signal.SIGHUP)
        assert launcher.wait() == 0
        _files(launcher.out)
        assert 'again: ./run.sh' in launcher.lines[-2]
        assert launcher.lines[-1].startswith('run: 0 contacts, ')


@pytest.mark.exhaustive
def test_a_run_whose_folder_is_removed_goes_on_to_its_end(tmp_path: Path) -> None:
    with Launcher([CUT_IN, '--duration', '4'], tmp_path / 'run') as launcher:
        wait_until(lambda: launcher.says('recording into'), 'the recording')
        shutil.rmtree(tmp_path / 'run')
        assert launcher.wait() == 1
        assert launcher.says(r'finished at 4.00 s')
        assert launcher.text.splitlines()[-1].endswith(
            'has been removed during the run: nothing is left')
        assert not launcher.says('Traceback')
        assert launcher.errors == []


@pytest.mark.exhaustive
def test_a_closed_pipe_ends_it_without_a_traceback(tmp_path: Path) -> None:
    """`./run.sh | head`: the first line is read, then the pipe is closed."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'crgame_ros.launcher.main', str(CUT_IN), '--headless', '--out',
         str(tmp_path / 'run')], cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True,
        env=os.environ | {'ROS_DOMAIN_ID': str(own_domain_id())})
    assert process.stdout is not None and process.stderr is not None
    assert process.stdout.readline()
    process.stdout.close()
    errors = process.stderr.read()
    process.wait(60.0)
    assert 'Traceback' not in errors and 'Exception' not in errors
    process.stderr.close()


def _of_session(session: int) -> list[str]:
    """Name the processes of a session; its number is the sixth field of proc(5)'s stat."""
    found = []
    for stat in Path('/proc').glob('[0-9]*/stat'):
        try:
            name, _, rest = stat.read_text().partition('(')[2].rpartition(')')
        except OSError:
            continue
        if int(rest.split()[3]) == session and rest.split()[0] != 'Z':
            found.append(name)
    return found


def _is_python(process: subprocess.Popen[str], _said: list[str]) -> bool:
    return Path(f'/proc/{process.pid}/cmdline').read_bytes().startswith(
        f'{sys.executable}\0-m\0crgame_ros.launcher.main\0'.encode())


def _loads_numpy(process: subprocess.Popen[str], _said: list[str]) -> bool:
    return '_multiarray_umath' in Path(f'/proc/{process.pid}/maps').read_text()


def _says(pattern: str) -> Callable[[subprocess.Popen[str], list[str]], bool]:
    def heard(process: subprocess.Popen[str], said: list[str]) -> bool:
        assert process.stdout is not None
        said.append(process.stdout.readline())
        assert said[-1], said
        return re.search(pattern, said[-1]) is not None
    return heard


@pytest.mark.matrix
@pytest.mark.parametrize('moment', [_is_python, _loads_numpy, _says('^sim_node: process')],
                         ids=['Python starts', 'imports', 'first node'])
def test_ctrl_c_during_the_start_is_a_line_and_no_traceback(
        moment: Callable[[subprocess.Popen[str], list[str]], bool], tmp_path: Path) -> None:
    """The run is started as by run.sh; all processes at the terminal get the signal."""
    line = (ROOT / 'run.sh').read_text().splitlines()[-1]
    words = [{'$CRGAME_PYTHON': sys.executable}.get(word, word) for word in shlex.split(line)]
    assert words[0] == 'exec' and words[-1] == '$@'
    process = subprocess.Popen(
        [*words[1:-1], str(CUT_IN), '--headless', '--no-report', '--out', str(tmp_path / 'run')],
        cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, start_new_session=True,
        env=os.environ | {'ROS_DOMAIN_ID': str(own_domain_id())})
    said: list[str] = []
    with process:
        try:
            wait_until(lambda: moment(process, said), 'the moment')
            os.killpg(process.pid, signal.SIGINT)
            assert process.stdout is not None
            text = ''.join(said) + process.stdout.read()
            assert process.wait(60.0) == 0, text
            assert 'Traceback' not in text, text
            last = text.splitlines()[-2:]
            # On a busy machine the signal may come later than at the moment that was seen: there
            # may even be steps, which the last line then tells of.
            assert any(line.startswith('again: ./run.sh') for line in last) or (
                last[-1] == ENDED_EARLY and 'sim_node: process' not in text), text
            wait_until(lambda: not _of_session(process.pid), 'the end of everybody', 20.0)
        finally:
            process.kill()


@pytest.mark.exhaustive
def test_a_stopped_node_does_not_outlive_a_killed_launcher(tmp_path: Path) -> None:
    with Launcher([CUT_IN], tmp_path / 'run') as launcher:
        launcher.wait_for('planner idm is ready')
        launcher.wait_for('recording into')
        for name in ('planner_node_av0', 'recorder_node', 'sim_node'):
            launcher.freeze(name)
        launcher.signal(signal.SIGKILL)
        wait_until(lambda: not any(is_node(pid) for _, pid in launcher.started),
                   'the end of every node', 20.0)


def test_files_are_written_through_one_signal_and_left_at_a_second() -> None:
    said: list[str] = []
    before = signal.getsignal(signal.SIGHUP)
    with writing(said.append):
        os.kill(os.getpid(), signal.SIGTERM)
    assert len(said) == 1 and 'crgame recover' in said[0]
    with pytest.raises(KeyboardInterrupt), writing(said.append):
        os.kill(os.getpid(), signal.SIGHUP)
        os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGHUP) == before


@pytest.mark.exhaustive
def test_runs_that_a_reset_ended_at_once_are_no_failure(tmp_path: Path) -> None:
    """Two resets in a row, then a stop: the first run has its files, the others a line."""
    with Launcher([CUT_IN], tmp_path / 'run') as launcher, \
            Peer(launcher.domain, '/clock', '/scenario/game') as peer:
        peer.wait_until(lambda: peer.games and peer.n > 50, 'some steps')
        for service in ('/sim/reset', '/sim/reset', '/sim/stop'):
            assert peer.call(service).success
        assert launcher.wait() == 0, launcher.text
    _files(launcher.out)
    assert not launcher.says('error|record this topic')
    assert launcher.says('run ended before its first step|run [23] ended before it began')
