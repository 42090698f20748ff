# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Occupancy maps of any extent, of which only parts near the vehicles are in memory (FS II-A2).

"As the host vehicle moves, segments of occupancy grids maps in proximity to the vehicle are
loaded."
"""

import math
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.occupancy.occupancy import OccupancyGrid
from crgame_ros.occupancy.sources import open_tiles
import numpy as np
from numpy.typing import NDArray

# Greatest number of cells in memory for tiles, and again for grids composed of them: 64 MiB each.
MAX_CELLS = 1 << 26

# First row, last row, first column, last column of tiles.
_Range = tuple[int, int, int, int]


class TiledOccupancy:
    """
    Permanent obstacles on disk, read in tiles as needed.

    A repeated request returns the same object and takes some microseconds. A request that needs
    other tiles takes some milliseconds for each.

    :param path: the YAML file of a map that `crgame rasterize` wrote, or its folder, or the YAML
        file of any map_server map with a PGM image, which is cut into tiles as it is read.
    :param max_cells: greatest number of cells of tiles in memory, a byte each; grids composed of
        several tiles may take as much again.
    :raises InputError: if the map cannot be used; so does `near` if a tile cannot be read.
    """

    def __init__(self, path: Path, max_cells: int = MAX_CELLS) -> None:
        self.path = path
        self._source = open_tiles(path)
        self._size = self._source.resolution * self._source.tile_cells
        self.max_tiles = max_cells // self._source.tile_cells ** 2
        if self.max_tiles < 1:
            raise InputError(f'a tile has {self._source.tile_cells ** 2} cells, more than '
                             f'{max_cells} may be in memory', str(path), 'use smaller tiles')
        self.loaded = 0
        self.dropped = 0
        # Both are in the order of use, the latest last.
        self._tiles: dict[tuple[int, int], NDArray[np.bool_] | None] = {}
        self._grids: dict[_Range, OccupancyGrid | None] = {}
        self._last: tuple[_Range | None, OccupancyGrid | None] = (None, None)

    @property
    def resident_tiles(self) -> int:
        """Return the number of tiles in memory: `loaded` from disk so far minus `dropped`."""
        return self.loaded - self.dropped

    @property
    def resolution(self) -> float:
        """Return the edge of a cell [m]."""
        return self._source.resolution

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Return the smallest x and y, largest x and y of the map's tiles [m]."""
        x, y = self._source.origin
        return x, y, x + self._source.columns * self._size, y + self._source.rows * self._size

    def fits(self, points: NDArray[np.float64], reach_m: float) -> bool:
        """Return whether the grid of `near` for these arguments is small enough for memory."""
        tiles = self._range(points, reach_m)
        return tiles is None or _count(tiles) <= self.max_tiles

    def fits_anywhere(self, reach_m: float) -> bool:
        """Return whether the grid of `near` for any one point is small enough for memory."""
        across = int(2.0 * reach_m / self._size) + 2
        return min(self._source.rows, across) * min(self._source.columns, across) \
            <= self.max_tiles

    def near(self, points: NDArray[np.float64], reach_m: float) -> OccupancyGrid | None:
        """
        Return the tiles around points as one rectangular grid.

        Every cell of the grid is as in the map. The array is read-only.

        :param points: (N, 2), frame map [m]; NaN points are left out.
        :param reach_m: half the edge of the square around each point [m]
        :return: the same object as long as the same tiles are needed; None if these tiles are
            empty, or there are none.
        :raises InputError: if the points lie too far apart to be held in memory together, or a
            tile cannot be used.
        """
        tiles = self._range(points, reach_m)
        if tiles == self._last[0]:
            return self._last[1]
        grid = self._grid(tiles) if tiles is not None else None
        self._last = (tiles, grid)
        return grid

    def _range(self, points: NDArray[np.float64], reach_m: float) -> _Range | None:
        if not len(points):
            return None
        left, low = np.fmin.reduce(points, axis=0).tolist()
        right, high = np.fmax.reduce(points, axis=0).tolist()
        if not math.isfinite(left + low + right + high + reach_m):
            return None
        x, y = self._source.origin
        last_row, last_column = self._source.rows - 1, self._source.columns - 1
        first_row = max(0, math.floor((low - reach_m - y) / self._size))
        first_column = max(0, math.floor((left - reach_m - x) / self._size))
        last_row = min(last_row, math.floor((high + reach_m - y) / self._size))
        last_column = min(last_column, math.floor((right + reach_m - x) / self._size))
        if first_row > last_row or first_column > last_column:
            return None
        return first_row, last_row, first_column, last_column

    def _grid(self, tiles: _Range) -> OccupancyGrid | None:
        if tiles in self._grids:
            grid = self._grids.pop(tiles)
        else:
            if _count(tiles) > self.max_tiles:
                raise InputError(f'{_count(tiles)} tiles are wanted at once, more than '
                                 f'{self.max_tiles} may be in memory', str(self.path),
                                 'ask for a smaller neighbourhood')
            grid = self._assemble(tiles)
        self._grids[tiles] = grid
        total = sum(_count(kept) for kept in self._grids)
        while total > self.max_tiles:
            oldest = next(iter(self._grids))
            total -= _count(oldest)
            del self._grids[oldest]
        return grid

    def _assemble(self, tiles: _Range) -> OccupancyGrid | None:
        first_row, last_row, first_column, last_column = tiles
        cells = self._source.tile_cells
        found = [(row - first_row, column - first_column, tile)
                 for row in range(first_row, last_row + 1)
                 for column in range(first_column, last_column + 1)
                 if (tile := self._tile(row, column)) is not None]
        if not found:
            return None
        if _count(tiles) == 1:
            occupied = found[0][2]
        else:
            occupied = np.zeros(((last_row - first_row + 1) * cells,
                                 (last_column - first_column + 1) * cells), dtype=bool)
            for row, column, tile in found:
                occupied[row * cells:(row + 1) * cells, column * cells:(column + 1) * cells] = tile
            occupied.flags.writeable = False
        x, y = self._source.origin
        return OccupancyGrid((x + first_column * self._size, y + first_row * self._size),
                             self._source.resolution, occupied)

    def _tile(self, row: int, column: int) -> NDArray[np.bool_] | None:
        place = (row, column)
        if place in self._tiles:
            tile = self._tiles.pop(place)
        else:
            while len(self._tiles) >= self.max_tiles:
                oldest = next(iter(self._tiles))
                self.dropped += self._tiles.pop(oldest) is not None
            tile = self._source.read(row, column)
            if tile is not None:
                tile.flags.writeable = False
                self.loaded += 1
        self._tiles[place] = tile
        return tile


def _count(tiles: _Range) -> int:
    return (tiles[1] - tiles[0] + 1) * (tiles[3] - tiles[2] + 1)
