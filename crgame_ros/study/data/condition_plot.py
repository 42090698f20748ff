# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A measure by condition as a picture: participants as points, means with their intervals."""

from collections.abc import Callable, Sequence
import math

from crgame_ros.analysis.report.report_text import number, plain
from crgame_ros.study.data.condition_means import ConditionMean
import numpy as np

# Of the picture, which is scaled as a whole [px].
WIDTH, _PLOT, _TOP, _BOTTOM, _LEFT = 420, 170, 10, 22, 52
# Of a line of words, and of one of their characters [px].
_LINE, _CHARACTER = 17, 8.3
# Points of equal height stand side by side up to so far from the middle [px].
_SPREAD, _NEAR = 26.0, 7.0
_LONGEST_NAME = 60


def condition_svg(conditions: Sequence[ConditionMean], words: str, digits: int) -> str:
    """
    Draw the conditions beside each other.

    :param words: what is drawn, for those who do not see it.
    :param digits: behind the point, of the means.
    """
    ticks = _ticks([value for each in conditions for value in (
        *each.points.values(), each.mean - each.half, each.mean + each.half, each.mean)])
    low, high = ticks[0], ticks[-1]

    def y(value: float) -> float:
        return _TOP + (high - value) / (high - low) * _PLOT

    wide = (WIDTH - _LEFT) / len(conditions)
    marks = [f'<line class="grid" x1="{_LEFT}" x2="{WIDTH}" y1="{y(tick):.1f}" '
             f'y2="{y(tick):.1f}"/><text class="tick" x="{_LEFT - 6}" y="{y(tick) + 4:.1f}">'
             f'{format(tick, "g").replace("-", "−")}</text>' for tick in ticks]
    # A condition is called by its levels, one a line.
    lines = max(each.condition.count('/') + 1 for each in conditions)
    for place, each in enumerate(conditions):
        middle = _LEFT + wide * (place + 0.5)
        spans = ''.join(
            f'<tspan x="{middle:.1f}" dy="{_LINE}">{plain(_fitting(level, wide))}</tspan>'
            for level in each.condition.split('/'))
        marks.append(f'<text class="name" y="{_TOP + _PLOT + 4}">'
                     f'<title>{plain(each.condition)}</title>{spans}</text>')
        marks += _points(each, middle, wide, y)
        if not math.isnan(each.mean):
            marks.append(_mean(each, middle + min(0.32 * wide, 40.0), y))
    told = '; '.join(f'{each.condition}: mean {number(each.mean, digits)}' + (
        '' if math.isnan(each.half) else f' ± {number(each.half, digits)}')
        for each in conditions)
    return (f'<svg class="conditions" viewBox="0 0 {WIDTH} '
            f'{_TOP + _PLOT + _BOTTOM + _LINE * lines}" role="img" '
            f'aria-label="{plain(f"{words}; {told}")}">{"".join(marks)}</svg>')


def _points(each: ConditionMean, middle: float, wide: float,
            y: Callable[[float], float]) -> list[str]:
    """Draw the participants; those of about equal height beside each other."""
    marks: list[str] = []
    taken: list[float] = []
    far = min(_SPREAD, 0.2 * wide)
    for person, value in sorted(each.points.items(), key=lambda item: item[1]):
        height = y(value)
        beside = sum(abs(other - height) < _NEAR for other in taken[-8:])
        taken.append(height)
        shift = ((beside + 1) // 2) * _NEAR * (1 if beside % 2 else -1)
        x = middle + max(-far, min(far, shift))
        marks.append(f'<circle class="person" cx="{x:.1f}" cy="{height:.1f}" r="3.5">'
                     f'<title>{plain(person)}: {number(value, 3)}</title></circle>')
    return marks


def _mean(each: ConditionMean, x: float, y: Callable[[float], float]) -> str:
    height = y(each.mean)
    bar = '' if math.isnan(each.half) else (
        f'<line class="mean" x1="{x:.1f}" x2="{x:.1f}" '
        f'y1="{y(each.mean - each.half):.1f}" '
        f'y2="{y(each.mean + each.half):.1f}"/>')
    return f'{bar}<rect class="mean" x="{x - 5:.1f}" y="{height - 5:.1f}" width="10" height="10"/>'


def _fitting(name: str, wide: float) -> str:
    most = max(3, min(_LONGEST_NAME, int(wide / _CHARACTER)))
    return name if len(name) <= most else f'{name[:most - 1]}…'


def _ticks(numbers: Sequence[float]) -> list[float]:
    """Choose the values that are named at the side, the ends of the picture among them."""
    from matplotlib.ticker import MaxNLocator
    known = [number for number in numbers if math.isfinite(number)] or [0.0]
    low, high = min(known), max(known)
    if high - low <= 1e-9 * max(abs(low), abs(high), 1.0):
        margin = 0.5 * max(abs(low), 1.0)
        low, high = low - margin, high + margin
    ticks = MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    return [float(np.format_float_positional(tick, 12)) + 0.0 for tick in ticks]
