# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame search`: the variants of a game in which a planner does worst."""

import argparse
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import get_args, TYPE_CHECKING

from crgame_ros.errors import InputError
from crgame_ros.evaluation.file_names import SEARCH_FILE
from crgame_ros.paths import extra_install, find_game, make_folder
from crgame_ros.search.settings import Goal, Sampler, SearchSettings

if TYPE_CHECKING:
    from crgame_ros.evaluation.evaluation import Computing

DESCRIPTION = """\
Find the variants of a game in which its AVs do worst. The game file tells with `vary:` what may
change, and with `expect:` what is a failure (without it, a contact).

  crgame search cut_in_family --minimise min_distance --budget 200
  crgame search game.yaml --minimise ttc --planner my.py:Mine --budget 2000
  crgame search game.yaml --minimise ttc --maximise progress          several: NSGA-II
  crgame search runs/NAME --planner my.py:Mine      recorded humans, earlier, later, faster
  crgame search searches/game                       go on with a search

Of the runs, half explore, a fifth refine the boundary between pass and fail, a twentieth look for
the smallest change of the game that fails, and a quarter estimate how probable a failure is. The
same command goes on where it was stopped. The worst runs are in `found/`, each with a game in
which you can drive yourself: ./run.sh searches/game/found/1/live.yaml

docs/search.md tells more."""
_DEFAULT_GOAL = 'ttc'
SEARCHES = Path('searches')
# Options that are settings of the same names.
_SETTINGS = ('budget', 'batch', 'seed', 'sampler', 'explore_only', 'unavoidable')
# What a search is, which a folder of one states already.
_DEFAULTS: dict[str, object] = {
    'minimise': [], 'maximise': [], 'planner': None, 'option': [], 'out': None,
    **{name: getattr(SearchSettings, name) for name in _SETTINGS}}
INSTALL = extra_install('search')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the command."""
    add = parser.add_argument
    add('game', metavar='GAME|RUN|FOLDER', help='a game file with `vary:`, the name of a game of '
        'this package, a recorded run, or the folder of a search')
    # Without defaults, so that what is given beside the folder of a search can be refused.
    setting = partial(add, default=argparse.SUPPRESS)
    setting('--minimise', action='append', metavar='MEASURE', help='a measure that is bad when '
            f'small (default: {_DEFAULT_GOAL}); may be repeated')
    setting('--maximise', action='append', metavar='MEASURE',
            help='a measure that is bad when large; may be repeated')
    setting('--planner', metavar='NAME', help="planner of all AVs (default: the game's own)")
    setting('--option', action='append', metavar='KEY=VALUE',
            help='an option of this planner; may be repeated')
    setting('--budget', type=int, metavar='N', help=f'runs (default: {_DEFAULTS["budget"]})')
    setting('--seed', type=int, metavar='N',
            help=f'of the search (default: {_DEFAULTS["seed"]})')
    setting('--sampler', choices=get_args(Sampler), help='of Optuna, that explores '
            f'(default: {_DEFAULTS["sampler"]}; nsga2 for several measures)')
    setting('--batch', type=int, metavar='N', help='variants that are chosen together, as many '
            f'as there are workers or more (default: {_DEFAULTS["batch"]})')
    setting('--explore-only', action='store_true', help='only explore, with all runs')
    setting('--unavoidable', action='store_true',
            help='count contacts that no AV could avoid as failures, too')
    add('--keep', type=int, default=5, metavar='N',
        help='worst runs to write into found/ (default: %(default)d)')
    setting('--out', type=Path, metavar='DIR',
            help='folder (default: searches/<name of the game>)')
    add('--workers', type=int, metavar='N', help='processes (default: one for each processor)')
    add('--scheduler', metavar='ADDRESS', help='a Dask scheduler whose workers compute instead')
    parser.set_defaults(command=run)


def run(values: argparse.Namespace) -> int:
    """
    Search, and write what was found.

    :return: exit code 0, whether failures were found or not.
    :raises InputError: if anything cannot be used.
    """
    _require()
    from crgame_ros.search.findings import LIVE, write_findings, write_search_page
    from crgame_ros.search.progress import SearchProgress
    from crgame_ros.search.search import begin, run_search
    from crgame_ros.search.text import lines, results_text
    from crgame_ros.whole_file import write_text
    given = Path(values.game)
    _check_within('keep', values.keep, 0, 1000)
    if (given / SEARCH_FILE).exists():
        folder = given
        for name in _DEFAULTS.keys() & vars(values).keys():
            raise InputError('is of a new search, not of one that goes on',
                             f'--{name.replace("_", "-")}', f'leave it out beside {given}')
    else:
        values = argparse.Namespace(**_DEFAULTS | vars(values))
        settings = _settings(values, _game(given, values))
        folder = values.out or SEARCHES / Path(settings.game).stem
        begin(settings, folder)
    settings = SearchSettings.read(folder)
    progress = SearchProgress(settings.budget)
    try:
        result = run_search(folder, _computing(values), progress.began, progress.ended)
    finally:
        progress.close()
    # Once: the boundary's model is asked for them.
    words = list(lines(result))
    write_text(results_text(result, words), folder / 'results.json')
    found = write_findings(result, folder, values.keep)
    page = write_search_page(result, words, found, folder)
    for line in words:
        print(line)
    if found:
        print(f'drive one yourself: ./run.sh {found[-1][1] / LIVE}')
    print(page)
    return 0


def _game(given: Path, values: argparse.Namespace) -> Path:
    """Return the file of the game that the command line gives."""
    from crgame_ros.search.recorded_human import game_of_run, is_recording
    if not given.is_dir():
        return given if given.exists() else find_game(given)
    if not is_recording(given):
        raise InputError('is neither a search nor a recorded run', str(given), 'name a game file')
    folder = SEARCHES if values.out is None else values.out.parent
    make_folder(folder, 'choose another place with --out')
    return game_of_run(given, folder, values.planner is not None)


def _require() -> None:
    from crgame_ros.evaluation.dask_cluster import require_dask
    require_dask()
    # To import them takes a second, which is too long to refuse a wrong name.
    if None in (find_spec('cmaes'), find_spec('optuna'), find_spec('sklearn')):
        raise InputError('needs Optuna, cmaes and scikit-learn', 'crgame search', INSTALL)


def _settings(values: argparse.Namespace, game: Path) -> SearchSettings:
    from crgame_ros.launcher.arguments import read_options
    from crgame_ros.schema.marks import named_file
    _check_within('budget', values.budget, 1, 10_000_000)
    _check_within('batch', values.batch, 1, 10_000)
    _check_within('seed', values.seed, 0, 2**32 - 1)
    if values.option and not values.planner:
        raise InputError('is for a planner', '--option', 'name it with --planner')
    goals = (*(Goal(name, 1) for name in values.minimise),
             *(Goal(name, -1) for name in values.maximise)) or (Goal(_DEFAULT_GOAL, 1),)
    if len(goals) > 1 and values.sampler in ('tpe', 'cmaes'):
        values.sampler = 'nsga2'
    return SearchSettings(
        str(game.resolve()), goals,
        named_file(values.planner, Path.cwd()) if values.planner else '',
        dict(read_options(values.option)),
        **{name: getattr(values, name) for name in _SETTINGS})


def _check_within(name: str, value: int, least: int, most: int) -> None:
    if not least <= value <= most:
        raise InputError(f'is {value}', f'--{name}', f'give {least} to {most}')


def _computing(values: argparse.Namespace) -> 'Computing':
    from crgame_ros.evaluation.dask_cluster import default_workers
    from crgame_ros.evaluation.evaluation import Computing
    workers = default_workers() if values.workers is None else values.workers
    if not 1 <= workers <= 10_000:
        raise InputError(f'is {workers}', '--workers', 'give 1 or more')
    return Computing(values.scheduler, workers)
