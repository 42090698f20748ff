# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes a summary as a single HTML file, in the style of reports."""

from collections.abc import Iterator, Sequence
import math
from pathlib import Path
from typing import NamedTuple

from crgame_ros.analysis.report.document import Article, Page
from crgame_ros.analysis.report.section import (
    axis_ticks,
    free,
    note,
    plain,
    Section,
    table,
    tick_text,
)
from crgame_ros.evaluation.summary.measures import SummaryMeasure
from crgame_ros.evaluation.summary.summary import (
    Estimate,
    GroupMeans,
    PairedDifferences,
    Summary,
)
from crgame_ros.evaluation.summary.tables import (
    group_name,
    known_measures,
    measure_label,
    quantity,
    summary_lead,
    summary_tables,
    summary_title,
    SummaryCell,
    SummaryTable,
)
from crgame_ros.evaluation.summary.text import relative
from crgame_ros.version import __version__
from crgame_ros.whole_file import write_text

# Sizes in the picture, which is scaled as a whole [px].
WIDTH, _ROW, _TOP, _AXIS = 420, 22, 6, 24
_NAMES, _NUMBERS, _EDGE = 116, 58, 8
_LONGEST_NAME = 17


class PlottedInterval(NamedTuple):
    """
    A row of the picture.

    :param name: name of the group.
    :param value: the mean.
    :param low: lower bound of the interval; NaN for none.
    :param high: upper bound of the interval.
    :param text: the mean as text.
    :param kind: CSS class of its marks.
    """

    name: str
    value: float
    low: float
    high: float
    text: str
    kind: str


def interval_svg(rows: Sequence[PlottedInterval], with_zero: bool) -> str:
    """
    Return an SVG with rows one above the other.

    :param rows: rows; one with a mean of NaN stays empty.
    :param with_zero: whether the picture includes zero, as a line.
    """
    ticks = axis_ticks([number for row in rows for number in (row.value, row.low, row.high)],
                       4, with_zero)
    low, high = ticks[0], ticks[-1]
    left, right = _NAMES, WIDTH - _NUMBERS - _EDGE

    def x(value: float) -> float:
        return left + (value - low) / (high - low) * (right - left)

    bottom = _TOP + _ROW * len(rows)
    marks = [_tick(x(tick), tick, bottom, with_zero) for tick in ticks]
    for place, row in enumerate(rows):
        middle = _TOP + _ROW * (place + 0.5)
        name = row.name if len(row.name) <= _LONGEST_NAME else f'{row.name[:_LONGEST_NAME - 1]}…'
        marks.append(f'<text x="0" y="{middle + 4:.1f}">{plain(name)}'
                     f'<title>{plain(row.name)}</title></text>')
        if math.isnan(row.value):
            continue
        if not math.isnan(row.low):
            marks.append(f'<line class="{row.kind}" x1="{x(row.low):.1f}" x2="{x(row.high):.1f}" '
                         f'y1="{middle:.1f}" y2="{middle:.1f}"/>')
        marks.append(f'<circle class="{row.kind}" cx="{x(row.value):.1f}" cy="{middle:.1f}" '
                     f'r="4"/><text class="number" x="{WIDTH}" y="{middle + 4:.1f}">'
                     f'{plain(row.text)}</text>')
    words = '; '.join(f'{row.name} {row.text}' for row in rows)
    return (f'<svg class="intervals" viewBox="0 0 {WIDTH} {bottom + _AXIS}" role="img" '
            f'aria-label="{plain(words)}">{"".join(marks)}</svg>')


def _tick(x: float, value: float, bottom: float, with_zero: bool) -> str:
    kind = 'zero' if with_zero and value == 0.0 else 'grid'
    return (f'<line class="{kind}" x1="{x:.1f}" x2="{x:.1f}" y1="{_TOP}" y2="{bottom}"/>'
            f'<text class="tick" x="{x:.1f}" y="{bottom + 16}">'
            f'{tick_text(value)}</text>')


_STYLE = Path(__file__).resolve().parent / 'page' / 'summary.css'
_BETTER = {1: 'greater', -1: 'smaller', 0: 'neither'}


def write_summary_page(summary: Summary, path: Path) -> None:
    """
    Write the page of a summary, completely or not at all.

    :param path: path of the file; links to the cells' reports are relative to it.
    :raises InputError: if it cannot be written.
    """
    sections = [Section(each.key, plain(each.title), _section(summary, each, path.parent))
                for each in summary_tables(summary)]
    sections.append(Section('measures', 'Measures', _definitions(summary)))
    facts = [('cells finished', str(summary.cells)), ('failed', str(summary.failed)),
             ('scenarios', str(summary.scenarios)),
             (f'groups by {" × ".join(summary.by)}', str(len(summary.groups))),
             ('baseline', free(summary.baseline or '–'))]
    page = Page(summary_title(summary), free(summary_lead(summary)), facts, [Article(sections)],
                f'<p>crgame_ros {plain(__version__)}</p>', _STYLE.read_text(encoding='utf-8'))
    write_text(page.html(), path)


def _section(summary: Summary, content: SummaryTable, folder: Path) -> str:
    rows = [[_key(summary, cell.text, folder) if column == content.keys else _cell(cell)
             for column, cell in enumerate(row)] for row in content.rows]
    kind = 'numbers' if content.key in ('means', 'differences') else 'cells'
    html = ''.join(note(f'{plain(text[:1].upper() + text[1:])}.') for text in content.notes)
    html += table(plain(content.caption), [free(text) if text else '' for text in content.head],
                  rows, kind)
    if content.key in ('means', 'differences'):
        html += _plots(summary, content.key == 'differences')
    if content.key == 'failures':
        html += ''.join(_tracebacks(summary))
    if content.keys >= 0:
        html += _commands(summary, content)
    return html


def _cell(cell: SummaryCell) -> str:
    text = free(cell.text.replace('-', '−') if cell.detail else cell.text)
    if cell.mark:
        text = f'<span class="{cell.mark}">{text}</span> <small>{cell.mark}</small>'
    if not cell.detail:
        return text
    return f'{text}<br><small>{free(cell.detail.replace("-", "−"))}</small>'


def _key(summary: Summary, key: str, folder: Path) -> str:
    report = summary.report(key)
    if report is None:
        return f'<code>{plain(key)}</code>'
    return f'<a href="{relative(report, folder)}"><code>{plain(key)}</code></a>'


def _commands(summary: Summary, content: SummaryTable) -> str:
    """Return the commands that make the missing reports."""
    keys = dict.fromkeys(row[content.keys].text for row in content.rows)
    lines = [plain(summary.report_command(key)) for key in keys if summary.report(key) is None]
    if not lines:
        return ''
    return (note('A key without a link has no report yet. These commands run such a cell again, '
                 'bit by bit the same, and write its report:')
            + f'<pre class="commands" tabindex="0">{chr(10).join(lines)}</pre>')


def _tracebacks(summary: Summary) -> Iterator[str]:
    for failure in summary.failures:
        if failure.traceback:
            lines = '\n'.join(map(plain, failure.traceback.splitlines()))
            yield (f'<details class="file"><summary>{free(failure.status)}: '
                   f'{free(failure.reason)}</summary><pre>{lines}</pre></details>')


def _plots(summary: Summary, differences: bool) -> str:
    groups = summary.differences if differences else summary.groups
    figures = []
    for place, measure in known_measures(summary):
        rows = [_plotted(group, group.estimates[place], measure, summary, differences)
                for group in groups]
        if len({row.value for row in rows if not math.isnan(row.value)}) < 2 and all(
                not row.low < row.high for row in rows):
            # All values are equal, so that a picture shows nothing.
            continue
        figures.append(f'<figure class="chart"><figcaption>{plain(measure_label(measure))}'
                       f'</figcaption>{interval_svg(rows, differences)}</figure>')
    return f'<div class="plots">{"".join(figures)}</div>'


def _plotted(group: GroupMeans | PairedDifferences, found: Estimate, measure: SummaryMeasure,
             summary: Summary, differences: bool) -> PlottedInterval:
    scale = 100.0 if measure.is_share else 1.0
    kind = 'estimate'
    if differences:
        kind = {1: 'better', -1: 'worse'}.get(
            found.side(measure.negligible) * measure.better, kind)
    elif summary.baseline in group.labels:
        kind = 'baseline'
    return PlottedInterval(
        group_name(group.labels), scale * found.value, scale * found.low, scale * found.high,
        quantity(found.value, measure, differences).replace('-', '−'), kind)


def _definitions(summary: Summary) -> str:
    rows = [(plain(measure.label), f'<code>{plain(measure.name)}</code>',
             plain('%' if measure.is_share else measure.unit), _BETTER[measure.better],
             plain(measure.definition)) for measure in summary.measures]
    return table('What is summed up', ('measure', 'name', 'unit', 'better', 'definition'), rows,
                 'definitions')
