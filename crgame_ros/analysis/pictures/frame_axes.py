# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A frame of the scene on axes of matplotlib."""

from crgame_ros.analysis.pictures.figure_style import (
    DIVIDER_COLOUR,
    EDGE_COLOUR,
    INK,
    LANE_COLOUR,
    ROAD_COLOUR,
    shade,
    tint,
)
from crgame_ros.analysis.pictures.scene_frame import FrameBody, SceneFrame
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Width of a character, in text heights.
CHARACTER_WIDTH = 0.52
# Gap between a name and its vehicle, and the increase with each attempt, in text heights.
_GAP, _STEP, _ATTEMPTS = 0.35, 0.6, 4
# Above, below, behind, ahead, then across the corners.
_DIRECTIONS = np.array(((0, 1), (0, -1), (-1, 0), (1, 0), (1, 1), (-1, 1), (-1, -1), (1, -1)))


def place_names(frame: SceneFrame, text_height: float,
                taken: tuple[float, float]) -> list[tuple[FrameBody, float, float]]:
    """
    Find places for the names of the labelled vehicles.

    :param text_height: [m]
    :param taken: length and height of the text in the upper left corner [m]
    :return: each vehicle with the middle of its name in the window's coordinates [m].
    """
    half = 0.5 * np.array((frame.window.length, frame.window.height))
    corner = np.array((-half[0], half[1] - taken[1], -half[0] + taken[0], half[1]))
    boxes = [corner, *(np.concatenate((body.corners.min(axis=0), body.corners.max(axis=0)))
                       for body in frame.bodies)]
    # It is better to cover the paths of others than their footprints.
    ways = np.concatenate([np.empty((0, 2)), *(line.points for line in
                                               (*frame.traces, *frame.plans))])
    names = []
    for body in reversed(frame.bodies):
        if not body.is_labelled:
            continue
        size = np.array((CHARACTER_WIDTH * len(body.id), 1.0)) * text_height
        low, high = body.corners.min(axis=0), body.corners.max(axis=0)
        attempts = np.repeat(np.arange(_ATTEMPTS), len(_DIRECTIONS))
        away = 0.5 * (high - low) + 0.5 * size + text_height * (
            _GAP + attempts[:, None] * _STEP)
        middles = np.clip(0.5 * (low + high) + np.tile(_DIRECTIONS, (_ATTEMPTS, 1)) * away,
                          -half + 0.7 * size, half - 0.7 * size)
        tried = np.concatenate((middles - 0.5 * size, middles + 0.5 * size), axis=1)
        cost = (10.0 * _overlaps(tried, np.array(boxes)) / size.prod()
                + 0.02 * _counts(tried, ways) + 0.1 * attempts)
        best = middles[int(np.argmin(cost))]
        boxes.append(np.concatenate((best - 0.5 * size, best + 0.5 * size)))
        names.append((body, float(best[0]), float(best[1])))
    return names


def _overlaps(tried: FloatArray, others: FloatArray) -> FloatArray:
    """Return the area that each box (T, 4) shares with all others (B, 4) [m^2]."""
    sides = (np.minimum(tried[:, None, 2:], others[None, :, 2:])
             - np.maximum(tried[:, None, :2], others[None, :, :2]))
    return np.asarray(np.maximum(sides, 0.0).prod(axis=2).sum(axis=1))


def _counts(tried: FloatArray, points: FloatArray) -> FloatArray:
    """Count the points (N, 2) in each box (T, 4)."""
    inside = (points > tried[:, None, :2]) & (points < tried[:, None, 2:])
    return np.asarray(inside.all(axis=2).sum(axis=1), dtype=np.float64)


# Font sizes of vehicles' names, and of the remark in the corner [pt].
NAME_SIZE, CORNER_SIZE = 6.5, 7.5
DASHES = (0, (4, 4))
# Style of traces behind vehicles; those of AVs are on top and dashed, so that both are visible.
TRACE_WIDTH, TRACE_DASHES = 1.1, (0, (4, 1.5))
PLAN_WIDTH, PLAN_DOT = 0.6, 2.4


def draw_frame(axes: Axes, frame: SceneFrame, metre: float, corner: str) -> None:
    """
    Draw a frame; the data coordinates are the window's own [m].

    :param axes: axes with the window's proportions; their ticks are removed.
    :param metre: size of a metre in the picture [pt]
    :param corner: text in the upper left corner.
    """
    window = frame.window
    axes.set_xlim(-0.5 * window.length, 0.5 * window.length)
    axes.set_ylim(-0.5 * window.height, 0.5 * window.height)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color(EDGE_COLOUR)
    _draw_road(axes, frame)
    for line in frame.traces:
        axes.plot(*line.points.T, color=tint(line.colour), linewidth=TRACE_WIDTH, zorder=3,
                  linestyle=TRACE_DASHES if line.is_av else 'solid', dash_capstyle='butt',
                  solid_capstyle='butt', gid=f'trace {line.id}')
    for line in frame.plans:
        axes.plot(*line.points.T, color=line.colour, linewidth=PLAN_WIDTH, marker='o',
                  markersize=PLAN_DOT, markeredgewidth=0.0, markevery=line.dots, zorder=3.5,
                  gid=f'plan {line.id}')
    for number, body in enumerate(frame.bodies):
        # Each body is below the next one, including its front mark.
        zorder = 4.0 + number / len(frame.bodies)
        axes.add_patch(Polygon(
            body.corners, facecolor=body.colour, edgecolor=INK, zorder=zorder,
            linewidth=0.5 if body.is_driven else 0.3, joinstyle='miter', gid=f'body {body.id}'))
        if body.front is not None:
            axes.add_patch(Polygon(body.front, facecolor='white', linewidth=0.0, zorder=zorder,
                                   gid=f'front {body.id}'))
    halo = [withStroke(linewidth=1.6, foreground='white')]
    taken = (CORNER_SIZE * (CHARACTER_WIDTH * len(corner) + 1.0) / metre,
             1.5 * CORNER_SIZE / metre)
    for body, x, y in place_names(frame, NAME_SIZE / metre, taken):
        axes.text(x, y, body.id, color=shade(body.colour), fontsize=NAME_SIZE, ha='center',
                  va='center_baseline', zorder=7, path_effects=halo, gid=f'name {body.id}')
    axes.annotate(corner, (0.0, 1.0), (1.7, -1.7), xycoords='axes fraction',
                  textcoords='offset points', ha='left', va='top', fontsize=CORNER_SIZE,
                  color=INK, zorder=8,
                  bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 1.2})


def _draw_road(axes: Axes, frame: SceneFrame) -> None:
    for rings in frame.road.surfaces:
        path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
        axes.add_patch(PathPatch(path, facecolor=ROAD_COLOUR, linewidth=0.0, zorder=1))
    for lines, colour, width, dashes in (
            (frame.road.bounds, LANE_COLOUR, 0.5, 'solid'),
            (frame.road.dashed, DIVIDER_COLOUR, 0.5, DASHES),
            (frame.road.solid, DIVIDER_COLOUR, 0.5, 'solid'),
            (frame.road.edges, EDGE_COLOUR, 0.7, 'solid')):
        if lines:
            axes.add_collection(LineCollection(lines, colors=colour, linewidths=width,
                                               linestyles=dashes, zorder=2), autolim=False)
