# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Series for plots: fewer points with the same extremes, as short text."""

import base64
import json
from typing import Any

from crgame_ros.analysis.report.report_section import Plot, PlotLine
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# A wide plot has about so many columns of pixels; each keeps its smallest and greatest value.
MOST_COLUMNS = 900
FEWEST_COLUMNS = 60
# Points of all plots of a report together: 16 characters each, so some 5 MB.
ALL_POINTS = 300_000
# Of a column: its smallest and greatest value, and a place without any.
_A_COLUMN = 3


def thinned(xs: FloatArray, ys: FloatArray, columns: int) -> tuple[FloatArray, FloatArray]:
    """
    Leave out points of a line that no plot of so many columns could show.

    The smallest and the greatest value of each column stay as they are, at their own places, and
    so do the ends; where a line is broken (NaN) it stays broken.

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
    """Of places in rising order, give the first of each group."""
    return places[np.unique(group[places], return_index=True)[1]]


def columns_for(lines: int) -> int:
    """Return into how many columns each of so many lines may be divided."""
    return max(FEWEST_COLUMNS, min(MOST_COLUMNS, ALL_POINTS // max(_A_COLUMN * lines, 1)))


def encoded(plot: Plot, columns: int) -> dict[str, Any]:
    """Return a plot as the page reads it, its lines divided into so many columns."""
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
            # Values as they are; that times have seven digits nobody sees.
            'x': _packed(xs, '<f4'), 'y': _packed(ys, '<f8')}


def _packed(values: FloatArray, kind: str) -> str:
    return base64.b64encode(values.astype(kind).tobytes()).decode('ascii')


def script_json(content: object) -> str:
    """Write JSON that can stand in a `<script>`: nothing in it ends the element."""
    text = json.dumps(content, allow_nan=False, separators=(',', ':'), sort_keys=True)
    return text.replace('<', '\\u003c').replace('>', '\\u003e').replace('&', '\\u0026')
