# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The outline of a shape: its corners, around its centre and placed in the map."""

import math

from crgame_ros.geometry.reference_point import joined
from crgame_ros.geometry.shape import Shape
import numpy as np
from numpy.typing import NDArray
import shapely

# Corners of the polygon that stands for a circle in tests of containment; it lies outside the
# circle by less than 0.2 % of the radius.
CIRCLE_CORNERS = 64


def outline(shape: Shape, circle_corners: int = CIRCLE_CORNERS,
            encloses: bool = True) -> NDArray[np.float64]:
    """
    Return the corners (C, 2) of a shape around its centre, in turn [m].

    :param circle_corners: of the polygon that stands for a circle.
    :param encloses: whether that polygon lies around the circle, or its corners on it.
    """
    if shape.kind == 'polygon':
        return np.array(shape.vertices, dtype=np.float64)
    half_length, half_width = 0.5 * shape.length, 0.5 * shape.width
    if shape.kind == 'rectangle':
        return np.array(((half_length, half_width), (-half_length, half_width),
                         (-half_length, -half_width), (half_length, -half_width)))
    angles = np.arange(circle_corners) * (2.0 * math.pi / circle_corners)
    radius = half_length / math.cos(math.pi / circle_corners) if encloses else half_length
    return radius * np.column_stack((np.cos(angles), np.sin(angles)))


def placed(corners: NDArray[np.float64], poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Place corners in the map.

    :param corners: (..., C, 2) around a centre [m]
    :param poses: (..., 3) x [m], y [m] and yaw [rad] of the centre
    :return: (..., C, 2) [m]
    """
    yaw = poses[..., 2, None]
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y = corners[..., 0], corners[..., 1]
    return joined(poses[..., 0, None] + cos * x - sin * y,
                  poses[..., 1, None] + sin * x + cos * y)


def placed_at(corners: NDArray[np.float64], x: float, y: float,
              yaw: float) -> NDArray[np.float64]:
    """Place corners (C, 2) at one pose of their centre: `placed` in a third of its time."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.asarray(corners @ np.array(((cos, sin), (-sin, cos))) + (x, y))


def half_extents(lengths: NDArray[np.float64], widths: NDArray[np.float64],
                 turn: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """
    Return half of what rectangles extend along and across a direction, each of the same shape [m].

    :param turn: from that direction to the rectangles' own [rad]
    """
    cos, sin = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    return 0.5 * (lengths * cos + widths * sin), 0.5 * (lengths * sin + widths * cos)


def placed_polygon(shape: Shape, x: float, y: float, yaw: float) -> shapely.Polygon:
    """Place a shape as a polygon; a circle becomes one that encloses it."""
    return shapely.Polygon(placed_at(outline(shape), x, y, yaw))
