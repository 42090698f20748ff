# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Finds driven vehicles that touch a permanent obstacle: a curb, a fence (CRG III-D a, FS II-A2).

The obstacles are the occupied cells, as squares. Nothing is rounded here, so that a verdict is as
exact as the map.
"""

from collections.abc import Sequence
import math

from crgame_ros.geometry.outline import Footprint
from crgame_ros.geometry.shape import Shape
from crgame_ros.occupancy.occupancy import OccupancyGrid, OccupancyMap
import numpy as np
from numpy.typing import NDArray
import shapely

# Stands for the id of the object hit.
PERMANENT_OBSTACLE = 'permanent obstacle'
# An overlap up to this depth is not a contact [m]: the rounding of map coordinates.
CONTACT = 1e-6


class PermanentObstacles:
    """
    A test of driven vehicles against an occupancy map.

    A check reads only the cells under the box around the footprint. It takes some 10 microseconds,
    and some 10 more if one of them is occupied.

    :param occupancy: the map.
    :param shapes: (V) shapes of the driven vehicles.
    """

    def __init__(self, occupancy: OccupancyMap, shapes: Sequence[Shape]) -> None:
        self._occupancy = occupancy
        self._footprints = [Footprint(shape) for shape in shapes]
        self._point = np.empty((1, 2))

    def is_hit(self, index: int, center: tuple[float, float, float]) -> bool:
        """
        Return whether the footprint of a vehicle overlaps an occupied cell.

        :param index: index of the vehicle.
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
