# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Permanent obstacles as an occupancy grid (FS II-A2)."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class OccupancyGrid:
    """
    A rectangular piece of map that is occupied or free, cell by cell.

    :param origin: x, y of the lower left corner of cell [0, 0], frame map [m]
    :param resolution: edge of a cell [m]
    :param occupied: (rows, columns); rows grow with y, columns with x
    """

    origin: tuple[float, float]
    resolution: float
    occupied: NDArray[np.bool_]

    def occupied_at(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """
        Return which points are in occupied cells; points outside the grid are not.

        :param points: (..., 2) [m]
        :return: (...)
        """
        cells = np.floor((points - self.origin) / self.resolution)
        rows, columns = self.occupied.shape
        inside = np.all((cells >= 0.0) & (cells < (columns, rows)), axis=-1)
        found = np.zeros(points.shape[:-1], dtype=bool)
        column, row = cells[inside].astype(np.int64).T
        found[inside] = self.occupied[row, column]
        return found


class OccupancyMap(Protocol):
    """A map of any extent that returns the part around given points."""

    def near(self, points: NDArray[np.float64], reach_m: float) -> OccupancyGrid | None:
        """
        Return a grid that covers at least the surroundings of points.

        :param points: (N, 2), frame map [m]; NaN points are left out.
        :param reach_m: distance around the points [m]
        :return: None if nothing is occupied there.
        """

    def fits_anywhere(self, reach_m: float) -> bool:
        """Return whether memory holds the surroundings of any one point."""
