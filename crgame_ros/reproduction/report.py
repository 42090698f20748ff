# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report on a paper's repeated evaluation, with its numbers."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
import json
import os
from pathlib import Path
import platform
from typing import Any

from crgame_ros.analysis.pictures.timing_table import TIMING_ROWS
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
