# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A frame of the scene as plain SVG, small enough for many in one page."""

from collections.abc import Iterable
import math
from xml.sax.saxutils import escape

from crgame_ros.analysis.pictures.frame_names import place_names
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
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Font sizes of vehicles' names, and of the time in the corner [px].
NAME_SIZE, TIME_SIZE = 11.0, 13.0


def frame_svg(frame: SceneFrame, width: int = 480) -> str:
    """
    Return a frame as an element `svg`, which needs no style sheet and no script.

    :param frame: frame from `FrameScene.at`.
    :param width: width of the picture [px]
    :return: text without a line break; names in it are escaped.
    """
    window = frame.window
    scale = width / window.length
    paper = _Paper(width, window.height * scale, scale)
    paper.fill(frame.road.surfaces, ROAD_COLOUR)
    for lines, style in (
            (frame.road.bounds, f'stroke="{LANE_COLOUR}"'),
            (frame.road.dashed, f'stroke="{DIVIDER_COLOUR}" stroke-dasharray="5"'),
            (frame.road.solid, f'stroke="{DIVIDER_COLOUR}"'),
            (frame.road.edges, f'stroke="{EDGE_COLOUR}" stroke-width="1.5"')):
        paper.stroke(lines, style)
    for line in frame.traces:
        dashes = ' stroke-dasharray="6 3"' if line.is_av else ''
        paper.stroke((line.points,), f'stroke="{tint(line.colour)}" stroke-width="2"{dashes}')
    for line in frame.plans:
        paper.stroke((line.points,), f'stroke="{line.colour}"')
        # Lines of no length with round ends are dots.
        paper.dots(line.points[::line.dots], line.colour)
    for body in frame.bodies:
        paper.fill(((body.corners,),), body.colour, f' stroke="{INK}"')
        if body.front is not None:
            paper.fill(((body.front,),), '#fff')
    corner = f'{frame.time_s:.2f} s'
    taken = 0.6 * TIME_SIZE * len(corner) / scale, 1.5 * TIME_SIZE / scale
    for body, x, y in place_names(frame, NAME_SIZE / scale, taken):
        left, top = paper.place(x, y)
        paper.write(body.id, left, top + 0.35 * NAME_SIZE, NAME_SIZE, shade(body.colour), 'middle')
    paper.write(corner, 5.0, 1.2 * TIME_SIZE, TIME_SIZE, INK, 'start')
    return paper.text()


class _Paper:
    """A drawing in metres, written as SVG in pixels."""

    def __init__(self, width: float, height: float, scale: float) -> None:
        self._size = width, math.ceil(height)
        self._scale = scale
        self._parts: list[str] = []

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Return the pixel coordinates of a place in the window."""
        return (0.5 * self._size[0] + x * self._scale, 0.5 * self._size[1] - y * self._scale)

    def fill(self, areas: Iterable[Iterable[FloatArray]], colour: str, more: str = '') -> None:
        """Fill areas, each given by its rings."""
        path = ''.join(f'{self._path(ring)}z' for rings in areas for ring in rings)
        if path:
            self._parts.append(f'<path d="{path}" fill="{colour}" fill-rule="evenodd"{more}/>')

    def stroke(self, lines: Iterable[FloatArray], style: str) -> None:
        """Draw lines."""
        path = ''.join(map(self._path, lines))
        if path:
            self._parts.append(f'<path d="{path}" fill="none" {style}/>')

    def dots(self, points: FloatArray, colour: str) -> None:
        """Draw dots."""
        path = ''.join(f'{self._path(point[None])}h0' for point in points)
        self._parts.append(f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="3.5" '
                           'stroke-linecap="round"/>')

    def write(self, text: str, x: float, y: float, size: float, colour: str, anchor: str) -> None:
        """Draw text with a white outline."""
        self._parts.append(
            f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" text-anchor="{anchor}" '
            f'fill="{colour}" stroke="#fff" stroke-width="3" paint-order="stroke" '
            f'stroke-linejoin="round">{escape(text)}</text>')

    def text(self) -> str:
        """Return the SVG elements drawn."""
        width, height = self._size
        return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
                f'width="{width}" height="{height}" font-family="sans-serif" '
                'style="background:#fff">' + ''.join(self._parts) + '</svg>')

    def _path(self, points: FloatArray) -> str:
        places = (self.place(x, y) for x, y in points.tolist())
        return 'M' + 'L'.join(f'{x:.1f} {y:.1f}' for x, y in places)
