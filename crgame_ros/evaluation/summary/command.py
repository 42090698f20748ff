# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame evaluate --summary`: print and write the summary of an evaluation."""

import argparse
from collections.abc import Iterator, Sequence
import json
from pathlib import Path
import sys
import textwrap

from crgame_ros.errors import one_line
from crgame_ros.evaluation.summary.summary import Summary
from crgame_ros.evaluation.summary.tables import (
    summary_lead,
    summary_tables,
    summary_title,
    SummaryCell,
    SummaryTable,
)

WIDTH = 120
_GAP, _INDENT = '  ', '  '
# Greatest length of a text in a table [characters].
_LONGEST = 40


def summary_text(summary: Summary) -> str:
    """Return a summary as text for a terminal."""
    lines = _wrapped(f'{summary_title(summary)}: {summary_lead(summary)}', '')
    for table in summary_tables(summary):
        lines += ['', _cut(table.title)]
        for note in table.notes:
            lines += _wrapped(note, _INDENT)
        lines += _rows(table)
        if table.keys >= 0:
            lines += _reports(summary, table)
    return '\n'.join(lines) + '\n'


def _wrapped(text: str, indent: str) -> list[str]:
    return textwrap.wrap(one_line(text), WIDTH, initial_indent=indent, subsequent_indent=indent)


def _reports(summary: Summary, table: SummaryTable) -> Iterator[str]:
    """Yield the paths of single cells' reports, or the commands that make them."""
    keys = list(dict.fromkeys(row[table.keys].text for row in table.rows))
    there = [(key, path) for key in keys if (path := summary.report(key)) is not None]
    for _, path in there:
        yield f'{_INDENT}report: {one_line(str(path))}'
    if len(there) < len(keys):
        yield f'{_INDENT}the report of a cell: {one_line(summary.report_command("KEY"))}'


def _rows(table: SummaryTable) -> Iterator[str]:
    """Yield the lines of a table; columns that do not fit follow below."""
    rows = [[_cut(text) for text in table.head],
            *([_cell(cell) for cell in row] for row in table.rows)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(table.head))]
    for part in _parts(widths):
        yield ''
        for row in rows:
            yield (_INDENT + _GAP.join(row[column].ljust(widths[column])
                                       for column in part)).rstrip()


def _parts(widths: Sequence[int]) -> Iterator[list[int]]:
    """Yield the columns of each part: as few parts as fit, each starting with the first column."""
    part, used = [0], widths[0]
    for column in range(1, len(widths)):
        used += len(_GAP) + widths[column]
        if used > WIDTH and len(part) > 1:
            yield part
            part, used = [0], widths[0] + len(_GAP) + widths[column]
        part.append(column)
    yield part


def _cell(cell: SummaryCell) -> str:
    detail = f' ({_cut(cell.detail)})' if cell.detail else ''
    return f'{_cut(cell.text)}{detail}{f" {cell.mark}" if cell.mark else ""}'


def _cut(text: str) -> str:
    text = one_line(text)
    return text if len(text) <= _LONGEST else f'{text[:_LONGEST - 1]}…'


SUMMARY_FILE = 'summary.html'
FORMATS = ('text', 'markdown', 'json')


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

    :param folder: folder of the evaluation.
    :param values: values of the arguments that `add_summary_arguments` declares.
    :raises InputError: if the evaluation or an argument cannot be used.
    """
    from crgame_ros.evaluation.summary.html_page import write_summary_page
    from crgame_ros.evaluation.summary.markdown import summary_markdown
    from crgame_ros.evaluation.summary.summarise import summarise
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
