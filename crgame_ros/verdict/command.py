# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame test`: games as tests of a planner."""

import argparse
from dataclasses import replace
from itertools import groupby
import json
import os
from pathlib import Path
import sys
import time
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError
from crgame_ros.paths import make_folder

if TYPE_CHECKING:
    from crgame_ros.verdict.cases import Case, CaseResult

DESCRIPTION = """\
Run games that say what they expect, and judge them: exit code 0 if every expectation is kept.

  crgame test scenarios                           all games of a folder that have `expect:`
  crgame test cut_in.yaml --planner my.py:Mine    with your planner for all AVs
  crgame test scenarios --seeds 20                expectations over 20 seeds, with an interval
  crgame test scenarios -k merge --rerun-failed   those named so that failed the last time
  crgame test scenarios --copies                  mirrored, turned, moved, renumbered as well

docs/testing.md tells of expectations and of CI."""
LAST = 'last.json'
# Lines of an expectation that several runs broke.
_TOLD = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the command."""
    add = parser.add_argument
    add('games', nargs='+', metavar='GAME|FOLDER', help='game files, folders of them, or names of '
        'games of this package')
    add('-k', dest='word', metavar='WORD', default='', help='only games with this in their name')
    add('--seeds', type=int, metavar='N', help="seeds 0 to N-1 (default: the game's own)")
    add('--planner', metavar='NAME', help='planner of all AVs')
    add('--option', action='append', default=[], metavar='KEY=VALUE',
        help='an option of this planner; may be repeated')
    add('--copies', action='store_true', help='also run copies of the games, mirrored, turned, '
        'moved and renumbered: they have to keep and break the same')
    add('--workers', type=int, metavar='N', help='processes (default: one for each processor)')
    add('--rerun-failed', action='store_true', help='only what failed the last time')
    add('--junit', type=Path, metavar='FILE.xml', help='write the verdicts as JUnit XML')
    add('--out', type=Path, metavar='DIR', default=Path('verdicts'),
        help='folder for the page, and for reports and recordings of failing runs (default: '
        'verdicts)')
    parser.set_defaults(command=run)


def run(values: argparse.Namespace) -> int:
    """
    Run and judge the games.

    :return: exit code: 0 if every expectation is kept, else 1.
    :raises InputError: if there is nothing to run, or a file cannot be written.
    """
    from crgame_ros.analysis.report.command import REPORT_FILE
    from crgame_ros.verdict.cases import replay_command, run_cases
    from crgame_ros.verdict.verdicts import broken_lines, junit_xml, verdicts_of, write_page
    from crgame_ros.whole_file import write_bytes, write_text
    cases = _cases(values)
    if not cases:
        print('nothing failed the last time')
        return 0
    make_folder(values.out, 'choose another place with --out')
    if values.copies:
        cases = _with_copies(cases, values.out / 'copies')
    began = time.perf_counter()
    workers = values.workers or len(os.sched_getaffinity(0))
    results = run_cases(cases, values.out, max(1, workers), _tell)
    verdicts = list(verdicts_of(results))
    for verdict in verdicts:
        if not verdict.is_kept:
            print(f'FAILED {verdict.game}: {verdict.told}: {verdict.share()}')
            for line in broken_lines(verdict)[:_TOLD]:
                print(f'       {line}')
    told = {result.case.name for verdict in verdicts for result, _ in verdict.broken}
    for result in results:
        # A copy that breaks what its original breaks tells nothing new.
        if result.folder is not None and result.case.name in told:
            print(f'       {result.case.name}: {result.folder / REPORT_FILE}')
            print(f'       {" " * len(result.case.name)}  {replay_command(result.folder)}')
    if values.junit is not None:
        write_bytes(junit_xml(verdicts), values.junit)
    page = write_page(verdicts, results, values.out)
    failed = {(str(result.case.game.resolve()), result.case.seed)
              for result in results if not result.is_good}
    write_text(json.dumps(sorted(failed)), values.out / LAST)
    bad = sum(not verdict.is_kept for verdict in verdicts)
    games = len({case.game for case in cases})
    print(f'{games} game{"s" * (games > 1)}, {len(cases)} run{"s" * (len(cases) > 1)}: '
          f'{len(verdicts) - bad} passed, {bad} failed in {time.perf_counter() - began:.1f} s; '
          f'{page}')
    return 1 if bad else 0


def _cases(values: argparse.Namespace) -> 'list[Case]':
    from crgame_ros.game.game import load_game
    from crgame_ros.launcher.arguments import read_options
    from crgame_ros.paths import find_game
    from crgame_ros.schema.marks import named_file
    from crgame_ros.verdict.cases import Case, find_games
    if values.seeds is not None and not 1 <= values.seeds <= 100_000:
        raise InputError(f'is {values.seeds}', '--seeds', 'give 1 to 100000')
    if values.option and not values.planner:
        raise InputError('is for a planner', '--option', 'name it with --planner')
    places = [Path(name) if Path(name).exists() else find_game(Path(name))
              for name in values.games]
    games = [game for game in find_games(places, values.out) if values.word in game.stem]
    first: dict[str, Path] = {}
    for game in games:
        # Reports and copies are named by it.
        if first.setdefault(game.stem, game) != game:
            raise InputError(f'has the name of {first[game.stem]}', str(game),
                             'rename one of them, or test them one by one')
    planner = named_file(values.planner, Path.cwd()) if values.planner else None
    options = dict(read_options(values.option))
    cases = [Case(game, seed, planner, options) for game in games
             for seed in ([load_game(game).seed] if values.seeds is None
                          else range(values.seeds))]
    if values.rerun_failed:
        failed = _last(values.out / LAST)
        cases = [case for case in cases if (str(case.game.resolve()), case.seed) in failed]
    elif not cases:
        raise InputError('is in the name of no game', '-k', 'give another word')
    return cases


def _with_copies(cases: 'list[Case]', folder: Path) -> 'list[Case]':
    """Return cases with those of copies after the ones of each game; write the copies' files."""
    from crgame_ros.verdict.copies import COPIES, write_copy
    found: list[Case] = []
    for game, group in groupby(cases, lambda case: case.game):
        own = list(group)
        found += own
        for place in COPIES:
            try:
                file = write_copy(game, place, folder / f'{game.stem}-{place.name}')
            except InputError as error:
                print(f'note: no {place.name} copy: {error}', file=sys.stderr)
                continue
            found += [replace(case, copy=(place.name, file)) for case in own]
    return found


def _last(path: Path) -> set[tuple[str, int]]:
    try:
        return {(str(game), int(seed)) for game, seed in json.loads(path.read_text())}
    except (OSError, ValueError, TypeError) as error:
        raise InputError('no earlier test is known', str(path),
                         'run without --rerun-failed first') from error


def _tell(result: 'CaseResult') -> None:
    """Print a line for a run that is not good, and a dot for one that is."""
    if result.is_good:
        print('.', end='', file=sys.stderr, flush=True)
    else:
        print(f'\n{result.case.name}: {"error" if result.error else "broken"}', file=sys.stderr,
              flush=True)
