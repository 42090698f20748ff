# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Means and their intervals as a picture."""

from collections.abc import Sequence
import math
from typing import NamedTuple

from crgame_ros.analysis.report.report_text import plain
import numpy as np

# Of the picture, which is scaled as a whole [px].
WIDTH, _ROW, _TOP, _AXIS = 420, 22, 6, 24
_NAMES, _NUMBERS, _EDGE = 116, 58, 8
_LONGEST_NAME = 17

# Of the numbers' size; a narrower range has no marks that differ.
_NARROWEST = 1e-9


class PlottedInterval(NamedTuple):
    """
    A row of the picture.

    :param name: of whom it is.
    :param value: the mean.
    :param low: of the interval; NaN for none.
    :param high: of the interval.
    :param text: the mean as it is written.
    :param kind: class of its marks.
    """

    name: str
    value: float
    low: float
    high: float
    text: str
    kind: str


def interval_svg(rows: Sequence[PlottedInterval], with_zero: bool) -> str:
    """
    Draw rows one above the other.

    :param rows: those whose mean is NaN stay empty.
    :param with_zero: whether zero is in the picture, as a line.
    """
    ticks = _ticks([number for row in rows for number in (row.value, row.low, row.high)],
                   with_zero)
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
            f'{format(value, "g").replace("-", "−")}</text>')


def _ticks(numbers: Sequence[float], with_zero: bool) -> list[float]:
    """Choose the values that are named below, the ends of the picture among them."""
    # Takes a while, and only pages need it.
    from matplotlib.ticker import MaxNLocator
    known = [number for number in numbers if math.isfinite(number)]
    if with_zero or not known:
        known.append(0.0)
    low, high = min(known), max(known)
    size = max(abs(low), abs(high))
    if high - low <= _NARROWEST * max(size, 1.0):
        margin = 0.5 * size if size > _NARROWEST else 0.5
        low, high = low - margin, high + margin
    ticks = MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    return [float(np.format_float_positional(tick, 12)) + 0.0 for tick in ticks]
