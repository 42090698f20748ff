# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A graph of real processes under the launcher, and shared helpers of the live tests."""

from collections.abc import Callable, Sequence
from contextlib import suppress
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import threading
import time
from types import TracebackType
from typing import IO, Self

from crgame_ros.ros.node_main import TELL_WHERE
from ros_domains import own_domain_id

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / 'scenarios'
CUT_IN = SCENARIOS / 'cut_in.yaml'
# As the kernel names their processes, in 15 characters.
NODES = {path.stem[:15] for path in (ROOT / 'crgame_ros' / 'nodes').glob('*_node.py')}
# How long to wait for an expected event [s]: many times what an idle machine takes.
PATIENCE_S = 90.0
_STARTED = re.compile(r'(\w+): process (\d+)')


def wait_until(condition: Callable[[], object], what: str, limit_s: float = PATIENCE_S) -> None:
    """Check a condition until it holds; fail, naming it, if it never does."""
    until_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < until_s, f'waited {limit_s:g} s in vain for {what}'
        time.sleep(0.02)


def is_node(pid: int) -> bool:
    """Return whether a process is one of our nodes and runs."""
    try:
        name = Path(f'/proc/{pid}/comm').read_text().strip()
        return name in NODES and _state(pid) != 'Z'
    except OSError:
        return False


def _state(pid: int) -> str:
    """Return the state of a process, one letter as in proc(5)."""
    return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0]


class Launcher:
    """
    A run started from the command line, in a domain of its own; every process ends with it.

    :param arguments: of the launcher.
    :param out: folder of the run; None leaves the choice to the launcher.
    :param cwd: where it is started.
    :param headless: without the cockpit.
    :param report: with the report at the end, which only its own test needs.
    :param domain: that of another run; one of its own if not given.
    """

    def __init__(self, arguments: Sequence[str | Path], out: Path | None = None,
                 cwd: Path = ROOT, *, headless: bool = True, domain: int | None = None,
                 report: bool = False) -> None:
        self.domain = own_domain_id() if domain is None else domain
        self.out = out or cwd
        words = [*map(str, arguments), *(['--out', str(out)] if out else []),
                 *(['--headless'] if headless else []), *([] if report else ['--no-report'])]
        environment = {key: value for key, value in os.environ.items()
                       if not key.startswith('CRGAME_')}
        self._process = subprocess.Popen(
            [sys.executable, '-u', '-m', 'crgame_ros.launcher.main', *words],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            cwd=cwd, env=environment | {'ROS_DOMAIN_ID': str(self.domain)})
        self.lines: list[str] = []
        self.errors: list[str] = []
        self._readers = [threading.Thread(target=self._read, args=pair) for pair in (
            (self._process.stdout, self.lines), (self._process.stderr, self.errors))]
        for reader in self._readers:
            reader.start()

    @staticmethod
    def _read(stream: IO[str], lines: list[str]) -> None:
        for line in stream:
            lines.append(line.rstrip('\n'))
            # pytest shows it with the test that fails.
            print(line, end='')

    @property
    def pid(self) -> int:
        """Process id of the launcher."""
        return self._process.pid

    @property
    def text(self) -> str:
        """All output so far."""
        return '\n'.join(self.lines)

    @property
    def started(self) -> list[tuple[str, int]]:
        """Name and process id of every node started so far, in order."""
        return [(found[1], int(found[2])) for line in list(self.lines)
                if (found := _STARTED.fullmatch(line))]

    @property
    def page(self) -> str:
        """Address of the cockpit, once it has been printed."""
        self.wait_for(r'the cockpit is at http://')
        return next(found[0] for line in reversed(list(self.lines))
                    if (found := re.search(r'http://\S+', line)))

    def node(self, name: str) -> int:
        """Return the process id of a node, the latest if it was started again."""
        return dict(self.started)[name]

    def says(self, pattern: str) -> bool:
        """Return whether a line with this regular expression has come."""
        return any(re.search(pattern, line) for line in list(self.lines))

    @property
    def complaints(self) -> list[str]:
        """Return the lines that report a fault: a machine that is too busy is none of ours."""
        return [line for line in list(self.lines) if re.search('Traceback|ERROR|WARN', line)
                and 'slower than real time' not in line]

    def wait_for(self, pattern: str) -> None:
        """Wait for a line with this regular expression."""
        wait_until(lambda: self.says(pattern) or self._process.poll() is not None,
                   f'the line {pattern}')
        wait_until(lambda: self.says(pattern), f'the line {pattern}, in\n{self.text}', 2.0)

    def signal(self, number: int) -> None:
        """Send a signal to the launcher."""
        self._process.send_signal(number)

    def kill(self, name: str) -> None:
        """Kill a node."""
        os.kill(self.node(name), signal.SIGKILL)

    def freeze(self, name: str) -> None:
        """Stop a node where it is, and wait until it stands: on a busy machine that takes time."""
        pid = self.node(name)
        os.kill(pid, signal.SIGSTOP)
        wait_until(lambda: _state(pid) == 'T', f'{name} to stand')

    def thaw(self, name: str) -> None:
        """Resume a frozen node."""
        os.kill(self.node(name), signal.SIGCONT)

    def tell_where(self) -> None:
        """Make every node print the stacks of its threads, to explain why a test failed."""
        for name, pid in dict(self.started).items():
            if is_node(pid) and _state(pid) != 'T':
                print(f'{name}: where it is:')
                os.kill(pid, TELL_WHERE)
        time.sleep(1.0)

    def wait_for_restart(self, name: str, times: int = 1) -> None:
        """Wait until a node has been started again so often."""
        wait_until(lambda: [item for item, _ in self.started].count(name) > times,
                   f'another start of {name}')

    def wait(self) -> int:
        """Wait for the launcher's end and return its exit code."""
        wait_until(lambda: self._process.poll() is not None, f'the end of\n{self.text}')
        for reader in self._readers:
            reader.join(10.0)
        return self._process.wait()

    def close(self) -> None:
        """End its processes that still run."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        for _, pid in self.started:
            if is_node(pid):
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        for reader in self._readers:
            reader.join(10.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if error is not None and self._process.poll() is None:
            self.tell_where()
        self.close()
