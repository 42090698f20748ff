# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The summary of an evaluation as text: for a terminal, and as Markdown."""

from collections.abc import Iterator, Sequence
import os
from pathlib import Path
import re
import textwrap
from urllib.parse import quote

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
# Characters with a meaning in Markdown, or in HTML within it.
_SPECIAL = re.compile(r'([\\`*_{}\[\]<>()#+!|~&])')


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


def summary_markdown(summary: Summary) -> str:
    """
    Return a summary as Markdown.

    Links to reports are relative to the folder of the evaluation.
    """
    lines = [f'# {_plain(summary_title(summary))}', '', _plain(summary_lead(summary))]
    for table in summary_tables(summary):
        lines += ['', f'## {_plain(table.title)}', '']
        lines += _table(summary, table)
        lines += ['', *(f'- {_plain(note)}' for note in table.notes)]
        if table.keys >= 0:
            command = one_line(summary.report_command('KEY')).replace('`', "'")
            lines += [f'- the report of a cell: `{command}`']
    return '\n'.join(lines) + '\n'


def _table(summary: Summary, table: SummaryTable) -> Iterator[str]:
    yield _row([_plain(text) for text in table.head])
    yield _row(['---'] * len(table.head))
    for row in table.rows:
        yield _row([_key(summary, cell.text) if column == table.keys else _markdown_cell(cell)
                    for column, cell in enumerate(row)])


def _row(texts: Sequence[str]) -> str:
    return f'| {" | ".join(texts)} |'


def _markdown_cell(cell: SummaryCell) -> str:
    text = _plain(cell.text)
    text = f'**{text}** {cell.mark}' if cell.mark else text
    return f'{text} ({_plain(cell.detail)})' if cell.detail else text


def _key(summary: Summary, key: str) -> str:
    report = summary.report(key)
    if report is None:
        return _plain(key)
    return f'[{_plain(key)}]({relative(report, summary.folder)})'


def _plain(text: str) -> str:
    return _SPECIAL.sub(r'\\\1', one_line(text))


def relative(path: Path, folder: Path) -> str:
    """Return the address of a file relative to a folder, for links."""
    return quote(Path(os.path.relpath(path, folder)).as_posix())
