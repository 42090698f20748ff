# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of frames: panels at one scale (as CRG figures 8, 10, 12)."""

from collections.abc import Sequence

from crgame_ros.analysis.pictures.figure_style import (
    new_figure,
    panel_letter,
    paper_style,
    POINTS,
    WIDTHS,
)
from crgame_ros.analysis.pictures.frame_axes import draw_frame, PLAN_DOT, PLAN_WIDTH, TRACE_WIDTH
from crgame_ros.analysis.pictures.palette import (
    AV_COLOURS,
    HUMAN_COLOURS,
    INK,
    OBJECT_COLOUR,
    PERSON_COLOUR,
    tint,
)
from crgame_ros.analysis.pictures.scene_frame import DOTS_S, FrameScene, SceneFrame, TRACE_S
from crgame_ros.game.objects import Role
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

# Least size of a metre, if the page is wide enough [pt].
LEAST_METRE = 2.6
# Gap between panels, and height of a line of the legend below them [pt].
GAP, LEGEND_LINE = 3.0, 12.0
# Height of a page [inch].
MOST_HEIGHT = 9.0
# Possible lengths of the scale bar [m], and its greatest length [pt].
_BARS, _BAR = (50, 20, 10, 5, 2, 1), 55.0


def frames_figure(scene: FrameScene, ks: Sequence[int], vehicles: Sequence[str] = (),
                  columns: int = 2) -> Figure:
    """
    Draw panels at scenario steps, each with its time since the start of the run.

    :param vehicles: ids of vehicles that are shown and labelled with the driven ones.
    :param columns: number of page columns for the figure, 1 or 2.
    :raises InputError: if the run lacks a step, or has no driven vehicle.
    """
    windows = scene.windows([scene.row(k) for k in ks], vehicles)
    labelled = {item.id for item in scene.log.vehicles} | set(vehicles)
    frames = [scene.at(k, window, labelled) for k, window in zip(ks, windows, strict=True)]
    width = WIDTHS[columns] * POINTS
    length, height = windows[0].length, windows[0].height
    across = _panels_across(len(ks), width, length, height)
    rows = -(-len(ks) // across)
    metre = _metre(across, width, length)
    handles = _handles(scene, frames)
    # A narrow figure has a legend of two lines.
    legend = 3.0 + LEGEND_LINE * -(-len(handles) // (4 * columns))
    total = rows * height * metre + (rows - 1) * GAP + legend
    digits = _digits(scene.log.game.scheduler.time_step_s)
    with paper_style():
        figure = new_figure(columns, total / POINTS)
        figure.set_layout_engine('none')
        for number, frame in enumerate(frames):
            row, column = divmod(number, across)
            axes = figure.add_axes((
                column * (length * metre + GAP) / width,
                (total - (row + 1) * height * metre - row * GAP) / total,
                length * metre / width, height * metre / total))
            draw_frame(axes, frame, metre,
                       f'{panel_letter(number)} {frame.time_s:.{digits}f} s')
        figure.legend(handles=handles, loc='lower left', ncols=4 * columns, borderaxespad=0.1,
                      bbox_to_anchor=(0.0, 0.0), handlelength=1.6, columnspacing=1.2,
                      handletextpad=0.5, borderpad=0.1, labelspacing=0.4)
        _draw_scale(figure, metre, 0.5 * LEGEND_LINE)
    return figure


def _metre(across: int, width: float, length: float) -> float:
    """Return the size of a metre in panels side by side [pt]."""
    return (width - (across - 1) * GAP) / across / length


def _panels_across(count: int, width: float, length: float, height: float) -> int:
    """Return the number of panels side by side: many, but large enough, and on one page."""
    best = max((across for across in range(2, count + 1)
                if _metre(across, width, length) >= LEAST_METRE), default=1)
    while best < count and -(-count // best) * height * width / best / length \
            > MOST_HEIGHT * POINTS - 2.0 * LEGEND_LINE:
        best += 1
    # Balance the rows, so that the last one is as full as possible.
    return -(-count // -(-count // best))


def _handles(scene: FrameScene, frames: Sequence[SceneFrame]) -> list[Patch | Line2D]:
    """Return the legend's entries for colours and lines."""
    roles = {item.role for item in scene.log.vehicles}
    shown = {body.colour for frame in frames for body in frame.bodies if not body.is_driven}
    handles: list[Patch | Line2D] = [
        Patch(facecolor=colour, edgecolor=INK, linewidth=0.5, label=label)
        for colour, label, wanted in (
            (HUMAN_COLOURS[0], 'HV', Role.HUMAN in roles),
            (AV_COLOURS[0], 'AV', Role.AUTONOMOUS in roles),
            (OBJECT_COLOUR, 'others', OBJECT_COLOUR in shown),
            (PERSON_COLOUR, 'on foot, bike', PERSON_COLOUR in shown)) if wanted]
    handles.append(Line2D([], [], color=tint(INK), linewidth=TRACE_WIDTH,
                          label=f'last {TRACE_S:g} s'))
    if any(frame.plans for frame in frames):
        handles.append(Line2D([], [], color=INK, linewidth=PLAN_WIDTH, marker='o',
                              markersize=PLAN_DOT, label=f'plan, dots {DOTS_S:g} s apart'))
    return handles


def _draw_scale(figure: Figure, metre: float, y: float) -> None:
    """Draw the scale bar at a height above the lower edge [pt]."""
    bar = next((each for each in _BARS if each * metre <= _BAR), _BARS[-1])
    width, height = figure.get_size_inches() * POINTS
    right = width - 2.0
    left = right - bar * metre
    for xs, ys in (((left, right), (y, y)), ((left, left), (y - 2, y + 2)),
                   ((right, right), (y - 2, y + 2))):
        figure.add_artist(Line2D([x / width for x in xs], [v / height for v in ys], color=INK,
                                 linewidth=0.8, solid_capstyle='butt'))
    figure.text((left - 4.0) / width, y / height, f'{bar} m', ha='right', va='center',
                fontsize=7.0)


def _digits(step_s: float) -> int:
    """Return the number of decimals that distinguish a scenario's steps."""
    return next((digits for digits in range(1, 4)
                 if abs(step_s * 10**digits - round(step_s * 10**digits)) < 1e-6), 3)


def panel_steps(scene: FrameScene, time_s: float, panels: int, spacing_s: float
                ) -> tuple[int, ...]:
    """Return scenario steps around a time, whose own panel is in the second half."""
    step_s = scene.log.game.scheduler.time_step_s
    stride = max(1, round(spacing_s / step_s))
    first, last = int(scene.log.ks[0]), int(scene.log.ks[-1])
    begin = scene.k_at(time_s) - panels // 2 * stride
    begin = max(first, min(begin, last - (panels - 1) * stride))
    return tuple(k for k in range(begin, begin + panels * stride, stride) if k <= last)
