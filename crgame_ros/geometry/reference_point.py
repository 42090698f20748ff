# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Points ahead of a pose and beside it: from a vehicle's rear axle to its centre, and back."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def ahead(x: float, y: float, yaw: float, distance: float) -> tuple[float, float]:
    """
    Return the point at a distance ahead of a pose.

    :param distance: negative is behind it [m]
    :return: its x and y [m]
    """
    return x + distance * math.cos(yaw), y + distance * math.sin(yaw)


def joined(*parts: Array) -> Array:
    """
    Return arrays as columns (..., n), in half of the time of `numpy.stack`.

    :param parts: arrays of the first one's shape (...), or scalars for all of it.
    """
    result = np.empty((*parts[0].shape, len(parts)))
    for column, part in enumerate(parts):
        result[..., column] = part
    return result


def zero_for_nan(values: Array) -> Array:
    """Return values as `numpy.nan_to_num` does, in a tenth of its time if all are finite."""
    return values if np.isfinite(values).all() else np.nan_to_num(values)


def shifted(poses: Array, distance: Array | float) -> Array:
    """
    Move poses along their headings.

    :param poses: (..., 3) x [m], y [m] and yaw [rad]
    :param distance: (...) forward [m]
    :return: (..., 3), the yaw unchanged
    """
    yaw = poses[..., 2]
    return joined(poses[..., 0] + distance * np.cos(yaw),
                  poses[..., 1] + distance * np.sin(yaw), yaw)


def beside(poses: Array, d: Array) -> Array:
    """
    Move poses to their left.

    :param poses: (..., 3 or more) x [m], y [m], yaw [rad]
    :param d: (...) offsets [m]
    :return: (..., 3), the yaw unchanged
    """
    yaw = poses[..., 2]
    return joined(poses[..., 0] - d * np.sin(yaw), poses[..., 1] + d * np.cos(yaw), yaw)


def seen_from(poses: Array, points: Array) -> tuple[Array, Array]:
    """
    Return the distances of points ahead of poses and to their left.

    :param poses: (..., 3 or more) x [m], y [m], yaw [rad]
    :param points: (..., 2) [m]
    :return: both (...) [m]
    """
    dx, dy = points[..., 0] - poses[..., 0], points[..., 1] - poses[..., 1]
    cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    return dx * cos + dy * sin, dy * cos - dx * sin


def shifted_velocities(yaw: Array, velocities: Array, distance: Array | float) -> Array:
    """
    Return the velocities of points ahead of others on the same rigid bodies.

    :param yaw: (...) [rad]
    :param velocities: (..., 3) [m/s, m/s, rad/s]
    :param distance: (...) forward [m]
    :return: (..., 3)
    """
    rate = velocities[..., 2]
    return joined(velocities[..., 0] - distance * np.sin(yaw) * rate,
                  velocities[..., 1] + distance * np.cos(yaw) * rate, rate)
