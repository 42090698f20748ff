# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame reproduce`: repeat a paper's evaluation, and check the expected results."""

import argparse
import gc
import math
from pathlib import Path
import sys

from crgame_ros.errors import InputError

DESCRIPTION = """\
Repeat the evaluation of the CommonRoad-Game paper, and fail if an expected result is missing.

  one AV    a human is recorded once who cuts in and brakes to a stop, and meets the IDM planner
            and the reactive one with the same inputs (figures 8 to 11)
  two AVs   two at once against one human (figures 12 and 13)
  timing    the graph beside a naive loop that does everything in turns (figure 14, table I)

  crgame reproduce commonroad-game --out runs/reproduction
  crgame reproduce commonroad-game --offline
  crgame reproduce commonroad-game --idm idm-package --reactive FILE.py:Class

It writes REPRODUCTION.md with our numbers beside the paper's, comparison.json, figures, table I,
and each run as a CommonRoad scenario. The exit code is 1 if an expectation is not met.
docs/reproduction.md tells more."""
FOLDER = Path('runs') / 'reproduction'
EVALUATIONS = ('commonroad-game',)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add('evaluation', choices=EVALUATIONS, help='whose evaluation')
    add('--out', type=Path, default=FOLDER, metavar='DIR',
        help=f'new folder to write (default: {FOLDER}, or the next with a number)')
    add('--offline', action='store_true',
        help='without ROS and without waiting: all but the timing')
    add('--idm', default='idm', metavar='NAME',
        help='planner in the place of the IDM planner (default: idm)')
    add('--reactive', default='reactive', metavar='NAME',
        help='planner in the place of the reactive one (default: reactive)')
    add('--duration', type=float, default=15.0, metavar='S',
        help='wall time of each loop of the timing (default: 15)')
    add('--format', default='svg', metavar='LIST', help='which of svg,pdf,png (default: svg)')
    parser.set_defaults(command=reproduce)


def reproduce(values: argparse.Namespace) -> int:
    """Run the experiments, write the report and print every expectation."""
    from crgame_ros.planner.registry import planner_class
    from crgame_ros.recording.progress import on_stderr
    from crgame_ros.reproduction.commonroad_game import (
        evaluate_multi_av,
        evaluate_single_av,
        evaluate_timing,
        EvaluationRequest,
        write_report,
    )
    formats = _formats(values.format)
    if not 1.0 <= values.duration < math.inf:
        raise InputError(f'is {values.duration:g} s', '--duration', 'give a second or more')
    # Check both names before the first planner drives.
    for name in (values.idm, values.reactive):
        planner_class(name)
    request = EvaluationRequest(_make_folder(values.out), values.idm, values.reactive,
                                not values.offline, values.duration, formats, on_stderr)
    single, multi = evaluate_single_av(request), evaluate_multi_av(request)
    timing = None
    if request.is_live:
        timing, found = evaluate_timing(request)
        print(found.table.text())
        print(found.load)
    report, _ = write_report(request, single, multi, timing)
    # Free the planners' reference cycles now: compiled packages warn at exit about what is left.
    gc.collect()
    judgements = [*single.judgements, *multi.judgements,
                  *(() if timing is None else timing.judgements)]
    for each in judgements:
        print(each.line, file=sys.stdout if each.is_met else sys.stderr, flush=True)
    print(f'{report}: our numbers beside those of the paper')
    return 0 if all(each.is_met for each in judgements) else 1


def _formats(text: str) -> tuple[str, ...]:
    from crgame_ros.analysis.pictures.figure_style import FORMATS
    chosen = tuple(text.replace(',', ' ').split())
    if not chosen or any(each not in FORMATS for each in chosen):
        raise InputError(f'is "{text[:60]}"', '--format', f'choose from {",".join(FORMATS)}')
    return chosen


def _make_folder(wanted: Path) -> Path:
    """Create a new folder; an existing one is left unchanged."""
    from crgame_ros.paths import numbered
    from crgame_ros.recording.export import prepare_folder
    folder = next(name for name in numbered(wanted.absolute()) if not name.exists())
    prepare_folder(folder)
    return folder
