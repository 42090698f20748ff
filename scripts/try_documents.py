#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Run the commands of README.md and docs/ as a reader would: in order, in a clean shell.

    python3 scripts/try_documents.py [--without PATTERN] [FILE.md …] [--then COMMAND …]

A command that runs until it is ended (a game, a page) gets Ctrl-C once it is up, and has to end
well. Every command must exit with 0, without a traceback or an error; those that need what this
machine lacks (ros2, rviz2, a wheel) are named as not run.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = Path(__file__).resolve().parents[1]
# Such a command is up when it prints one of these; it gets so long after that, and to end [s].
LASTING = re.compile(r'^(\w+=\S+ )*\./run\.sh(?!.*--help)')
UP = re.compile(r'recording into (\S+)|replay of .* http://')
# A recording of this size has a second of driving in it [bytes]; one that waits for a person gets
# to no such size, and is looked at for so long [s].
DRIVEN, WAITED_S = 300_000, 6.0
# The other terminal: such a command goes on while the next lasting one does.
COMPANION = re.compile(r'.*examples/external_planner\.py')
LOOK_S, PATIENCE_S = 1.0, 120.0
# The first command makes .venv and compiles, which takes minutes [s].
MADE_S = 1200.0
# Only these of our own environment reach the shell: where packages come from, and how.
KEPT = re.compile(r'^(HOME|PATH|TMPDIR|LANG|(PIP_|SSL_|REQUESTS_|UV_).*|\w+_(proxy|PROXY))$')
NOBODY_DROVE = 'nothing was recorded: the run ended before its first step'
SAID_OF_FAULTS = re.compile(r'Traceback|^error: ', re.M)
NOT_RUN: dict[str, Callable[[], str | bool]] = {
    r'\bros2\b|\brviz2\b': lambda: shutil.which('ros2') is None and 'no ros2 here',
    r'^\./test\.sh': lambda: 'runs every test',
    r'CRGAME_OPEN_NETWORK=1|0\.0\.0\.0|--open-cockpit|^python3 external':
        lambda: 'opens the network',
    r'evdev:G29|--driver auto': lambda: not any(Path('/dev/input').glob('event*'))
    and 'no device here',
}

ENDINGS = (signal.SIGTERM, signal.SIGHUP)


@dataclass
class Shell:
    """
    The reader's terminal: remembers what was set and sourced in a block.

    :param places: what stands for names that a reader would put in.
    """

    folder: Path
    places: dict[str, str]
    preamble: list[str] = field(default_factory=list)
    companions: list[tuple[str, subprocess.Popen[bytes]]] = field(default_factory=list)
    running: list[subprocess.Popen[bytes]] = field(default_factory=list)
    failures: int = 0

    def run(self, command: str) -> None:
        """Run a command, print its result, and count failures."""
        for pattern, why in NOT_RUN.items():
            if re.search(pattern, command) and (reason := why()):
                print(f'  not run  {command}    ({reason})', flush=True)
                return
        if re.match(r'export |source ', command):
            self.preamble.append(command)
        text = command
        for name, place in self.places.items():
            text = text.replace(name, place)
        script = '\n'.join(['set -e', *self.preamble, text])
        if COMPANION.match(command):
            self.companions.append((command, self._started(script, len(self.companions) + 1)))
            return
        began_s = time.monotonic()
        lasting = LASTING.match(command) is not None
        process = self._started(script, 0)
        if lasting:
            self._interrupt_when_up(process)
        self._judge(command, process, 0, began_s)
        while lasting and self.companions:
            number = len(self.companions)
            name, companion = self.companions.pop()
            os.killpg(companion.pid, signal.SIGINT)
            self._judge(name, companion, number, began_s)
        self._remember_run()

    def _log(self, number: int) -> Path:
        return self.folder / f'output{number}.txt'

    def _started(self, script: str, number: int) -> subprocess.Popen[bytes]:
        environment = {key: value for key, value in os.environ.items() if KEPT.match(key)}
        with self._log(number).open('wb') as output, _whole():
            process = subprocess.Popen(
                ['bash', '--noprofile', '--norc', '-c', script], cwd=ROOT, env=environment,
                stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                start_new_session=True)
            self.running.append(process)
        return process

    def _interrupt_when_up(self, process: subprocess.Popen[bytes]) -> None:
        until_s = time.monotonic() + MADE_S
        while process.poll() is None and time.monotonic() < until_s:
            up = UP.search(self._log(0).read_text(errors='replace'))
            if up is not None:
                until_s = min(until_s, time.monotonic() + WAITED_S)
                if up[1] is None or sum(
                        path.stat().st_size for path in Path(up[1]).glob('*.mcap')) > DRIVEN:
                    break
            time.sleep(0.1)
        if process.poll() is None:
            time.sleep(LOOK_S)
            # As from a terminal: to all processes in the foreground.
            os.killpg(process.pid, signal.SIGINT)

    def _judge(self, command: str, process: subprocess.Popen[bytes], number: int,
               began_s: float) -> None:
        try:
            code = process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            code = process.wait()
        self.running.remove(process)
        output = self._log(number).read_text(errors='replace')
        # There is no person to press Drive.
        awaited = code == 1 and '--driver cockpit' in command and NOBODY_DROVE in output
        wrong = (code != 0 and not awaited) or SAID_OF_FAULTS.search(output) is not None
        print(f'  {"FAILED " if wrong else "ok     "}  {command}    '
              f'({time.monotonic() - began_s:.1f} s)', flush=True)
        if wrong:
            self.failures += 1
            print(f'    exit code {code}:\n' + '\n'.join(
                f'    {line}' for line in output.splitlines()[-30:]), flush=True)

    def close(self) -> None:
        """End what still runs because the trial itself was ended: a run ends its nodes."""
        for process in self.running:
            os.killpg(process.pid, signal.SIGINT)
        for process in self.running:
            try:
                process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)

    def _remember_run(self) -> None:
        """Make `runs/NAME` stand for the last run that has a scenario."""
        done = [path.parent for path in (ROOT / 'runs').glob('*/*.xml')]
        if done:
            newest = max(done, key=lambda path: path.stat().st_mtime)
            self.places['runs/NAME'] = self.places['runs/<run>'] = f'runs/{newest.name}'
            self.places['my_bag'] = f'runs/{newest.name}/bag'
            self.places['other_planners.yaml'] = f'runs/{newest.name}/game.yaml'


@contextmanager
def _whole() -> Iterator[None]:
    """Do all of a block before a signal ends the trial: no process is forgotten as it starts."""
    came: list[int] = []
    before = {ending: signal.getsignal(ending) for ending in ENDINGS}
    for ending in ENDINGS:
        if before[ending] != signal.SIG_IGN:
            signal.signal(ending, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for ending in ENDINGS:
            signal.signal(ending, before[ending])
    if came:
        sys.exit(128 + came[0])


def blocks(text: str, language: str) -> Iterator[str]:
    """Yield the blocks of a document in a language."""
    for match in re.finditer(r'^```(\w*)\n(.*?)^```$', text, re.S | re.M):
        if match.group(1) == language:
            yield match.group(2)


def commands(block: str) -> Iterator[str]:
    """Yield the commands of a block, without comments."""
    for line in block.splitlines():
        if command := re.sub(r'(^|\s+)#.*', '', line).strip():
            yield command


def _places(folder: Path) -> dict[str, str]:
    """Write the files that a reader would have, from their texts in the documents."""
    planner = next(blocks((ROOT / 'docs/planners.md').read_text(), 'python'))
    (folder / 'my_planner.py').write_text(planner)
    name = re.search(r'^class (\w+)', planner, re.M)
    assert name is not None
    (folder / 'roads.csv').write_text(next(
        block for block in blocks((ROOT / 'docs/roads.md').read_text(), '')
        if block.startswith('lane,x,y')))
    (folder / 'district.xodr').write_text(next(
        blocks((ROOT / 'docs/import.md').read_text(), 'xml')))
    own = ('district.xodr', 'roads.csv', 'town.xml', 'town_av.xml', 'circle.csv', 'maps/street',
           'somewhere/')
    return {'my_planner.py:MyPlanner': f'{folder}/my_planner.py:{name.group(1)}',
            'FILE.xml': 'scenarios/ZAM_CutIn-1_1_T-1.xml',
            **{path: f'{folder}/{path}' for path in own}}


def main(arguments: Sequence[str]) -> int:
    """Try the documents; return 1 if a command failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('documents', nargs='*', type=Path, metavar='FILE.md', default=[
        ROOT / 'README.md', *sorted((ROOT / 'docs').glob('*.md'))],
        help='default: README.md and docs/')
    parser.add_argument('--without', metavar='PATTERN', help='leave out commands that match')
    parser.add_argument('--then', nargs=argparse.REMAINDER, metavar='COMMAND', default=[],
                        help='become this command if every command works')
    values = parser.parse_args(arguments)
    if values.without:
        NOT_RUN[values.without] = lambda: 'left out'
    for ending in ENDINGS:
        if signal.getsignal(ending) != signal.SIG_IGN:  # as under nohup
            signal.signal(ending, lambda number, _: sys.exit(128 + number))
    with tempfile.TemporaryDirectory() as name, \
            closing(Shell(Path(name), _places(Path(name)))) as shell:
        for document in values.documents:
            for block in blocks(document.read_text(), 'bash'):
                print(document.name, flush=True)
                shell.preamble = []
                for command in commands(block):
                    shell.run(command)
    print(f'{shell.failures} commands failed' if shell.failures else 'every command works')
    if values.then and not shell.failures:
        sys.stdout.flush()
        os.execvp(values.then[0], values.then)
    return 1 if shell.failures else 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
