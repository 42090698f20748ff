# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A page of results as one HTML file, for runs, evaluations and studies.

It contains its style and scripts, and permits no others.
"""

import base64
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import hashlib
import json
import re

from crgame_ros.analysis.report.section import free, plain, Plot, PlotLine, Section
from crgame_ros.page_libraries import plotly_script
from crgame_ros.paths import page_directory
from crgame_ros.type_stripping import strip_types
import numpy as np
from numpy.typing import NDArray

# Plotly creates an empty `<style>`, and then adds rules to it by script.
_EMPTY = ''
# On loading, it also adds a style for maps, which reports do not have, unless it exists already.
_STYLE_OF_MAPS = re.compile(r'getElementById\("([0-9a-f]{64})"\)')
FloatArray = NDArray[np.float64]

# Approximate number of pixel columns in a wide plot; each keeps its smallest and greatest value.
MOST_COLUMNS = 900
FEWEST_COLUMNS = 60
# Greatest number of points of all plots of a report: 16 characters each, some 5 MB.
ALL_POINTS = 300_000
# Points of a column: its smallest and greatest value, and one without a value.
_A_COLUMN = 3


@dataclass(frozen=True)
class Article:
    """
    A part of a page: one of several runs, or all of the page if it has no title.

    :param sections: of it.
    :param key: unique key, with which the addresses of its sections begin; empty for none.
    :param title: heading, HTML.
    :param letter: that identifies it in plots.
    :param lead: HTML below the heading.
    :param facts: names and values, HTML.
    """

    sections: Sequence[Section]
    key: str = ''
    title: str = ''
    letter: str = ''
    lead: str = ''
    facts: Sequence[tuple[str, str]] = ()

    def address(self, section: Section) -> str:
        """Return the address of one of its sections within the page."""
        return f'{self.key}-{section.key}' if self.key else section.key

    def links(self) -> Iterator[tuple[str, str]]:
        """Yield the addresses and names (HTML) to list on top of the page."""
        if self.title:
            yield self.key, f'{self.letter}: {self.title}'
        else:
            yield from ((self.address(each), each.title) for each in self.sections)

    def html(self) -> str:
        """Return it as HTML."""
        if not self.title:
            return '\n'.join(_section(self.address(each), each, 2) for each in self.sections)
        return '\n'.join((
            f'<article id="{self.key}"><h2><span class="letter">{self.letter}</span> '
            f'{self.title}</h2><p class="lead">{self.lead}</p>{_chips(self.facts)}',
            *(_section(self.address(each), each, 3) for each in self.sections), '</article>'))


@dataclass(frozen=True)
class Page:
    """
    A page of results: of runs, of an evaluation or of a study.

    :param title: text, also shown in the browser's tab.
    :param lead: HTML below the title.
    :param facts: names and values, HTML.
    :param articles: its content.
    :param footer: HTML.
    :param style: style rules in addition to those of all pages.
    :param script: its own script, as a path in the folder of pages (TypeScript).
    :param data: JSON-compatible values that this script reads.
    """

    title: str
    lead: str
    facts: Sequence[tuple[str, str]]
    articles: Sequence[Article]
    footer: str = ''
    style: str = ''
    script: str = ''
    data: object = None

    def html(self) -> str:
        """
        Return the document.

        :raises CrgameError: if it has plots, and Plotly has not been fetched.
        """
        links = ''.join(f'<li><a href="#{address}">{words}</a></li>'
                        for article in self.articles for address, words in article.links())
        body = '\n'.join((
            f'<header><h1>{free(self.title)}</h1><p class="lead">{self.lead}</p>'
            f'{_chips(self.facts)}</header>',
            f'<nav aria-label="Parts of the report"><ul>{links}</ul></nav>', '<main>',
            *(article.html() for article in self.articles),
            '</main>' + (f'<footer>{self.footer}</footer>' if self.footer else '')))
        plots = [(f'{article.address(section)}-{plot.key}', plot) for article in self.articles
                 for section in article.sections for plot in section.plots]
        page = page_directory() / 'report'
        style = f'{(page / "report.css").read_text(encoding="utf-8")}\n{self.style}'
        if self.script:
            script = strip_types((page_directory() / self.script).read_bytes(),
                                 self.script).decode()
            return _document(self.title, (style,), '', '\n'.join((
                body, f'<script id="data" type="application/json">{script_json(self.data)}'
                f'</script>', f'<script>{script}</script>')), (script,))
        if not plots:
            return _document(self.title, (style,), '', body, ())
        script = strip_types((page / 'report.ts').read_bytes(), 'report.ts').decode()
        plotly = plotly_script().read_text(encoding='utf-8')
        done = ''.join(f'<template id="{found}"></template>'
                       for found in dict.fromkeys(_STYLE_OF_MAPS.findall(plotly)))
        return _document(self.title, (style, _EMPTY), done, '\n'.join((
            body, f'<script id="plots" type="application/json">{_plot_data(plots)}</script>',
            f'<script>{plotly}</script>', f'<script>{script}</script>')), (plotly, script))


def _chips(facts: Sequence[tuple[str, str]]) -> str:
    items = ''.join(f'<div><dt>{words}</dt><dd>{value}</dd></div>' for words, value in facts)
    return f'<dl class="chips">{items}</dl>' if items else ''


def _section(address: str, section: Section, level: int) -> str:
    plots = ''.join(_plot(f'{address}-{plot.key}', plot) for plot in section.plots)
    if plots:
        plots = f'<div class="plots">{plots}</div>'
    return (f'<section id="{address}">'
            f'<h{level}>{section.title}</h{level}>{section.html}{plots}</section>')


def _plot(address: str, plot: Plot) -> str:
    unit = f' <span class="unit">[{plot.unit}]</span>'
    return (f'<figure class="chart{" plane" if plot.plane else ""}"><figcaption>{plot.title}{unit}'
            f'</figcaption><div class="plot" id="{address}" role="img" '
            f'aria-label="Plot of {plot.title}"></div></figure>')


def _document(title: str, styles: Sequence[str], head: str, body: str,
              scripts: Sequence[str]) -> str:
    allowed = ' '.join(map(_hash, scripts)) or "'none'"
    policy = '; '.join((
        "default-src 'none'", f'script-src {allowed}',
        f'style-src {" ".join(map(_hash, styles))}', 'img-src data:', "base-uri 'none'",
        "form-action 'none'"))
    return '\n'.join((
        '<!DOCTYPE html>', '<html lang="en">', '<head>', '<meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta name="referrer" content="no-referrer">',
        f'<title>{plain(title)} – report</title>', '<link rel="icon" href="data:,">',
        f'<style>{styles[0]}</style>{head}', '</head>', '<body>', body, '</body>', '</html>', ''))


def _hash(text: str) -> str:
    digest = hashlib.sha256(text.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


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


def encoded(plot: Plot, columns: int) -> dict[str, object]:
    """Return a plot in the page's format, with its lines thinned to so many columns."""
    return {
        'unit': plot.unit, 'plane': plot.plane,
        'bounds': plot.bounds,
        'limits': [{'value': limit.value, 'label': limit.label} for limit in plot.limits],
        'spans': [{'from': span.start_s, 'to': span.end_s, 'label': span.label,
                   'colour': span.colour} for span in plot.spans],
        'lines': [_line(line, columns, plot.plane) for line in plot.lines]}


def _line(line: PlotLine, columns: int, plane: bool) -> dict[str, object]:
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


def _plot_data(plots: Sequence[tuple[str, Plot]]) -> str:
    """
    Return the data of plots as JSON that is safe in a `<script>`.

    :param plots: each with its address in the page.
    """
    columns = columns_for(sum(len(plot.lines) for _, plot in plots))
    return script_json({address: encoded(plot, columns) for address, plot in plots})
