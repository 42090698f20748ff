# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The outline of a shape: its corners, around its centre and placed in the map."""

import math
from typing import TypeAlias

from commonroad_dc import pycrcc
from crgame_ros.errors import InputError
from crgame_ros.geometry.reference_point import joined, seen_from
from crgame_ros.geometry.shape import Shape
import numpy as np
from numpy.typing import NDArray
import shapely

# Corners of the polygon that stands for a circle in tests of containment; it lies outside the
# circle by less than 0.2 % of the radius.
CIRCLE_CORNERS = 64
Primitive: TypeAlias = pycrcc.RectOBB | pycrcc.Circle | pycrcc.Triangle
FloatArray = NDArray[np.float64]


def outline(shape: Shape, circle_corners: int = CIRCLE_CORNERS,
            encloses: bool = True) -> NDArray[np.float64]:
    """
    Return the corners (C, 2) of a shape around its centre, in order [m].

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
    return joined(poses[..., 0, None] + cos * x - sin * y, poses[..., 1, None] + sin * x + cos * y)


def placed_at(corners: NDArray[np.float64], x: float, y: float, yaw: float) -> NDArray[np.float64]:
    """Place corners (C, 2) at one pose of their centre: `placed` in a third of its time."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.asarray(corners @ np.array(((cos, sin), (-sin, cos))) + (x, y))


def half_extents(lengths: NDArray[np.float64], widths: NDArray[np.float64],
                 turn: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """
    Return the half extents of rectangles along and across a direction, arrays of one shape [m].

    :param turn: from that direction to the rectangles' own [rad]
    """
    cos, sin = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    return 0.5 * (lengths * cos + widths * sin), 0.5 * (lengths * sin + widths * cos)


def placed_polygon(shape: Shape, x: float, y: float, yaw: float) -> shapely.Polygon:
    """Place a shape as a polygon; a circle becomes one that encloses it."""
    return shapely.Polygon(placed_at(outline(shape), x, y, yaw))


class Footprint:
    """
    A shape prepared to be placed at many poses.

    :raises InputError: if a polygon has no area.
    """

    def __init__(self, shape: Shape) -> None:
        self.shape = shape
        self.radius = shape.radius
        self._half_length = 0.5 * shape.length
        self._half_width = 0.5 * shape.width
        self._kind = shape.kind
        self._triangles = _triangulate(shape) if shape.kind == 'polygon' else []
        self._outline = outline(shape)

    def at(self, x: float, y: float, yaw: float) -> list[Primitive]:
        """
        Place the shape as collision objects; the shape is hit if any of them is.

        :param x: centre [m]
        :param y: centre [m]
        :param yaw: [rad]
        :return: one rectangle or circle, or the triangles of a polygon.
        """
        if self._kind == 'rectangle':
            return [pycrcc.RectOBB(self._half_length, self._half_width, yaw, x, y)]
        if self._kind == 'circle':
            return [pycrcc.Circle(self._half_length, x, y)]
        cos, sin = math.cos(yaw), math.sin(yaw)
        return [pycrcc.Triangle(x + cos * ax - sin * ay, y + sin * ax + cos * ay,
                                x + cos * bx - sin * by, y + sin * bx + cos * by,
                                x + cos * cx - sin * cy, y + sin * cx + cos * cy)
                for ax, ay, bx, by, cx, cy in self._triangles]

    def polygon(self, x: float, y: float, yaw: float) -> shapely.Polygon:
        """Place the shape as a polygon; a circle becomes one that encloses it."""
        return shapely.Polygon(placed_at(self._outline, x, y, yaw))

    def outlines(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """
        Place the shape's outline many times.

        :param poses: (S, 3) x [m], y [m] and yaw [rad] of its centre
        :return: (S, C, 2) corners [m]
        """
        return placed(self._outline, poses)


def triangle_corners(polygons: shapely.Geometry | NDArray[np.object_]) -> NDArray[np.float64]:
    """
    Cut polygons into triangles that cover exactly the same area.

    :param polygons: one valid geometry, or an array of them.
    :return: (n, 3, 2) corners of the triangles.
    """
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygons))
    # The ring of a triangle is closed: it repeats the first corner.
    return shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]


def _triangulate(shape: Shape) -> list[list[float]]:
    polygon = shapely.make_valid(shapely.Polygon(shape.vertices)) \
        if len(shape.vertices) > 2 else shapely.Polygon()
    if polygon.area == 0.0:
        raise InputError(f'a polygon of {len(shape.vertices)} corners has no area', 'shape',
                         'give at least three corners that are not in one line')
    return triangle_corners(polygon).reshape(-1, 6).tolist()


def touches(rectangle: Shape, poses: FloatArray, other: Shape,
            other_poses: FloatArray) -> NDArray[np.bool_]:
    """
    Return at which poses a rectangle touches or overlaps another shape.

    Rectangles and circles are exact; the convex hull stands for a polygon. All is computed
    relative to the rectangle, so that large coordinates do no harm.

    :param poses: (..., 3) x [m], y [m] and yaw [rad] of the rectangle's centre
    :param other_poses: (..., 3) of the other's centre, of a shape that broadcasts with the
        first; NaN: it is absent and touches nothing.
    :return: (...)
    """
    half_length, half_width = 0.5 * rectangle.length, 0.5 * rectangle.width
    along, across = seen_from(poses, other_poses[..., :2])
    if other.kind == 'circle':
        beyond = np.hypot(np.maximum(np.abs(along) - half_length, 0.0),
                          np.maximum(np.abs(across) - half_width, 0.0))
        return np.asarray(beyond <= 0.5 * other.length)
    hull = _hull(other)
    turn = other_poses[..., 2] - poses[..., 2]
    corners = placed(hull, joined(along, across, turn))
    x, y = corners[..., 0], corners[..., 1]
    # Written so that NaN touches nothing.
    found = (x.min(axis=-1) <= half_length) & (x.max(axis=-1) >= -half_length) \
        & (y.min(axis=-1) <= half_width) & (y.max(axis=-1) >= -half_width)
    # The hull's own axes: how far it reaches along the normals of its edges does not depend on
    # the pose.
    edges = np.roll(hull, -1, axis=0) - hull
    normals = np.column_stack((edges[:, 1], -edges[:, 0])) / np.hypot(*edges.T)[:, None]
    reach = hull @ normals.T
    cos, sin = np.cos(turn), np.sin(turn)
    for (normal_x, normal_y), low, high in zip(normals.tolist(), reach.min(axis=0).tolist(),
                                               reach.max(axis=0).tolist(), strict=True):
        axis_x, axis_y = cos * normal_x - sin * normal_y, sin * normal_x + cos * normal_y
        middle = along * axis_x + across * axis_y
        half = half_length * np.abs(axis_x) + half_width * np.abs(axis_y)
        found &= (middle + low <= half) & (middle + high >= -half)
    return np.asarray(found)


def _hull(shape: Shape) -> FloatArray:
    corners = outline(shape)
    if shape.kind == 'rectangle':
        return corners
    hull = shapely.convex_hull(shapely.multipoints(corners))
    return np.asarray(shapely.get_coordinates(hull)[:-1])
