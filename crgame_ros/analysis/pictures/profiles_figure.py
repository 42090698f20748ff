# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Profiles of the driven vehicles over a run (as CRG figures 9, 11 and 13)."""

from collections.abc import Sequence
from typing import Any

from crgame_ros.analysis.pictures.critical_moments import Moment
from crgame_ros.analysis.pictures.figure_style import new_figure, panel_letter, paper_style
from crgame_ros.analysis.pictures.palette import INK, vehicle_styles, VehicleStyle
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.vehicle.state import StateColumn
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Profiles over time, by name: column, label.
OVER_TIME = {
    'heading': (StateColumn.YAW, 'heading angle [rad]'),
    'velocity': (StateColumn.SPEED, 'velocity [m/s]'),
    'acceleration': (StateColumn.ACCELERATION, 'acceleration [m/s$^2$]'),
    'steering': (StateColumn.STEERING_ANGLE, 'steering angle [rad]'),
}
POSITION = 'position'
# The profiles of the papers, and all profiles.
USUAL_PROFILES = ('heading', POSITION, 'velocity')
ALL_PROFILES = (*USUAL_PROFILES, 'acceleration', 'steering')
# Heights of a panel that is beside others, of one above others, and of the legend [inch].
_BESIDE, _ABOVE, _NAMES = 1.7, 1.4, 0.2
# A path with a greater ratio of length to width is not drawn to scale: it would look like a line.
_TO_SCALE = 3.0
_MOMENT_LINE: dict[str, Any] = {'color': INK, 'linewidth': 0.5, 'linestyle': (0, (5, 3))}
# Number of markers on a line.
_MARKS = 8


def profiles_figure(record: RunRecord, moments: Sequence[Moment] = (),
                    profiles: Sequence[str] = USUAL_PROFILES, columns: int = 2) -> Figure:
    """
    Draw profiles of every driven vehicle's rear axle, as in the log.

    Events that took effect are dotted lines with their names, moments dashed ones.

    :param profiles: names from `ALL_PROFILES`.
    :param columns: number of page columns for the figure, 1 or 2.
    """
    log = record.log
    styles = vehicle_styles(log.vehicles)
    across = min(3, len(profiles)) if columns == 2 else 1
    down = -(-len(profiles) // across)
    with paper_style():
        figure = new_figure(columns, _NAMES + down * (_BESIDE if across > 1 else _ABOVE))
        grid = figure.add_gridspec(down, across)
        for number, profile in enumerate(profiles):
            axes = figure.add_subplot(grid[divmod(number, across)])
            letter = panel_letter(number)
            if profile == POSITION:
                _draw_positions(axes, record, styles)
                axes.set_xlabel(f'x [m]\n{letter}', linespacing=1.1)
            else:
                draw_over_time(axes, record, styles, *OVER_TIME[profile])
                mark_times(axes, record, moments)
                axes.set_xlabel(f'time [s]\n{letter}', linespacing=1.1)
            axes.grid(visible=True)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        if moments:
            handles.append(Line2D([], [], **_MOMENT_LINE))
            labels.append('critical moment')
        figure.legend(handles, labels, loc='outside upper center', borderaxespad=0.0,
                      ncols=min(4 * columns, len(labels)), columnspacing=1.4)
    return figure


def draw_over_time(axes: Axes, record: RunRecord, styles: dict[str, VehicleStyle],
                   column: StateColumn, label: str) -> None:
    """Draw a column of the states of all driven vehicles over time; headings go beyond pi."""
    times_s, values = record.log.times_s, record.log.vehicle_states[:, :, column]
    if column is StateColumn.YAW:
        values = np.unwrap(values, axis=0)
    for i, item in enumerate(record.log.vehicles):
        draw_line(axes, times_s, values[:, i], item.id, styles, i)
    axes.set_ylabel(label)
    axes.set_xlim(times_s[0], times_s[-1])
    # The least range of the axis hides rounding noise.
    _widen(axes, 0.1 if column is StateColumn.YAW else 0.02)


def _widen(axes: Axes, least: float) -> None:
    """Widen the range of the vertical axis, if it is below the least one."""
    low, high = axes.get_ylim()
    if high - low < least:
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.5 * least, middle + 0.5 * least)


def _draw_positions(axes: Axes, record: RunRecord, styles: dict[str, VehicleStyle]) -> None:
    states = record.log.vehicle_states
    for i, item in enumerate(record.log.vehicles):
        x, y = states[:, i, StateColumn.X], states[:, i, StateColumn.Y]
        draw_line(axes, x, y, item.id, styles, i)
        # Mark the start of the path.
        axes.plot(x[:1], y[:1], color=styles[item.id].colour, marker='o', markersize=5.0,
                  markerfacecolor='white', linestyle='none', zorder=4)
    axes.set_ylabel('y [m]')
    extent = np.ptp(states[:, :, :2].reshape(-1, 2), axis=0)
    if max(extent) < _TO_SCALE * max(min(extent), 1.0):
        axes.margins(0.08)
        axes.set_aspect('equal', adjustable='datalim')
    else:
        _widen(axes, 4.0)
    axes.xaxis.set_major_locator(MaxNLocator(4))


def draw_line(axes: Axes, x: FloatArray, y: FloatArray, name: str,
              styles: dict[str, VehicleStyle], number: int) -> None:
    """Draw a line of a driven vehicle in its style, with markers apart from those of others."""
    style = styles[name]
    stride = max(1, len(x) // _MARKS)
    axes.plot(x, y, color=style.colour, linestyle=style.dashes, marker=style.marker,
              markevery=(number * stride // 3 % stride, stride), markeredgewidth=0.4,
              markeredgecolor='white', label=name, zorder=3)


def mark_times(axes: Axes, record: RunRecord, moments: Sequence[Moment]) -> None:
    """Mark the times of events that took effect, and of moments, in a profile over time."""
    dt_s = record.log.game.scheduler.dt_s
    for moment in moments:
        axes.axvline(moment.time_s, zorder=1, gid='moment', **_MOMENT_LINE)
    for event in record.fired:
        time_s = event.n * dt_s
        axes.axvline(time_s, color=INK, linewidth=0.6, linestyle=(0, (1, 1.5)), zorder=1,
                     gid='event')
        axes.annotate(event.name, (time_s, 1.0), (1.5, -2.0), rotation=90, fontsize=5.5,
                      xycoords=('data', 'axes fraction'), textcoords='offset points', ha='left',
                      va='top', color=INK, zorder=4)
