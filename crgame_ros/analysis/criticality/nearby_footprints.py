# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Footprints near a vehicle: how far apart two are, and when they touch.

There is a form for arrays of footprints, and one with plain numbers for a single pair, which gives
the same bits: for small arrays numpy's calls take longer than the computation.
"""

from collections.abc import Sequence
import math
from typing import NamedTuple

from crgame_ros.game.objects import ObjectDescription
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.rigid_transform import RigidTransform
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]
Numbers = NDArray[np.int64]

NEAR = 100.0
CIRCLE_CORNERS = 32
# Pairs with no more corners than this in total are measured one by one.
FEW_CORNERS = 16
Corners = list[list[float]]


class Scene(NamedTuple):
    """
    The scene at a tick: N vehicles and objects, driven vehicles first.

    :param poses: (N, 3) poses of the centres.
    :param rates: (N, 3) derivatives of the poses.
    :param accelerations: (N, 2)
    :param outlines: (N, C, 2) corners of the footprints; a shorter one repeats its last corner.
    """

    poses: FloatArray
    rates: FloatArray
    accelerations: FloatArray
    outlines: FloatArray


class NearbyFootprints:
    """
    The convex hulls of all footprints in a run.

    :param everybody: (N) driven vehicles, then all others.
    :ivar radii: (N) radii of circles around the centres that contain the footprints [m]
    """

    def __init__(self, everybody: Sequence[ObjectDescription]) -> None:
        outlines = [_convex(outline(item.shape, CIRCLE_CORNERS)) for item in everybody]
        self.radii = np.array([np.hypot(*corners.T).max() for corners in outlines])
        # All in one padded array, and groups by number of corners, to compute no more than needed.
        self._most = max(map(len, outlines), default=1)
        self._outlines = np.array([
            np.concatenate((corners, np.repeat(corners[-1:], self._most - len(corners), axis=0)))
            for corners in outlines]).reshape(-1, self._most, 2)
        self._corners = np.array([len(corners) for corners in outlines], dtype=np.int64)

    def scene(self, poses: FloatArray, rates: FloatArray, accelerations: FloatArray) -> Scene:
        """Return the scene; parameters as for `Scene`."""
        return Scene(poses, rates, accelerations, placed(self._outlines, poses))

    def on_road(self, scene: Scene, transform: RigidTransform) -> Scene:
        """Return a scene in the coordinates of a vehicle's road."""
        if transform.is_identity:
            return scene
        moves = transform.turn_to_scenario(scene.rates[:, :2])
        return self.scene(transform.to_scenario(scene.poses),
                          np.column_stack((moves, scene.rates[:, 2])),
                          transform.turn_to_scenario(scene.accelerations))

    def near(self, subject: int, scene: Scene) -> Numbers:
        """Return the numbers of those near a vehicle."""
        x, y = (scene.poses[:, :2] - scene.poses[subject, :2]).T
        away = np.hypot(x, y)
        away[subject] = np.nan
        return np.flatnonzero(away - self.radii - self.radii[subject] < NEAR)

    def approach(self, subjects: Sequence[int], near: Sequence[Numbers],
                 scenes: Sequence[Scene]) -> list[FloatArray]:
        """
        Return ttc_2d [s] and min_distance [m] of vehicles to those near them, (P, 2) each.

        :param subjects: numbers of the vehicles, one at least.
        :param near: numbers of those near each vehicle.
        :param scenes: the scene in the coordinates of each vehicle's road.
        """
        counts = [len(others) for others in near]
        if sum(counts) * self._most <= FEW_CORNERS:
            return [self._approach_few(subject, others.tolist(), scene)
                    for subject, others, scene in zip(subjects, near, scenes, strict=True)]
        rows, others = np.repeat(np.arange(len(subjects)), counts), np.concatenate(near)
        own = np.repeat(subjects, counts)
        outlines = np.stack([scene.outlines for scene in scenes])
        moves = np.stack([scene.rates[:, :2] for scene in scenes])
        corners = np.maximum(self._corners[own], self._corners[others])
        result = np.empty((len(others), 2))
        for count in set(corners.tolist()):
            pairs = np.flatnonzero(corners == count)
            row, first, second = rows[pairs], own[pairs], others[pairs]
            footprints = outlines[row, first, :count], outlines[row, second, :count]
            contact = time_to_contact(*footprints, moves[row, first], moves[row, second])
            result[pairs, 0] = contact
            result[pairs, 1] = distance(*footprints, contact == 0.0)
        return np.split(result, np.cumsum(counts)[:-1])

    def _approach_few(self, subject: int, others: list[int], scene: Scene) -> FloatArray:
        own = scene.outlines[subject, :self._corners[subject]].tolist()
        return np.array([approach(
            own, scene.outlines[other, :self._corners[other]].tolist(),
            (scene.rates[other, :2] - scene.rates[subject, :2]).tolist()) for other in others]
        ).reshape(-1, 2)


def _convex(corners: FloatArray) -> FloatArray:
    """Return the corners of a footprint's convex hull."""
    hull = shapely.convex_hull(shapely.multipoints(corners))
    return np.asarray(shapely.get_coordinates(hull)[:-1])


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
