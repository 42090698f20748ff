# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds at which of many poses a rectangle touches another shape, by separating axes."""

from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.reference_point import joined, seen_from
from crgame_ros.geometry.shape import Shape
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]


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
