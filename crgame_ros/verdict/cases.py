# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cases of a test: a run of a game with a seed each, on all cores."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from importlib import import_module
import multiprocessing
import os
from pathlib import Path
import shlex
import signal
import threading

from crgame_ros.errors import InputError
from crgame_ros.game.expectation import Expectation

# The module that runs a case, which the process that only hands cases out does not need.
RUNNER = 'crgame_ros.verdict.case_run'


def replay_command(folder: Path) -> str:
    """Return the command that shows the recording in the folder of a run in the page."""
    return f'crgame run --replay {shlex.quote(str(folder))}'


@dataclass(frozen=True)
class Case:
    """
    A game to run with a seed.

    :param game: its file.
    :param seed: of everything random.
    :param planner: of all AVs; None for those of the game.
    :param copy: name of a copy of the game that is run instead, with its file; None for none.
    :param options: of this planner.
    """

    game: Path
    seed: int
    planner: str | None = None
    options: Mapping[str, object] = field(default_factory=dict)
    copy: tuple[str, Path] | None = None

    @property
    def name(self) -> str:
        """Return its name for people."""
        return f'{self.game.stem}[{self.seed}]' + (f' {self.copy[0]}' if self.copy else '')

    @property
    def file(self) -> Path:
        """Return the file that is run."""
        return self.game if self.copy is None else self.copy[1]


@dataclass(frozen=True)
class CaseResult:
    """
    What became of a case.

    :param expectations: of the game.
    :param broken: for each of them, how the run broke it, a line for each vehicle.
    :param error: why it could not be run; empty if it could.
    :param wall_s: time that it took.
    :param folder: with report, recording and scenario of a run that broke something; None
        without.
    """

    case: Case
    expectations: tuple[Expectation, ...]
    broken: tuple[tuple[str, ...], ...]
    error: str
    wall_s: float
    folder: Path | None = None

    @property
    def is_good(self) -> bool:
        """Return whether it ran and kept every expectation, whatever its share."""
        return not self.error and not any(self.broken)


def find_games(places: Sequence[Path], out: Path) -> list[Path]:
    """
    Return the game files of files and folders; of a folder those with expectations.

    :param out: folder of results within them, which is left out, as hidden folders are.
    :raises InputError: if there is none.
    """
    found = []
    for place in places:
        if place.is_dir():
            results = out.resolve() if place.resolve() in out.resolve().parents else None
            found += [file for file in sorted(place.rglob('*.yaml'))
                      if file.stem.count('.') == 0 and results not in file.resolve().parents
                      and not any(part.startswith('.') for part in file.relative_to(place).parts)
                      and _has_expectations(file)]
        elif place.is_file():
            found.append(place)
        else:
            raise InputError('does not exist', str(place), 'name a game file or a folder of them')
    if not found:
        raise InputError('no game there has expectations', ', '.join(map(str, places))[:200],
                         'add `expect:` to a game file: docs/testing.md')
    return list(dict.fromkeys(found))


def _has_expectations(file: Path) -> bool:
    try:
        return any(line.startswith('expect:') for line in file.read_text().splitlines())
    except (OSError, UnicodeDecodeError):
        return False


def run_cases(cases: Sequence[Case], out: Path, workers: int,
              told: Callable[[CaseResult], object]) -> list[CaseResult]:
    """
    Run cases on several processes.

    :param told: called with each result as it comes.
    :return: in the order of the cases.
    """
    found: dict[int, CaseResult] = {}
    while len(found) < len(cases):
        left = {number: case for number, case in enumerate(cases) if number not in found}
        suspects = []
        for number, result in _results(left, out, workers):
            if result is None:
                suspects.append(number)
            else:
                found[number] = result
                told(result)
        # Of cases that ran at the same time, one ended its process, and the pool: which one?
        for number in suspects:
            for _, result in _results({number: cases[number]}, out, 1):
                found[number] = result or CaseResult(
                    cases[number], (), (), 'the process that ran it has died', 0.0)
                told(found[number])
    return [found[number] for number in range(len(cases))]


def _results(cases: Mapping[int, Case], out: Path,
             workers: int) -> Iterator[tuple[int, CaseResult | None]]:
    """
    Yield the numbers and results of cases as they come, up to the end of the pool of processes.

    A result is None if a process had died; of the cases that had not begun then there is none.
    """
    # Forks of one process that imports what all of them need, which takes seconds.
    context = multiprocessing.get_context('forkserver')
    context.set_forkserver_preload([RUNNER])
    pool = ProcessPoolExecutor(min(workers, len(cases)), context, _begin, (os.getcwd(),))
    running: dict[Future[CaseResult], int] = {}
    waiting = deque(cases)
    try:
        while waiting or running:
            # No more than can run, as those that are handed out are not taken back.
            while waiting and len(running) < workers:
                try:
                    future = pool.submit(_run, cases[waiting[0]], out)
                except BrokenProcessPool:
                    waiting.clear()
                else:
                    running[future] = waiting.popleft()
            for done in wait(running, return_when=FIRST_COMPLETED).done:
                number = running.pop(done)
                try:
                    yield number, done.result()
                except BrokenProcessPool:
                    waiting.clear()
                    yield number, None
                except Exception as error:  # a planner's fault
                    yield number, CaseResult(cases[number], (), (),
                                             f'{type(error).__name__}: {error}', 0.0)
    finally:
        pool.shutdown(cancel_futures=True)


def _begin(folder: str) -> None:
    """Prepare a process: a fork begins where the first one did, and Ctrl-C is ignored in it."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.chdir(folder)


def _end_with_parent() -> None:
    """End this process when the one that hands cases out has died, however it did."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run(case: Case, out: Path) -> CaseResult:
    result: CaseResult = import_module(RUNNER).run_case(case, out)
    return result
