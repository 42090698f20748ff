# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cells of an occupancy grid that a ray from outside can reach."""

from crgame_ros.occupancy.occupancy import OccupancyGrid
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class BorderCells:
    """
    The occupied cells with a free side, or on the border, of the grid last asked about.

    A ray that enters an occupied region from outside does so through one of them. They are found
    once for each grid: maps give the same object as long as the same part of them is needed.
    """

    def __init__(self) -> None:
        self._grid: OccupancyGrid | None = None
        self._corners: Array = np.empty((0, 2))

    def near(self, grid: OccupancyGrid, x: float, y: float, reach: float) -> Array:
        """
        List those around a point.

        :param x: of the point [m]
        :param y: of the point [m]
        :param reach: radius [m]
        :return: (C, 2) lower left corners, relative to the point [m]
        """
        if grid is not self._grid:
            self._grid, self._corners = grid, _border(grid)
        corners = self._corners - (x, y)
        middle = corners + 0.5 * grid.resolution
        close = np.einsum('ij,ij->i', middle, middle) <= (reach + grid.resolution) ** 2
        near: Array = corners[close]
        return near


def _border(grid: OccupancyGrid) -> Array:
    """Return the lower left corners (C, 2) of all cells of a grid's occupied borders [m]."""
    occupied = grid.occupied
    covered = np.zeros(occupied.shape, dtype=bool)
    covered[1:-1, 1:-1] = (occupied[:-2, 1:-1] & occupied[2:, 1:-1]
                           & occupied[1:-1, :-2] & occupied[1:-1, 2:])
    rows, columns = np.nonzero(occupied & ~covered)
    cells = np.stack((columns, rows), axis=1).astype(np.float64)
    corners: Array = grid.resolution * cells + grid.origin
    return corners
