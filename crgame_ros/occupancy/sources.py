# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sources of an occupancy map's tiles: a folder, or one image (PGM), read piece by piece."""

from dataclasses import dataclass
import os
from pathlib import Path
import re
import stat
from typing import Protocol

from crgame_ros.errors import InputError
from crgame_ros.occupancy.map_file import MapFile, MAX_RESOLUTION, read_map_file
import numpy as np
from numpy.typing import NDArray

# A map from another source is cut into tiles with edges of this many cells, 100 m at 0.1 m.
CUT_CELLS = 1000
MAX_TILES = 4_000_000
MAX_EDGE = 1 << 20
# Numbers as text must be read at once, and take many times their size in memory.
MAX_PLAIN_BYTES = 16 << 20
HEADER_BYTES = 4096
_GAP = rb'(?:\s|#[^\n]*\n)+'
_HEADER = re.compile(rb'P([25])' + _GAP + rb'(\d{1,9})' + _GAP + rb'(\d{1,9})' + _GAP
                     + rb'(\d{1,9})\s')
_COMMENT = re.compile(rb'#[^\n]*')


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
    tile_cells = index.entry.tile_cells
    return CutImage(index) if tile_cells is None else TileFolder(index, tile_cells)


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
        self.origin, self.tile_cells = index.entry.origin[:2], tile_cells
        self.resolution = index.entry.resolution / tile_cells
        self._size = index.entry.resolution
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
        entry, image = tile.entry, open_pgm(tile.image)
        expected = (self.origin[0] + column * self._size, self.origin[1] + row * self._size)
        if (image.width, image.height) != (self.tile_cells, self.tile_cells) \
                or entry.tile_cells is not None \
                or abs(entry.resolution - self.resolution) > 1e-9 * self.resolution \
                or max(abs(a - b) for a, b in zip(entry.origin[:2], expected, strict=True)) \
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

    :raises InputError: if the image cannot be used.
    """

    def __init__(self, map_file: MapFile) -> None:
        self._map = map_file
        self._image = open_pgm(map_file.image)
        self.origin, self.resolution = map_file.entry.origin[:2], map_file.entry.resolution
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


@dataclass(frozen=True)
class PgmImage:
    """
    An image whose pixels stay on disk.

    The file is read, not mapped into memory: if a mapped file were truncated, the process would
    crash.

    :param width: pixels in a row.
    :param height: rows; row 0 is the top.
    :param maximum: the value of white, 1 to 255.
    :param first_byte: offset of the pixels in the file.
    :param plain: (height, width) pixels of a file with numbers as text, else None.
    """

    path: Path
    width: int
    height: int
    maximum: int
    first_byte: int
    plain: NDArray[np.uint8] | None = None

    def read(self, rows: tuple[int, int], columns: tuple[int, int]) -> NDArray[np.uint8]:
        """
        Read a piece.

        :param rows: first row, and the one after the last.
        :param columns: first column, and the one after the last.
        :return: (rows, columns) pixels as in the file.
        :raises InputError: if the file has changed and cannot be read any more.
        """
        if self.plain is not None:
            return self.plain[slice(*rows), slice(*columns)]
        pixels = np.empty((rows[1] - rows[0], columns[1] - columns[0]), dtype=np.uint8)
        # Complete rows are contiguous in the file.
        lines = pixels.reshape(1, -1) if pixels.shape[1] == self.width else pixels
        try:
            with self.path.open('rb') as stream:
                for index, line in enumerate(lines):
                    place = self.first_byte + (rows[0] + index) * self.width + columns[0]
                    if os.preadv(stream.fileno(), [line.data], place) != line.size:
                        raise _cut_short(self.path)
        except OSError as error:
            raise _unreadable(self.path, error) from error
        return pixels


def open_pgm(path: Path) -> PgmImage:
    """
    Open a grey image of 8 bits.

    :raises InputError: if it is missing, not a PGM image, of 16 bits, truncated or too large.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError('is no regular file', str(path), 'name a PGM image')
        with path.open('rb') as stream:
            match = _HEADER.match(stream.read(HEADER_BYTES))
            if match is None:
                raise InputError('is no PGM image (it must begin with P5 or P2, width, height and '
                                 'maximum)', str(path), 'convert the image to PGM')
            width, height, maximum = (int(number) for number in match.groups()[1:])
            if not (0 < width <= MAX_EDGE and 0 < height <= MAX_EDGE):
                raise InputError(f'has {width} x {height} pixels', str(path),
                                 f'give an image of 1 to {MAX_EDGE} pixels each way')
            if not 0 < maximum < 256:
                raise InputError(f'has grey values up to {maximum}', str(path),
                                 'convert it to 8 bits (up to 255)')
            plain = None
            if match.group(1) == b'2':
                stream.seek(match.end())
                plain = _read_plain(stream.read(MAX_PLAIN_BYTES + 1), (height, width), path)
            elif status.st_size < match.end() + width * height:
                raise _cut_short(path)
    except OSError as error:
        raise _unreadable(path, error) from error
    return PgmImage(path, width, height, maximum, match.end(), plain)


def write_pgm(path: Path, pixels: NDArray[np.uint8]) -> None:
    """
    Write a grey image (P5) of 8 bits.

    :param pixels: (height, width), row 0 is the top.
    :raises OSError: if the file cannot be written.
    """
    height, width = pixels.shape
    with path.open('wb') as stream:
        stream.write(b'P5\n%d %d\n255\n' % (width, height))
        stream.write(np.ascontiguousarray(pixels).data)


def _read_plain(data: bytes, shape: tuple[int, int], path: Path) -> NDArray[np.uint8]:
    if len(data) > MAX_PLAIN_BYTES:
        raise InputError(f'has more than {MAX_PLAIN_BYTES >> 20} MiB of numbers as text',
                         str(path), 'convert it to a binary PGM (P5)')
    words = _COMMENT.sub(b'', data).split()
    if len(words) < shape[0] * shape[1]:
        raise _cut_short(path)
    words = words[:shape[0] * shape[1]]
    if not all(len(word) < 4 and word.isdigit() and int(word) < 256 for word in words):
        raise InputError('holds a pixel that is no number from 0 to 255', str(path),
                         'write the image again')
    return np.array([int(word) for word in words], dtype=np.uint8).reshape(shape)


def _cut_short(path: Path) -> InputError:
    return InputError('is shorter than its header says', str(path), 'copy the image again')


def _unreadable(path: Path, error: OSError) -> InputError:
    return InputError(f'cannot be read ({error.strerror})', str(path),
                      'check the name and the permissions')
