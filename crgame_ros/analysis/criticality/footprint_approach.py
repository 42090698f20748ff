# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Computes when two moving convex footprints touch, and how far apart they are.

There is a form for arrays of footprints, and one with plain numbers for a single pair, which gives
the same bits: for small arrays numpy's calls take longer than the computation.
"""

import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Corners = list[list[float]]


def time_to_contact(first: FloatArray, second: FloatArray, velocity: FloatArray,
                    second_velocity: FloatArray) -> FloatArray:
    """
    Return the time until footprints touch that keep velocity and yaw (ttc_2d), in any direction.

    Closed form by separating axes: along the normal of each edge, the projections of both overlap
    during one interval of time; the footprints touch while all intervals overlap.

    :param first: (..., C, 2) corners of convex footprints in turn [m]; footprints with fewer
        corners repeat one
    :param second: (..., D, 2) corners of the others.
    :param velocity: (..., 2) velocities of the first [m/s]
    :param second_velocity: (..., 2) velocities of the second [m/s]
    :return: (...) time [s]; 0 where they touch now, inf where they never will.
    """
    relative = second_velocity - velocity
    x, y = _both(first, second, relative.shape[:-1])
    edge_x, edge_y = _edges(x), _edges(y)
    # The edge turned by a right angle is its normal, of any length. Axes of the arrays: footprint
    # of the corners, footprint of the edges, (...), edge, corner.
    along = edge_x[None, ..., None] * y[:, None, ..., None, :] \
        - edge_y[None, ..., None] * x[:, None, ..., None, :]
    low, high = along.min(axis=-1), along.max(axis=-1)
    speed = edge_x * relative[..., 1, None] - edge_y * relative[..., 0, None]
    with np.errstate(divide='ignore', invalid='ignore'):
        begin, end = (low[0] - high[1]) / speed, (high[0] - low[1]) / speed
    resting = speed == 0.0
    never = np.where((low[0] > high[1]) | (low[1] > high[0]), np.inf, -np.inf)
    entered = np.where(resting, never, np.minimum(begin, end)).max(axis=(0, -1))
    left = np.where(resting, -never, np.maximum(begin, end)).min(axis=(0, -1))
    touching = (entered <= left) & (left >= 0.0)
    return np.where(touching, np.maximum(entered, 0.0), np.inf)


def distance(first: FloatArray, second: FloatArray,
             touching: NDArray[np.bool_] | None = None) -> FloatArray:
    """
    Return the smallest distance of convex footprints (min_distance) [m].

    :param first: (..., C, 2) corners in turn [m]; footprints with fewer corners repeat one
    :param second: (..., D, 2) corners of the others.
    :param touching: (...) whether they touch now, where that is known.
    :return: (...) 0 where they overlap.
    """
    x, y = _both(first, second)
    edge_x, edge_y = (_edges(each)[::-1, ..., None, :] for each in (x, y))
    # From the starts of one's edges to the corners of the other.
    offset_x, offset_y = (each[..., :, None] - each[::-1, ..., None, :] for each in (x, y))
    lengths = edge_x * edge_x + edge_y * edge_y
    along = offset_x * edge_x + offset_y * edge_y
    share = np.divide(along, lengths, out=np.zeros_like(along),
                      where=np.broadcast_to(lengths > 0.0, along.shape))
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    rest_x, rest_y = offset_x - share * edge_x, offset_y - share * edge_y
    square = (rest_x * rest_x + rest_y * rest_y).min(axis=(0, -1, -2))
    if touching is None:
        still = np.zeros(2)
        touching = time_to_contact(first, second, still, still) == 0.0
    return np.where(touching, 0.0, np.sqrt(square))


def approach(first: Corners, second: Corners, relative: list[float]) -> tuple[float, float]:
    """
    Return `time_to_contact` and `distance` of two footprints.

    :param first: (C, 2) corners in turn [m]
    :param second: (D, 2) corners of the other.
    :param relative: (2) velocity of the other minus that of the first [m/s]
    """
    entered, left = -math.inf, math.inf
    for polygon in (first, second):
        for (x, y), (next_x, next_y) in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
            edge_x, edge_y = next_x - x, next_y - y
            own = [edge_x * y - edge_y * x for x, y in first]
            other = [edge_x * y - edge_y * x for x, y in second]
            own_low, own_high, low, high = min(own), max(own), min(other), max(other)
            speed = edge_x * relative[1] - edge_y * relative[0]
            if speed == 0.0:
                if own_low > high or low > own_high:
                    entered, left = math.inf, -math.inf
                continue
            begin, end = (own_low - high) / speed, (own_high - low) / speed
            entered = max(entered, min(begin, end))
            left = min(left, max(begin, end))
    time_s = max(entered, 0.0) if entered <= left and left >= 0.0 else math.inf
    return time_s, 0.0 if time_s == 0.0 else math.sqrt(
        min(_least_square(first, second), _least_square(second, first)))


def _least_square(corners: Corners, polygon: Corners) -> float:
    """Return the smallest squared distance from any corner to any edge [m^2]."""
    least = math.inf
    for (x, y), (next_x, next_y) in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
        edge_x, edge_y = next_x - x, next_y - y
        length = edge_x * edge_x + edge_y * edge_y
        for corner_x, corner_y in corners:
            rest_x, rest_y = corner_x - x, corner_y - y
            share = (rest_x * edge_x + rest_y * edge_y) / length if length > 0.0 else 0.0
            if share > 0.0:
                share = share if share < 1.0 else 1.0
                rest_x, rest_y = rest_x - share * edge_x, rest_y - share * edge_y
            least = min(least, rest_x * rest_x + rest_y * rest_y)
    return least


def _both(first: FloatArray, second: FloatArray,
          shape: tuple[int, ...] = ()) -> tuple[FloatArray, FloatArray]:
    """Return x and y of both in one array (2, ..., C); a shorter one repeats its last corner."""
    shape = np.broadcast_shapes(first.shape[:-2], second.shape[:-2], shape)
    result = np.empty((2, 2, *shape, max(first.shape[-2], second.shape[-2])))
    for row, corners in enumerate((first, second)):
        count = corners.shape[-2]
        result[0, row, ..., :count], result[1, row, ..., :count] = corners[..., 0], corners[..., 1]
        result[:, row, ..., count:] = result[:, row, ..., count - 1, None]
    return result[0], result[1]


def _edges(values: FloatArray) -> FloatArray:
    """Return the vectors from each corner to the next, and from the last to the first."""
    edges = np.empty_like(values)
    np.subtract(values[..., 1:], values[..., :-1], out=edges[..., :-1])
    np.subtract(values[..., 0], values[..., -1], out=edges[..., -1])
    return edges
