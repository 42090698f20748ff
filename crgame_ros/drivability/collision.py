# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Finds the objects that each driven vehicle touches (CRG III-D a).

A broad test on arrays excludes far objects by their enclosing circles; the CommonRoad drivability
checker tests near ones. This narrow test uses coordinates relative to the vehicle, so that it
stays exact on maps with large coordinates.

The obstacles are the occupied cells, as squares. Nothing is rounded here, so that a verdict is as
exact as the map.
"""

from collections.abc import Sequence
import math
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectStates
from crgame_ros.geometry.outline import Footprint, Primitive
from crgame_ros.geometry.rigid_transform import Pose
from crgame_ros.geometry.shape import Shape
from crgame_ros.occupancy.occupancy import OccupancyGrid, OccupancyMap
import numpy as np
from numpy.typing import NDArray
import shapely

# Enclosing circles of objects that barely touch may miss each other by rounding.
CIRCLE_SLACK = 1e-6
# Kept back of a distance that nothing can cover before it is measured again, for rounding [m].
_KEPT_BACK = 1e-3
# Stands for the id of the object hit.
PERMANENT_OBSTACLE = 'permanent obstacle'
# An overlap up to this depth is not a contact [m]: the rounding of map coordinates.
CONTACT = 1e-6


class _Apart(NamedTuple):
    """
    A vehicle's place when all objects were measured, and its distance to the nearest one.

    :param since_s: time since the tick then [s]
    :param gap: between the enclosing circles [m]
    """

    x: float
    y: float
    since_s: float
    gap: float


class CollisionDetector:
    """
    A collision test of V driven vehicles against each other and against M other objects.

    :param driven: (V) shapes of the driven vehicles.
    :param others: (M) shapes of all other objects, in the order of their states.
    """

    def __init__(self, driven: Sequence[Shape], others: Sequence[Shape]) -> None:
        self._driven = [Footprint(shape) for shape in driven]
        self._others = [Footprint(shape) for shape in others]
        count = len(others)
        radii = np.array([footprint.radius for footprint in self._others])
        self._reach = [radii + footprint.radius + CIRCLE_SLACK for footprint in self._driven]
        # By vehicle, since the tick: None before its objects are measured.
        self._apart: list[_Apart | None] = [None] * len(self._driven)
        self._fastest = 0.0
        self._since_s = 0.0
        self._is_moved = False
        self._poses = np.full((3, count), np.nan)
        self._velocities = np.full((3, count), np.nan)
        self._moved = np.empty((3, count))
        self._offset = np.empty((2, count))
        self._distance = np.empty(count)
        self._near = np.empty(count, dtype=bool)

    def set_objects(self, states: ObjectStates) -> None:
        """
        Set the poses and velocities of the other objects at a scenario tick.

        :raises InputError: if their number is not M.
        """
        expected = (len(self._others), 3)
        if states.poses.shape != expected or states.velocities.shape != expected:
            raise InputError(
                f'poses {states.poses.shape} and velocities {states.velocities.shape} of '
                f'{len(self._others)} objects', 'object states', 'give one row of x, y, yaw each')
        self._poses[:] = states.poses.T
        self._velocities[:] = states.velocities.T
        # fmax ignores NaN, which means absent.
        self._fastest = float(np.fmax.reduce(
            np.hypot(self._velocities[0], self._velocities[1]), initial=0.0))
        self._apart = [None] * len(self._driven)
        self._is_moved = False

    def move(self, seconds_since_tick: float) -> None:
        """Move the other objects on from the tick at their velocities [s]."""
        self._since_s, self._is_moved = seconds_since_tick, False

    def hits(self, centers: Sequence[Pose]
             ) -> tuple[list[list[int]], list[list[int]]]:
        """
        Find all contacts; a pose with NaN is an absent vehicle and touches nothing.

        :param centers: (V) centre x [m], y [m], yaw [rad] of the driven vehicles.
        :return: for every driven vehicle the indices of the driven vehicles that it touches, and
            for every driven vehicle those of the other objects.
        """
        among: list[list[int]] = [[] for _ in centers]
        with_others: list[list[int]] = []
        for index, center in enumerate(centers):
            for other in range(index + 1, len(centers)):
                if self._touches(index, center, other, centers[other]):
                    among[index].append(other)
                    among[other].append(index)
            with_others.append(self._hit_objects(index, center) if self._others else [])
        return among, with_others

    def _touches(self, index: int, pose: Pose, other_index: int, other_pose: Pose) -> bool:
        dx, dy = other_pose[0] - pose[0], other_pose[1] - pose[1]
        own, other = self._driven[index], self._driven[other_index]
        reach = own.radius + other.radius + CIRCLE_SLACK
        # In this form, NaN counts as far away.
        return dx * dx + dy * dy <= reach * reach and math.isfinite(pose[2] + other_pose[2]) \
            and _overlap(own.at(0.0, 0.0, pose[2]), other.at(dx, dy, other_pose[2]))

    def _hit_objects(self, index: int, center: Pose) -> list[int]:
        x, y, yaw = center
        apart = self._apart[index]
        # In this form, NaN is no proof.
        if apart is not None and math.hypot(x - apart.x, y - apart.y) \
                + self._fastest * abs(self._since_s - apart.since_s) < apart.gap:
            return []
        if not self._is_moved:
            np.multiply(self._velocities, self._since_s, out=self._moved)
            self._moved += self._poses
            self._is_moved = True
        offset, distance = self._offset, self._distance
        np.subtract(self._moved[0], x, out=offset[0])
        np.subtract(self._moved[1], y, out=offset[1])
        np.multiply(offset, offset, out=offset)
        np.add(offset[0], offset[1], out=distance)
        np.sqrt(distance, out=distance)
        distance -= self._reach[index]
        np.less_equal(distance, 0.0, out=self._near)
        gap = float(np.fmin.reduce(distance, initial=math.inf))
        self._apart[index] = _Apart(x, y, self._since_s, gap - _KEPT_BACK)
        if not gap <= 0.0 or yaw != yaw:
            return []
        placed = self._driven[index].at(0.0, 0.0, yaw)
        hit = []
        for other in np.flatnonzero(self._near).tolist():
            other_x, other_y, other_yaw = self._moved[:, other].tolist()
            if _overlap(placed, self._others[other].at(other_x - x, other_y - y, other_yaw)):
                hit.append(other)
        return hit


def _overlap(first: list[Primitive], second: list[Primitive]) -> bool:
    return any(a.collide(b) for a in first for b in second)


class PermanentObstacles:
    """
    A test of driven vehicles against an occupancy map.

    A check reads only the cells under the box around the footprint. It takes some 10 microseconds,
    and some 10 more if one of them is occupied.

    :param shapes: (V) shapes of the driven vehicles.
    """

    def __init__(self, occupancy: OccupancyMap, shapes: Sequence[Shape]) -> None:
        self._occupancy = occupancy
        self._footprints = [Footprint(shape) for shape in shapes]
        self._point = np.empty((1, 2))

    def is_hit(self, index: int, center: tuple[float, float, float]) -> bool:
        """
        Return whether the footprint of a vehicle overlaps an occupied cell.

        :param center: x [m], y [m], yaw [rad] of its centre; NaN: it is absent and hits nothing.
        :raises InputError: if the map cannot be read any more.
        """
        x, y, yaw = center
        if not math.isfinite(x + y + yaw):
            return False
        footprint = self._footprints[index]
        self._point[0] = x, y
        grid = self._occupancy.near(self._point, footprint.radius)
        if grid is None:
            return False
        shape = footprint.shape
        if shape.kind == 'rectangle':
            cos, sin = abs(math.cos(yaw)), abs(math.sin(yaw))
            half_x = 0.5 * (cos * shape.length + sin * shape.width)
            half_y = 0.5 * (sin * shape.length + cos * shape.width)
        else:
            half_x = half_y = footprint.radius
        cells = _occupied_cells(grid, (x - half_x, y - half_y, x + half_x, y + half_y))
        if not len(cells):
            return False
        # Relative to the vehicle, numbers are small and rounding errors negligible.
        cells -= x, y
        if shape.kind == 'rectangle':
            return _rectangle_overlaps(cells, grid.resolution, shape, yaw, (half_x, half_y))
        return _polygon_overlaps(cells, grid.resolution, footprint.polygon(0.0, 0.0, yaw))


def _occupied_cells(grid: OccupancyGrid, box: tuple[float, float, float, float]
                    ) -> NDArray[np.float64]:
    """Return the centres (n, 2) of the occupied cells that a box touches [m]."""
    rows, columns = grid.occupied.shape
    x, y = grid.origin
    left = max(0, math.floor((box[0] - x) / grid.resolution))
    low = max(0, math.floor((box[1] - y) / grid.resolution))
    right = min(columns, math.floor((box[2] - x) / grid.resolution) + 1)
    high = min(rows, math.floor((box[3] - y) / grid.resolution) + 1)
    if left >= right or low >= high:
        return np.empty((0, 2))
    piece = grid.occupied[low:high, left:right]
    if not piece.any():
        return np.empty((0, 2))
    row, column = np.nonzero(piece)
    return np.stack((x + (column + (left + 0.5)) * grid.resolution,
                     y + (row + (low + 0.5)) * grid.resolution), axis=1)


def _rectangle_overlaps(cells: NDArray[np.float64], resolution: float, shape: Shape, yaw: float,
                        half: tuple[float, float]) -> bool:
    """Return whether a rectangle overlaps any cell: no axis (its own two, x, y) separates them."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    along = np.abs(cells @ (cos, sin))
    across = np.abs(cells @ (-sin, cos))
    edge = 0.5 * resolution - CONTACT
    reach = edge * (abs(cos) + abs(sin))
    beside = np.abs(cells)
    return bool(np.any(
        (along < 0.5 * shape.length + reach) & (across < 0.5 * shape.width + reach)
        & (beside[:, 0] < half[0] + edge) & (beside[:, 1] < half[1] + edge)))


def _polygon_overlaps(cells: NDArray[np.float64], resolution: float, outline: shapely.Polygon
                      ) -> bool:
    edge = 0.5 * resolution - CONTACT
    boxes = shapely.box(*(cells - edge).T, *(cells + edge).T)
    shapely.prepare(outline)
    return bool(shapely.intersects(outline, boxes).any())
