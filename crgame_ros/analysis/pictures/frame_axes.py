# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A frame of the scene on axes of matplotlib."""

from crgame_ros.analysis.pictures.frame_names import CHARACTER_WIDTH, place_names
from crgame_ros.analysis.pictures.palette import (
    DIVIDER_COLOUR,
    EDGE_COLOUR,
    INK,
    LANE_COLOUR,
    ROAD_COLOUR,
    shade,
    tint,
)
from crgame_ros.analysis.pictures.scene_frame import SceneFrame
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

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
