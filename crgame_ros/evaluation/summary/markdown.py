# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A summary as Markdown, with tables in GitHub's syntax."""

from collections.abc import Iterator, Sequence
import os
from pathlib import Path
import re
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

# Characters with a meaning in Markdown, or in HTML within it.
_SPECIAL = re.compile(r'([\\`*_{}\[\]<>()#+!|~&])')


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
        yield _row([_key(summary, cell.text) if column == table.keys else _cell(cell)
                    for column, cell in enumerate(row)])


def _row(texts: Sequence[str]) -> str:
    return f'| {" | ".join(texts)} |'


def _cell(cell: SummaryCell) -> str:
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
