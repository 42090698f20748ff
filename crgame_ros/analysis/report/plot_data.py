# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The data of a page's plots, as its script reads them."""

import base64
from collections.abc import Sequence
import json

from crgame_ros.analysis.report.section import Plot, PlotLine
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


def plot_data(plots: Sequence[tuple[str, Plot]]) -> str:
    """
    Return the data of plots as JSON that is safe in a `<script>`.

    :param plots: each with its address in the page.
    """
    columns = columns_for(sum(len(plot.lines) for _, plot in plots))
    return script_json({address: encoded(plot, columns) for address, plot in plots})
