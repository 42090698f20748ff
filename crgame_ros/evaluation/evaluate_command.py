# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame evaluate`: planner x scenario x human x seed, on this machine's cores or a cluster."""

import argparse
from collections.abc import Callable
from datetime import datetime
import json
from pathlib import Path
import sys
from typing import Any, get_args, TYPE_CHECKING

from crgame_ros.errors import InputError
from crgame_ros.evaluation.file_names import GRID_FILE, REPORTS, SEARCH_FILE
from crgame_ros.game.variation_spec import Sampling
from crgame_ros.library.lookup import names_file
from crgame_ros.paths import expanded, find_game, make_folder
from crgame_ros.schema.marks import named_file

if TYPE_CHECKING:
    from crgame_ros.evaluation.evaluation import Computing
    from crgame_ros.evaluation.plan import EvaluationPlan

SUMMARY_FILE = 'summary.html'
FORMATS = ('text', 'markdown', 'json')


def report_cell(folder: Path, key: str, say: Callable[[str], object]) -> Path:
    """
    Run a cell again, and write its report, its recording and its scenario.

    :param key: key of the cell, or its first digits.
    :param say: called with a line of progress, for people.
    :return: the report's file.
    :raises InputError: if there is no such cell, or it cannot be run.
    """
    from crgame_ros.analysis.report.file import write_report
    from crgame_ros.analysis.runs.run import Run
    from crgame_ros.evaluation.cell_run import run_cell
    from crgame_ros.evaluation.folder import EvaluationFolder
    from crgame_ros.evaluation.source_digest import engine_digest
    from crgame_ros.recording.export import prepare_folder, write_scenario
    from crgame_ros.recording.offline_recording import write_recording
    place = EvaluationFolder(folder)
    cell = place.find(key)
    if cell.condition.code[0] != engine_digest():
        say('note: another version of crgame_ros planned this cell; its run may differ')
    say(f'running {cell.label}')
    result = run_cell(cell, place.store.folder, keep_messages=True)
    run = Run(cell.label, result=result)
    path = folder / REPORTS / f'{cell.key}.html'
    prepare_folder(path.parent)
    write_report([run], path)
    write_scenario(run.log, path.with_suffix('.xml'))
    recording = path.with_suffix('')
    make_folder(recording, 'choose another folder')
    write_recording(result, recording, replace=True)
    say(f'see it again: crgame run --replay {recording}')
    return path


DESCRIPTION = """\
Run every planner in every scenario, game and recorded drive, with every seed; measure each run,
and keep a row of it. The same command goes on where it was stopped, and computes nothing twice.

  crgame evaluate plan.yaml --out evaluations/first
  crgame evaluate --scenarios ../scenarios --planners idm,reactive --seeds 5 --duration 10
  crgame evaluate --humans runs/NAME --planners idm,my_planner.py:Mine
  crgame evaluate evaluations/first                    go on with it
  crgame evaluate evaluations/first --summary          means, differences, the worst cells
  crgame evaluate evaluations/first --cell KEY         run one again, and write its report

docs/evaluation.md tells of plans, tables and clusters."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add('plan', nargs='?', type=Path, help='plan file (*.yaml), or the folder of an evaluation')
    add('--out', type=Path, metavar='DIR',
        help='folder of the evaluation (default: evaluations/<name of the plan>)')
    add('--games', nargs='+', default=[], metavar='FILE', help='game files, folders of '
        'them, or names of games of this package: cut_in,merge')
    add('--scenarios', nargs='+', default=[], metavar='FILE',
        help="CommonRoad files, folders of them, benchmark ids, or patterns of ids: 'USA_*'")
    add('--humans', nargs='+', default=[], metavar='RUN',
        help='recorded runs, whose humans drive again')
    add('--planners', metavar='A,B', help='planners of all AVs')
    add('--seeds', metavar='N', help='how many seeds, or which: 5, or 3,7')
    add('--perception', nargs='+', default=[], metavar='FILE',
        help='files with "perception" of all AVs; "own" is that of the games')
    add('--traffic', nargs='+', default=[], metavar='FILE',
        help='files with "traffic"; "own" is that of the games')
    add('--variants', type=int, metavar='N', help='run N variants of each game with `vary`')
    add('--sampling', choices=get_args(Sampling), help='how they are chosen (default: sobol)')
    add('--duration', type=float, metavar='S', help='simulated seconds of each cell')
    add('--latency', type=int, metavar='L', help='simulation steps between a request and its plan')
    add('--commonroad-scores', action='store_true',
        help="goals, validity, feasibility and costs by CommonRoad's tools, too: takes longer")
    where = parser.add_argument_group('where it is computed')
    where.add_argument('--workers', type=int, metavar='N',
                       help='processes here (default: one for each processor)')
    where.add_argument('--scheduler', metavar='ADDRESS',
                       help='a Dask scheduler whose workers compute instead')
    where.add_argument('--dashboard', type=int, nargs='?', const=8787, metavar='PORT',
                       help="show Dask's page on this machine (default port: 8787)")
    where.add_argument('--cell-timeout', type=float, default=300.0, metavar='S',
                       help='give a cell up after so long (default: %(default)g)')
    where.add_argument('--cell-memory', type=float, default=2.0, metavar='GB',
                       help='that a cell may take (default: %(default)g)')
    where.add_argument('--part-cells', type=int, default=256, metavar='N',
                       help='cells of a part of the tables (default: %(default)d)')
    where.add_argument('--retry', action='store_true', help='compute failed cells again')
    after = parser.add_argument_group('of an evaluation, instead')
    after.add_argument('--cell', metavar='KEY', help='run one cell again, and write its report')
    after.add_argument('--summary', action='store_true', help='sum it up')
    add_summary_arguments(after)
    parser.set_defaults(command=run_command)


def run_command(values: argparse.Namespace) -> int:
    """Run an evaluation, or show one."""
    from crgame_ros.evaluation.dask_cluster import require_dask
    from crgame_ros.evaluation.evaluation import evaluate
    from crgame_ros.evaluation.progress import EvaluationProgress
    from crgame_ros.recording.progress import on_stderr, Progress
    if values.cell or values.summary:
        return _inspect(values)
    require_dask()
    plan, folder = _plan(values)
    try:
        tally = evaluate(plan, folder, _computing(values), EvaluationProgress(),
                         Progress(on_stderr, 'loading what the plan names'))
    except KeyboardInterrupt:
        on_stderr('\nstopped: what was finished is kept; the same command goes on')
        raise
    if tally.put_away:
        on_stderr(f'note: {tally.put_away} cells that were there are not of this plan, or of '
                  f'other code: they are in {folder / "earlier"}')
    if tally.before == tally.total:
        on_stderr(f'all {tally.total} cells were finished before')
    print(folder)
    return 0


def _inspect(values: argparse.Namespace) -> int:
    from crgame_ros.evaluation.folder import EvaluationFolder
    if values.plan is None or not values.plan.is_dir():
        raise InputError('needs the folder of an evaluation',
                         '--cell' if values.cell else '--summary',
                         'give it first: crgame evaluate evaluations/NAME --summary')
    if values.cell:
        from crgame_ros.recording.progress import on_stderr
        print(report_cell(values.plan, values.cell, on_stderr))
        return 0
    code = summarise_command(values.plan, values)
    grid = EvaluationFolder(values.plan).grid() if (values.plan / GRID_FILE).exists() else None
    if grid is not None and any(scene.variants for scene in grid.scenes):
        from crgame_ros.evaluation.variants_page import write_variant_pages
        for page in write_variant_pages(values.plan, grid, values.measure or ()):
            print(page, file=sys.stderr)
    return code


def _plan(values: argparse.Namespace) -> 'tuple[EvaluationPlan, Path]':
    """Return the plan given by the command line, and the folder of its evaluation."""
    from crgame_ros.evaluation.folder import EvaluationFolder
    from crgame_ros.evaluation.plan import parse_plan
    from crgame_ros.yaml_text import read_yaml
    given = _given(values)
    if values.plan is None:
        if not given:
            raise InputError('nothing to evaluate', 'crgame evaluate',
                             'name a plan file, or --games, --scenarios or --humans')
        out = values.out or Path('evaluations') / f'{datetime.now():%Y%m%d-%H%M%S}'
        return parse_plan(given, 'command line', Path.cwd()), out
    if values.plan.is_dir():
        if given:
            raise InputError('an evaluation goes on as it was planned', f'--{next(iter(given))}',
                             'change its plan file instead, or name another --out')
        if (values.plan / SEARCH_FILE).exists():
            raise InputError('is of a search', str(values.plan),
                             f'go on with it: crgame search {values.plan}')
        return EvaluationFolder(values.plan).plan(str(values.plan)), values.plan
    base = values.plan.parent
    read = read_yaml(values.plan, 'plan')
    if isinstance(read, dict):
        here = {key: [_from_here(key, name) for name in names]
                for key in ('games', 'scenarios', 'humans')
                if isinstance(names := given.get(key), list)}
        read = read | given | here
    return parse_plan(read, str(values.plan), base), \
        values.out or Path('evaluations') / values.plan.stem


def _from_here(key: str, name: str) -> str:
    """Return a name of the command line that is valid beside the plan's file."""
    if key == 'scenarios' and not names_file(name):
        return name
    return str(expanded(name).resolve())


def _given(values: argparse.Namespace) -> dict[str, object]:
    """Return the values of a plan that the command line gives."""
    given: dict[str, Any] = {
        name: getattr(values, name) for name in ('games', 'scenarios', 'humans')
        if getattr(values, name)}
    if values.games:
        given['games'] = [str(find_game(Path(name))) for word in values.games
                          for name in ([word] if Path(word).exists() else word.split(','))]
    if values.planners:
        given['planners'] = [named_file(name, Path.cwd())
                             for name in values.planners.split(',') if name]
    if values.seeds is not None:
        given['seeds'] = _seeds(values.seeds)
    for name in ('perception', 'traffic'):
        files = getattr(values, name)
        if files:
            given[name] = {Path(file).stem: file if file == 'own' else
                           str(expanded(file).resolve()) for file in files}
            if len(given[name]) < len(files):
                raise InputError('two files have one name', f'--{name}', 'rename one of them')
    variants = {name: value for name, value in (
        ('number', values.variants), ('sampling', values.sampling)) if value is not None}
    if variants:
        given['variants'] = variants
    for name in ('duration', 'latency'):
        if getattr(values, name) is not None:
            given[name] = getattr(values, name)
    if values.commonroad_scores:
        given['commonroad_scores'] = True
    return given


def _seeds(text: str) -> int | list[int]:
    try:
        numbers = [int(word) for word in text.split(',')]
    except ValueError:
        raise InputError(f'is "{text[:60]}"', '--seeds', 'give 5, or 3,7') from None
    return numbers if len(numbers) > 1 or ',' in text else numbers[0]


def _computing(values: argparse.Namespace) -> 'Computing':
    from crgame_ros.evaluation.dask_cluster import default_workers
    from crgame_ros.evaluation.evaluation import Computing, GIGABYTE
    workers = default_workers() if values.workers is None else values.workers
    for name, value, least in (('workers', workers, 1),
                               ('cell-timeout', values.cell_timeout, 1e-3),
                               ('cell-memory', values.cell_memory, 0.5),
                               ('part-cells', values.part_cells, 1)):
        if not least <= value < 1e6:
            raise InputError(f'is {value:g}', f'--{name}', f'give {least:g} or more')
    return Computing(values.scheduler, workers, values.dashboard, values.cell_timeout,
                     round(values.cell_memory * GIGABYTE), values.part_cells, values.retry)


def add_summary_arguments(parser: 'argparse.ArgumentParser | argparse._ArgumentGroup') -> None:
    """Declare the arguments of a summary."""
    parser.add_argument('--format', choices=FORMATS, default='text',
                        help='output format (default: text)')
    parser.add_argument('--measure', action='append', metavar='NAME', help='measure to summarise; '
                        'may be given several times (default: all that docs/evaluation.md names)')
    parser.add_argument('--by', action='append', metavar='FACTOR', help='factor that defines '
                        'the groups: planner, scenario, game, human, participant, perception or '
                        'traffic; may be given several times (default: planner)')
    parser.add_argument('--baseline', metavar='PLANNER', help='planner with which the others '
                        'are compared (default: idm, or the first planner)')
    parser.add_argument('--worst', action='append', metavar='NAME', help='measure by which the '
                        'worst cells are chosen; may be given several times, the first one counts '
                        'first (default: collision, then worst_ttc)')


def summarise_command(folder: Path, values: argparse.Namespace) -> int:
    """
    Print the summary of an evaluation, and write its page into the folder.

    :param values: values of the arguments that `add_summary_arguments` declares.
    :raises InputError: if the evaluation or an argument cannot be used.
    """
    from crgame_ros.evaluation.summary.html_page import write_summary_page
    from crgame_ros.evaluation.summary.summarise import summarise
    from crgame_ros.evaluation.summary.text import summary_markdown, summary_text
    summary = summarise(folder, measures=values.measure, by=tuple(values.by or ('planner',)),
                        baseline=values.baseline, worst=values.worst)
    if values.format == 'json':
        print(json.dumps(summary.as_dict(), indent=2, allow_nan=False, ensure_ascii=False))
    else:
        write = summary_markdown if values.format == 'markdown' else summary_text
        print(write(summary), end='')
    page = folder / SUMMARY_FILE
    write_summary_page(summary, page)
    print(page, file=sys.stderr)
    return 0
