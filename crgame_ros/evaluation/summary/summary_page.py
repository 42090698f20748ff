# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A summary as one HTML file that any browser opens, in the style of reports."""

from collections.abc import Iterator
import math
from pathlib import Path

from crgame_ros import __version__
from crgame_ros.analysis.report.report_document import plain_document
from crgame_ros.analysis.report.report_text import free, note, plain, table
from crgame_ros.evaluation.summary.interval_plot import interval_svg, PlottedInterval
from crgame_ros.evaluation.summary.summary import (
    Estimate,
    GroupMeans,
    PairedDifferences,
    Summary,
)
from crgame_ros.evaluation.summary.summary_markdown import relative
from crgame_ros.evaluation.summary.summary_measures import SummaryMeasure
from crgame_ros.evaluation.summary.summary_tables import (
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
from crgame_ros.recording.export import write_text

_STYLE = Path(__file__).resolve().parent / 'page' / 'summary.css'
_BETTER = {1: 'greater', -1: 'smaller', 0: 'neither'}


def write_summary_page(summary: Summary, path: Path) -> None:
    """
    Write the page of a summary: whole or not at all.

    :param path: of the file; links lead from there to the reports of cells that have one.
    :raises InputError: if it cannot be written.
    """
    write_text(summary_html(summary, path.parent), path)


def summary_html(summary: Summary, folder: Path) -> str:
    """
    Write the page.

    :param folder: in which it will be.
    """
    title = summary_title(summary)
    sections = [(each.key, each.title, _section(summary, each, folder))
                for each in summary_tables(summary)]
    sections.append(('measures', 'Measures', _definitions(summary)))
    links = ''.join(f'<li><a href="#{key}">{plain(words)}</a></li>' for key, words, _ in sections)
    body = [f'<header><h1>{free(title)}</h1><p class="lead">{free(summary_lead(summary))}</p>'
            f'{_chips(summary)}</header>',
            f'<nav aria-label="Parts of the summary"><ul>{links}</ul></nav>', '<main>',
            *(f'<section id="{key}"><h2>{plain(words)}</h2>{html}</section>'
              for key, words, html in sections),
            f'</main><footer><p>crgame_ros {plain(__version__)}</p></footer>']
    return plain_document(title, '\n'.join(body), _STYLE.read_text(encoding='utf-8'))


def _chips(summary: Summary) -> str:
    facts = {'cells finished': str(summary.cells), 'failed': str(summary.failed),
             'scenarios': str(summary.scenarios),
             f'groups by {" × ".join(summary.by)}': str(len(summary.groups)),
             'baseline': free(summary.baseline or '–'), 'resamples': str(summary.resamples)}
    return '<dl class="chips">' + ''.join(
        f'<div><dt>{words}</dt><dd>{value}</dd></div>' for words, value in facts.items()) + '</dl>'


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
    """Return the commands that make the reports that are not there."""
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
            # All the same: nothing to see.
            continue
        figures.append(f'<figure class="chart"><figcaption>{plain(measure_label(measure))}'
                       f'</figcaption>{interval_svg(rows, differences)}</figure>')
    return f'<div class="plots">{"".join(figures)}</div>'


def _plotted(group: GroupMeans | PairedDifferences, found: Estimate, measure: SummaryMeasure,
             summary: Summary, differences: bool) -> PlottedInterval:
    scale = 100.0 if measure.is_share else 1.0
    kind = 'estimate'
    if differences:
        kind = {1: 'better', -1: 'worse'}.get(found.side * measure.better, kind)
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
