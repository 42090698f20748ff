# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cases of a test: a run of a game with a seed each, on all cores."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field, replace
import multiprocessing
from pathlib import Path
import shlex
import time

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.expectation import Expectation
from crgame_ros.game.game import Game, load_game


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

    :param case: the case.
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


def run_case(case: Case, out: Path) -> CaseResult:
    """
    Run a case, and judge it.

    :param out: folder for the reports and recordings of runs that break an expectation.
    """
    # Imported here: the process that only hands cases out does not need them.
    from crgame_ros.analysis.report.run_files import write_run_files
    from crgame_ros.analysis.runs.run import Run
    from crgame_ros.evaluation.judging import check_expectations, shortfalls
    from crgame_ros.evaluation.results.cell_rows import vehicle_rows
    from crgame_ros.simulation.contacts import contacts_of
    from crgame_ros.simulation.offline import run_offline
    from crgame_ros.simulation.setup import build_setup
    began = time.perf_counter()
    expectations: tuple[Expectation, ...] = ()
    try:
        game = load_game(case.file)
        expectations = game.expect
        check_expectations(game, str(case.file))
        game = _adapted(game, case)
        result = run_offline(build_setup(game), keep_messages=True)
        run = Run(case.name, result=result, scoring='drives')
        rows = vehicle_rows(run, result, contacts_of(result))
        broken = tuple(tuple(shortfalls(each, rows)) for each in expectations)
        folder = None
        if any(broken):
            folder = out / '-'.join((
                case.game.stem, str(case.seed), *(case.copy[:1] if case.copy else ())))
            folder.mkdir(parents=True, exist_ok=True)
            write_run_files(run, result, game, folder)
    except CrgameError as error:
        return CaseResult(case, expectations, (), str(error), time.perf_counter() - began)
    return CaseResult(case, expectations, broken, '', time.perf_counter() - began, folder)


def _adapted(game: Game, case: Case) -> Game:
    """Return the game with the seed and the planner of a case."""
    if case.planner is not None:
        from crgame_ros.scenario.loading import load_scenario
        from crgame_ros.simulation.av_assignment import adapt_game
        game = adapt_game(game, load_scenario(game.scenario), seed=case.seed,
                          planner=case.planner, options=dict(case.options))
    return replace(game, seed=case.seed)


def run_cases(cases: Sequence[Case], out: Path, workers: int,
              told: Callable[[CaseResult], object]) -> list[CaseResult]:
    """
    Run cases on several processes.

    :param told: called with each result as it comes.
    :return: in the order of the cases.
    """
    found: dict[int, CaseResult] = {}
    broken: dict[int, CaseResult] = {}
    for number, result, died in _results(dict(enumerate(cases)), out, workers):
        if died:
            broken[number] = result
        else:
            found[number] = result
            told(result)
    # A process that dies takes those of all other cases along.
    for number in sorted(broken):
        for _, result, _ in _results({number: cases[number]}, out, 1):
            found[number] = result
            told(result)
    return [found[number] for number in range(len(cases))]


def _results(cases: Mapping[int, Case], out: Path,
             workers: int) -> Iterator[tuple[int, CaseResult, bool]]:
    """Yield the numbers and results of cases as they come, and whether a process had died."""
    context = multiprocessing.get_context('spawn')
    with ProcessPoolExecutor(min(workers, len(cases)), mp_context=context) as pool:
        waiting = {pool.submit(run_case, case, out): number for number, case in cases.items()}
        try:
            for done in as_completed(waiting):
                number = waiting[done]
                try:
                    yield number, done.result(), False
                except Exception as error:  # a process that died, or a planner's fault
                    yield (number, CaseResult(cases[number], (), (),
                                              f'{type(error).__name__}: {error}', 0.0),
                           isinstance(error, BrokenProcessPool))
        except (KeyboardInterrupt, GeneratorExit):
            pool.shutdown(wait=False, cancel_futures=True)
            raise
