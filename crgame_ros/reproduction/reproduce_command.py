# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame reproduce`: repeat a paper's evaluation, and check the expected results."""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial
import gc
import json
import math
import os
from pathlib import Path
import platform
import sys
from typing import Any

from crgame_ros.analysis.pictures.timing_table import TIMING_ROWS
from crgame_ros.errors import InputError
from crgame_ros.reproduction.commonroad_game import EvaluationPart, EvaluationRequest
from crgame_ros.reproduction.expectation import Judgement
from crgame_ros.reproduction.synchronization import PAPER_TABLE
from crgame_ros.version import __version__
from crgame_ros.whole_file import write_text

# Captions of the figures, by file name: which figure of the paper each corresponds to.
CAPTIONS = {
    'figure_08_idm_frames': 'fig. 8: the IDM planner from the cut-in until the AV stands',
    'figure_09_idm_profiles': 'fig. 9: heading, position and velocity with the IDM planner',
    'figure_10_reactive_frames': 'fig. 10: the reactive planner, until it has passed',
    'figure_11_reactive_profiles': 'fig. 11: profiles with the reactive planner',
    'figure_12_two_avs_idm_frames': 'fig. 12: two AVs, IDM, the whole encounter',
    'figure_13_two_avs_idm_profiles': 'fig. 13: profiles of the two AVs and the human, IDM',
    'figure_12_two_avs_reactive_frames': 'fig. 12: two AVs, reactive, the whole encounter',
    'figure_13_two_avs_reactive_profiles': 'fig. 13: the same with the reactive planner',
    'figure_14_timing': 'fig. 14: timelines and errors of our loop and the naive one'}
NAME, NUMBERS = 'REPRODUCTION.md', 'comparison.json'
# File formats that a Markdown file can show.
_SHOWN = ('.svg', '.png')


def write_report(request: EvaluationRequest, single: EvaluationPart, multi: EvaluationPart,
                 timing: EvaluationPart | None) -> tuple[Path, Path]:
    """
    Write the report and the numbers.

    :param timing: None where it was not measured.
    :return: the two files.
    :raises InputError: if they cannot be written.
    """
    parts = [single, multi, *([] if timing is None else [timing])]
    judgements = [each for part in parts for each in part.judgements]
    numbers = {
        'evaluation': 'commonroad-game', 'version': __version__,
        'mode': 'live' if request.is_live else 'offline',
        'planners': {'idm': request.idm, 'reactive': request.reactive},
        'machine': {'processor': platform.machine(), 'cores': os.cpu_count(),
                    'python': platform.python_version()},
        'met': all(each.is_met for each in judgements),
        'expectations': [asdict(each) for each in judgements],
        'single_av': single.numbers, 'multi_av': multi.numbers,
        **({} if timing is None else timing.numbers)}
    report, data = request.folder / NAME, request.folder / NUMBERS
    write_text(json.dumps(numbers, indent=2) + '\n', data)
    files = [file for part in parts for file in part.files]
    write_text('\n'.join(_lines(request, judgements, numbers, files)) + '\n', report)
    return report, data


def _lines(request: EvaluationRequest, judgements: Sequence[Judgement],
           numbers: dict[str, Any], files: Sequence[Path]) -> Iterator[str]:
    unmet = sum(not each.is_met for each in judgements)
    yield from (
        '# The evaluation of CommonRoad-Game, repeated', '',
        f'crgame_ros {numbers["version"]}, Python {numbers["machine"]["python"]}, '
        f'{numbers["machine"]["cores"]} cores. The games were recorded {numbers["mode"]}; the '
        'recorded human was then driven, with the same inputs over the same intervals, against '
        f'`{request.idm}` (in the place of the IDM planner) and `{request.reactive}` (reactive).',
        '', f'{len(judgements)} expectations, {unmet or "none"} of them unmet.', '',
        '## What had to come out', '',
        '| experiment | expectation | the paper | here | |', '|---|---|---|---|---|')
    for each in judgements:
        yield (f'| {each.subject} | {each.name} | {each.paper} | {each.found} | '
               f'{"met" if each.is_met else "**unmet**"} |')
    yield ''
    for name, sentence in dict.fromkeys((each.name, each.sentence) for each in judgements):
        yield f'- *{name}*: {sentence}'
    yield from ('', '## Table I', '')
    if 'table_1' in numbers:
        yield from _table(numbers['table_1'])
        yield from ('', numbers['load'])
    else:
        yield 'Not measured: it is about runs in real time; leave --offline out.'
    yield from ('', '## Figures', '')
    # For a figure in several formats, the first format that a page can show.
    shown = {each.stem: each for each in reversed(files) if each.suffix in _SHOWN}
    for name, caption in CAPTIONS.items():
        if name in shown:
            yield from (caption, '', f'![{name}]({shown[name].name})', '')


def _table(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    yield '| metric | ours | paper | naive, ours | naive, paper |'
    yield '|---|---:|---:|---:|---:|'
    for row, form in zip(rows, (each.form for each in TIMING_ROWS), strict=True):
        name = f'{row["metric"]} [{row["unit"]}]' if row['unit'] else row['metric']
        paper, paper_naive = PAPER_TABLE[row['metric']]
        yield (f'| {name} | {row["proposed"]:{form}} | {paper} | {row["naive"]:{form}} '
               f'| {paper_naive} |')


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
    parser.description = DESCRIPTION
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
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
    from crgame_ros.reproduction.commonroad_game import (
        evaluate_multi_av,
        evaluate_single_av,
        evaluate_timing,
        EvaluationRequest,
    )
    formats = _formats(values.format)
    if not 1.0 <= values.duration < math.inf:
        raise InputError(f'is {values.duration:g} s', '--duration', 'give a second or more')
    # Check both names before the first planner drives.
    for name in (values.idm, values.reactive):
        planner_class(name)
    say = partial(print, file=sys.stderr, flush=True)
    request = EvaluationRequest(_make_folder(values.out), values.idm, values.reactive,
                                not values.offline, values.duration, formats, say)
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
