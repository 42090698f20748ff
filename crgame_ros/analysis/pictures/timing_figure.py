# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The figure of runs' timing against the wall clock (as CRG figure 14), from recorded cycles."""

from collections.abc import Sequence
from dataclasses import dataclass

from crgame_ros.analysis.pictures.figure_style import new_figure, panel_letter, paper_style
from crgame_ros.analysis.pictures.palette import AV_COLOURS, HUMAN_COLOURS, INK
from crgame_ros.timing.cycle_rows import CycleTable
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# More points would enlarge files without a visible effect: longer lines keep only extremes.
MOST_POINTS = 4000
_HEIGHT, _NAMES = 1.55, 0.1
# Number of columns of a wide figure.
PAIR = 2


@dataclass(frozen=True)
class TimedRun:
    """
    The cycles of a run, with its name in figures and tables.

    :param label: for people.
    :param cycles: as recorded.
    :param dt_s: nominal step [s]
    """

    label: str
    cycles: CycleTable
    dt_s: float

    @property
    def scheduled_s(self) -> FloatArray:
        """Return scheduled starts S_n on the original anchor (`docs/timing.md`) (R) [s]."""
        return np.asarray(self.cycles.column('ideal_s') - self.cycles.column('dropped_s'))

    @property
    def actual_s(self) -> FloatArray:
        """Return measured starts tau_n (R) [s]."""
        return self.cycles.column('actual_s')

    @property
    def lags_s(self) -> FloatArray:
        """Return cumulative errors L_n against the original anchor (R) [s]."""
        return np.asarray(self.actual_s - self.scheduled_s)

    @property
    def step_errors_s(self) -> FloatArray:
        """Return step errors e_n (R - 1) [s], whose sum is the change of the lag."""
        return np.diff(self.lags_s)


def timing_figure(runs: Sequence[TimedRun], columns: int = 2) -> Figure:
    """
    Draw timelines and errors: two runs side by side, or a row for each of one or more runs.

    :param runs: one, or several to compare.
    :param columns: number of page columns for the figure, 1 or 2.
    """
    below = len(runs) == PAIR and columns == PAIR
    places = 2 * len(runs)
    # A pair is compared as in the paper; otherwise each run has one row, or two in narrow figures.
    across = PAIR if columns == PAIR else 1
    with paper_style():
        figure = new_figure(columns, places // across * _HEIGHT + _NAMES)
        axes = figure.subplots(places // across, across, squeeze=False).ravel()
        for number, run in enumerate(runs):
            upper, lower = (number, PAIR + number) if below else (2 * number, 2 * number + 1)
            label = run.label if len(runs) > 1 else ''
            _draw_timelines(axes[upper], run, _title(upper, label, 'timing progression'))
            _draw_errors(axes[lower], run, _title(lower, label, 'error evolution'))
    return figure


def _title(number: int, label: str, what: str) -> str:
    # An unescaped dollar sign would begin a formula.
    words = f'{label}: {what}'.replace('$', r'\$') if label else what.capitalize()
    return f'{panel_letter(number)} {words}'


def _draw_timelines(axes: Axes, run: TimedRun, title: str) -> None:
    steps = run.cycles.column('n')
    axes.plot(*thinned(steps, run.actual_s), color=HUMAN_COLOURS[0], linewidth=1.1,
              label=r'realized, $\tau_n$', gid='actual')
    axes.plot(*thinned(steps, run.scheduled_s), color=INK, linewidth=0.9, linestyle=(0, (4, 2)),
              label=r'ideal, $\tau^*_n$', gid='ideal')
    axes.set_ylabel('wall-clock time [s]')
    _finish(axes, steps, title)
    axes.legend(loc='upper left', borderaxespad=0.2)


def _draw_errors(axes: Axes, run: TimedRun, title: str) -> None:
    steps = run.cycles.column('n')
    axes.plot(*thinned(steps[1:], 1e3 * run.step_errors_s), color=AV_COLOURS[1], linewidth=0.6,
              label='step-wise', gid='step error')
    axes.plot(*thinned(steps, 1e3 * run.lags_s), color=HUMAN_COLOURS[0], linewidth=1.0,
              linestyle=(0, (5, 1)), label='cumulative', gid='cumulative error')
    axes.set_ylabel('error [ms]')
    _finish(axes, steps, title)
    low, high = axes.get_ylim()
    # Space for the legend above the lines.
    axes.set_ylim(low, high + 0.3 * (high - low))
    axes.legend(loc='upper left', ncols=2, borderaxespad=0.2)


def _finish(axes: Axes, steps: FloatArray, title: str) -> None:
    axes.set_xlabel(f'simulation step $n$\n{title}', linespacing=1.1)
    axes.set_xlim(steps[0], steps[-1])
    axes.grid(visible=True)


def thinned(x: FloatArray, y: FloatArray, most: int = MOST_POINTS
            ) -> tuple[FloatArray, FloatArray]:
    """
    Return a thinned line that keeps the least and the greatest value of each interval.

    :param x: (N) rising.
    :param y: (N)
    :return: a line of at most about `most` points; shorter lines are unchanged.
    """
    if len(x) <= most:
        return x, y
    bounds = np.linspace(0, len(y), most // 2 + 1).astype(np.int64)
    kept = np.unique([place for first, end in zip(bounds[:-1], bounds[1:], strict=True)
                      for place in (first + int(np.argmin(y[first:end])),
                                    first + int(np.argmax(y[first:end])))]
                     + [0, len(y) - 1])
    return x[kept], y[kept]
