# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the file of a report, completely or not at all."""

import base64
from collections.abc import Callable, Iterator, Sequence
import json
from pathlib import Path
from typing import Any

from crgame_ros.analysis.report.comparison import (
    accepted,
    comparison_section,
    letter,
    worst_of_all,
)
from crgame_ros.analysis.report.criticality_section import criticality_section
from crgame_ros.analysis.report.document import plotted_document
from crgame_ros.analysis.report.driving_section import driving_section, task_section
from crgame_ros.analysis.report.motion_section import input_section, motion_section
from crgame_ros.analysis.report.outcome_section import outcome_section
from crgame_ros.analysis.report.planners_section import planners_section
from crgame_ros.analysis.report.run_section import began, run_section, software_note, title_of
from crgame_ros.analysis.report.section import Plot, PlotLine, Section
from crgame_ros.analysis.report.story_section import story_section
from crgame_ros.analysis.report.text import free, NOTHING, number
from crgame_ros.analysis.report.timing_section import plan_section, timing_section
from crgame_ros.analysis.runs.run import Run
from crgame_ros.errors import InputError
from crgame_ros.software import software
from crgame_ros.whole_file import write_text
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Approximate number of pixel columns in a wide plot; each keeps its smallest and greatest value.
MOST_COLUMNS = 900
FEWEST_COLUMNS = 60
# Greatest number of points of all plots of a report: 16 characters each, some 5 MB.
ALL_POINTS = 300_000
# Points of a column: its smallest and greatest value, and one without a value.
_A_COLUMN = 3
# The sections of a run's report, in order; a new section is added here.
SECTIONS: tuple[Callable[[Run], Section | None], ...] = (
    story_section, criticality_section, outcome_section, driving_section, task_section,
    planners_section, input_section, motion_section, plan_section, timing_section, run_section)


def thinned(xs: FloatArray, ys: FloatArray, columns: int) -> tuple[FloatArray, FloatArray]:
    """
    Return a line without points that a plot of so many columns cannot show.

    The smallest and the greatest value of each column are kept at their own places, as are the
    ends. A line that is broken (NaN) stays broken.

    :param xs: (N) rising.
    :param ys: (N)
    """
    if len(xs) <= 2 * columns:
        return xs, ys
    if (xs[-1] - xs[0]) > 0.0:
        column = np.minimum((xs - xs[0]) / (xs[-1] - xs[0]) * columns, columns - 1).astype(int)
    else:
        column = np.zeros(len(xs), dtype=int)
    starts = np.flatnonzero(np.diff(column, prepend=-1))
    counts = np.diff(starts, append=len(xs))
    group = np.repeat(np.arange(len(starts)), counts)
    hole = np.isnan(ys)
    kept = np.zeros(len(xs), dtype=bool)
    kept[[0, -1]] = True
    for filled, reduce in ((np.where(hole, np.inf, ys), np.minimum),
                           (np.where(hole, -np.inf, ys), np.maximum)):
        best = reduce.reduceat(filled, starts)
        kept[_first(np.flatnonzero(~hole & (filled == best[group])), group)] = True
    kept[_first(np.flatnonzero(hole), group)] = True
    return xs[kept], ys[kept]


def _first(places: NDArray[np.intp], group: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the first of each group, for places in rising order."""
    return places[np.unique(group[places], return_index=True)[1]]


def columns_for(lines: int) -> int:
    """Return the number of columns for each line, given the number of lines."""
    return max(FEWEST_COLUMNS, min(MOST_COLUMNS, ALL_POINTS // max(_A_COLUMN * lines, 1)))


def encoded(plot: Plot, columns: int) -> dict[str, Any]:
    """Return a plot in the page's format, with its lines thinned to so many columns."""
    return {
        'unit': plot.unit, 'plane': plot.plane,
        'bounds': plot.bounds,
        'limits': [{'value': limit.value, 'label': limit.label} for limit in plot.limits],
        'spans': [{'from': span.start_s, 'to': span.end_s, 'label': span.label,
                   'colour': span.colour} for span in plot.spans],
        'lines': [_line(line, columns, plot.plane) for line in plot.lines]}


def _line(line: PlotLine, columns: int, plane: bool) -> dict[str, Any]:
    xs, ys = line.xs, np.where(np.isfinite(line.ys), line.ys, np.nan)
    if plane:
        most = min(len(xs), _A_COLUMN * columns)
        chosen = np.unique(np.linspace(0, len(xs) - 1, most).astype(int))
        xs, ys = xs[chosen], ys[chosen]
    else:
        xs, ys = thinned(xs, ys, columns)
    return {'name': line.name, 'colour': line.colour, 'dash': line.dash,
            # Values keep full precision; for times, seven digits are enough.
            'x': _packed(xs, '<f4'), 'y': _packed(ys, '<f8')}


def _packed(values: FloatArray, kind: str) -> str:
    return base64.b64encode(values.astype(kind).tobytes()).decode('ascii')


def script_json(content: object) -> str:
    """Return JSON that is safe in a `<script>`: no text in it ends the element."""
    text = json.dumps(content, allow_nan=False, separators=(',', ':'), sort_keys=True)
    return text.replace('<', '\\u003c').replace('>', '\\u003e').replace('&', '\\u0026')


def report_html(runs: Sequence[Run], software: str = '') -> str:
    """
    Return the page.

    :param runs: one or more.
    :param software: HTML on the software that wrote the report.
    :raises CrgameError: if Plotly is not installed.
    """
    for run in runs:
        # Criticality and its course are measured at once; the sections would first ask for either.
        run.course  # noqa: B018
    if len(runs) > 1:
        runs = [run.as_part(f'run{number}') for number, run in enumerate(runs, 1)]
    parts = [(run, [section for make in SECTIONS if (section := make(run)) is not None])
             for run in runs]
    several = len(runs) > 1
    comparison = [('all', comparison_section(runs))] if several else []
    plots = [(f'{key}-{section.key}-{plot.key}', plot) for key, section in (
        *comparison, *((run.key, section) for run, sections in parts for section in sections))
        for plot in section.plots]
    columns = columns_for(sum(len(plot.lines) for _, plot in plots))
    title = ' · '.join(dict.fromkeys(map(title_of, runs)))
    body = [_header(runs, title), _navigation(parts, several), '<main>']
    body += [_section(key, section, 2) for key, section in comparison]
    for place, (run, sections) in enumerate(parts):
        if several:
            body.append(f'<article id="{run.key}"><h2><span class="letter">{letter(place)}</span> '
                        f'{free(run.name)}</h2><p class="lead">{_lead(run)}</p>{_chips(run)}')
        body += [_section(run.key, section, 3 if several else 2) for section in sections]
        body.append('</article>' if several else '')
    body.append(f'</main><footer>{software}</footer>')
    data = script_json({key: encoded(plot, columns) for key, plot in plots})
    return plotted_document(title, '\n'.join(body), data)


def _header(runs: Sequence[Run], title: str) -> str:
    if len(runs) > 1:
        return f'<header><h1>{free(title)}</h1><p class="lead">{len(runs)} runs</p></header>'
    return (f'<header><h1>{free(title)}</h1><p class="lead">{_lead(runs[0])}</p>'
            f'{_chips(runs[0])}</header>')


def _lead(run: Run) -> str:
    game = run.log.game
    who = [f'{item.id} driven by {free(item.driver)}' for item in game.humans]
    who += [f'{item.id} planned by {free(item.planner)}' for item in game.avs]
    when = began(run)
    scenario = '' if game.benchmark_id == title_of(run) else free(game.benchmark_id)
    parts = [scenario, *who, f'{number(float(run.times_s[-1]), 1)} s',
             *(() if when == NOTHING else (f'recorded {when}',))]
    return ' · '.join(filter(None, parts))


def _chips(run: Run) -> str:
    return '<dl class="chips">' + ''.join(
        f'<div><dt>{words}</dt><dd>{value}</dd></div>' for words, value in _facts(run)) + '</dl>'


def _facts(run: Run) -> Iterator[tuple[str, str]]:
    contacts = run.contacts
    if contacts is not None:
        yield 'contacts', str(len(contacts))
    if run.outcome is not None:
        yield 'violations', str(run.outcome['drivability']['violations'])
    yield 'least TTC [s]', worst_of_all(run, 'ttc')
    yield 'least distance [m]', worst_of_all(run, 'min_distance')
    yield 'greatest DRAC [m/s²]', worst_of_all(run, 'drac')
    if run.log.game.avs and run.outcome is not None:
        yield 'plans accepted', accepted(run).partition(' (')[0]
    if run.timing is not None:
        yield 'real-time ratio', number(run.timing['real_time_ratio']['final'], 3)


def _navigation(parts: Sequence[tuple[Run, list[Section]]], several: bool) -> str:
    links = [('all-comparison', 'Comparison')] if several else []
    if several:
        links += [(run.key, f'{letter(place)}: {free(run.name)}')
                  for place, (run, _) in enumerate(parts)]
    else:
        links += [(f'{run.key}-{section.key}', section.title)
                  for run, sections in parts for section in sections]
    items = ''.join(f'<li><a href="#{address}">{words}</a></li>' for address, words in links)
    return f'<nav aria-label="Parts of the report"><ul>{items}</ul></nav>'


def _section(key: str, section: Section, level: int) -> str:
    plots = ''.join(_plot(f'{key}-{section.key}-{plot.key}', plot) for plot in section.plots)
    if plots:
        plots = f'<div class="plots">{plots}</div>'
    return (f'<section id="{key}-{section.key}" class="{section.key}">'
            f'<h{level}>{section.title}</h{level}>{section.html}{plots}</section>')


def _plot(address: str, plot: Plot) -> str:
    unit = f' <span class="unit">[{plot.unit}]</span>'
    return (f'<figure class="chart{" plane" if plot.plane else ""}"><figcaption>{plot.title}{unit}'
            f'</figcaption><div class="plot" id="{address}" role="img" '
            f'aria-label="Plot of {plot.title}"></div></figure>')


# Lines of more runs are hard to distinguish.
MOST_RUNS = 12


def write_report(runs: Sequence[Run], path: Path, driven_here: bool = False) -> None:
    """
    Write the report of one or more runs.

    :param path: path of the file.
    :param driven_here: whether this software, on this machine, has just driven the runs.
    :raises InputError: if the file cannot be written.
    :raises CrgameError: if Plotly is not installed.
    """
    write_text(report_html(runs, software_note(software(), driven_here)), path)


def check_report_path(path: Path) -> None:
    """
    Check, before the work, that a report can be written to a file.

    :raises InputError: if its name is not that of an HTML file, or its folder is missing.
    """
    if path.suffix.lower() not in ('.html', '.htm'):
        raise InputError('is no name of an HTML file', str(path), 'give FILE.html')
    if not path.parent.is_dir():
        raise InputError('no such folder', str(path.parent), 'name a file in another one')


def check_report_runs(count: int) -> None:
    """Refuse a number of runs that is too large to compare."""
    if count > MOST_RUNS:
        raise InputError(f'{count} runs', 'report', f'give {MOST_RUNS} at most')
