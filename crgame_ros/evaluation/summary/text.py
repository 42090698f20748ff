# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The summary of an evaluation as text for a terminal."""

from collections.abc import Iterator, Sequence
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
