# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sources of an occupancy map's tiles: a folder of tiles, or one image that is cut into tiles."""

import os
from pathlib import Path
from typing import Protocol

from crgame_ros.errors import InputError
from crgame_ros.occupancy.image import open_pgm
from crgame_ros.occupancy.map_file import MapFile, MAX_RESOLUTION, read_map_file
import numpy as np
from numpy.typing import NDArray

# A map from another source is cut into tiles with edges of this many cells, 100 m at 0.1 m.
CUT_CELLS = 1000
MAX_TILES = 4_000_000


class TileSource(Protocol):
    """
    The tiles of a map, counted from its lower left corner.

    Attributes: `origin` (x, y) of that corner [m]; `resolution` of the cells [m]; `tile_cells`
    along the edge of a tile; `rows` and `columns` of tiles.
    """

    origin: tuple[float, float]
    resolution: float
    tile_cells: int
    rows: int
    columns: int

    def read(self, row: int, column: int) -> NDArray[np.bool_] | None:
        """
        Read a tile from disk.

        :return: (tile_cells, tile_cells) with row indices that grow with y; None if no cell is
            occupied.
        :raises InputError: if it cannot be used.
        """


def open_tiles(path: Path) -> TileSource:
    """
    Open a map: the YAML file (or folder) of a `crgame rasterize` map, or of any map_server map.

    :raises InputError: naming the file and the remedy.
    """
    index = read_map_file(path)
    return CutImage(index) if index.tile_cells is None else TileFolder(index, index.tile_cells)


def tile_name(row: int, column: int) -> str:
    """Return the name of a tile's YAML file."""
    return f'tile_{row}_{column}.yaml'


class TileFolder:
    """
    A map that `crgame rasterize` wrote: a map_server map for each tile that is not empty.

    :param index: the map whose pixels represent tiles.
    :param tile_cells: cells along the edge of a tile.
    :raises InputError: if the index is too large, or a tile is missing.
    """

    def __init__(self, index: MapFile, tile_cells: int) -> None:
        image = open_pgm(index.image)
        self.rows, self.columns = image.height, image.width
        if self.rows * self.columns > MAX_TILES:
            raise InputError(f'has {self.columns} x {self.rows} tiles, more than {MAX_TILES}',
                             str(index.image), 'use larger tiles')
        self.origin, self.tile_cells = index.origin, tile_cells
        self.resolution = index.resolution / tile_cells
        self._size = index.resolution
        self._folder = index.path.parent
        self._filled = index.occupied(image.read((0, self.rows), (0, self.columns)),
                                      image.maximum)
        there = set(os.listdir(self._folder))
        for row, column in np.argwhere(self._filled).tolist():
            if tile_name(row, column) not in there:
                raise InputError(f'the tile {tile_name(row, column)} is missing',
                                 str(self._folder), 'rasterize the map again')

    def read(self, row: int, column: int) -> NDArray[np.bool_] | None:
        """Read a tile; see `TileSource`."""
        if not self._filled[row, column]:
            return None
        tile = read_map_file(self._folder / tile_name(row, column))
        image = open_pgm(tile.image)
        expected = (self.origin[0] + column * self._size, self.origin[1] + row * self._size)
        if (image.width, image.height) != (self.tile_cells, self.tile_cells) \
                or tile.tile_cells is not None \
                or abs(tile.resolution - self.resolution) > 1e-9 * self.resolution \
                or max(abs(a - b) for a, b in zip(tile.origin, expected, strict=True)) \
                > 1e-3 * self.resolution:
            raise InputError(
                f'does not fit into its map: there should be {self.tile_cells} x '
                f'{self.tile_cells} cells of {self.resolution:g} m from ({expected[0]:g}, '
                f'{expected[1]:g}) on', str(tile.path), 'rasterize the map again')
        return tile.occupied(image.read((0, self.tile_cells), (0, self.tile_cells)),
                             image.maximum)


class CutImage:
    """
    A single map_server map, from which tiles are read as needed.

    :param map_file: the map.
    :raises InputError: if the image cannot be used.
    """

    def __init__(self, map_file: MapFile) -> None:
        self._map = map_file
        self._image = open_pgm(map_file.image)
        self.origin, self.resolution = map_file.origin, map_file.resolution
        self.tile_cells = min(CUT_CELLS, max(self._image.width, self._image.height))
        if self.resolution * self.tile_cells > MAX_RESOLUTION:
            raise InputError(f'has pixels of {self.resolution:g} m', str(map_file.path),
                             'give the resolution in metres')
        self.rows = -(-self._image.height // self.tile_cells)
        self.columns = -(-self._image.width // self.tile_cells)

    def read(self, row: int, column: int) -> NDArray[np.bool_] | None:
        """Read a tile; see `TileSource`."""
        cells, image = self.tile_cells, self._image
        low, left = row * cells, column * cells
        high, right = min(low + cells, image.height), min(left + cells, image.width)
        piece = self._map.occupied(
            image.read((image.height - high, image.height - low), (left, right)), image.maximum)
        if not piece.any():
            return None
        if piece.shape == (cells, cells):
            return piece
        whole = np.zeros((cells, cells), dtype=bool)
        whole[:piece.shape[0], :piece.shape[1]] = piece
        return whole
