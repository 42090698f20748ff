# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes an occupancy map into a folder."""

from collections.abc import Callable
from dataclasses import dataclass
import os
from pathlib import Path
import shutil
import tempfile

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.occupancy.image import write_pgm
from crgame_ros.occupancy.map_file import INDEX_NAME, map_text, read_map_file
from crgame_ros.occupancy.rasterize import Raster
from crgame_ros.occupancy.sources import tile_name
import numpy as np
from numpy.typing import NDArray

OCCUPIED, FREE = 0, 255
INDEX_IMAGE = 'tiles.pgm'
COMMENT = """\
Permanent obstacles of {name}: curbs {curbs}, obstacles {obstacles}.
Each pixel of the image is a tile of {tile:g} m. A black one has a map of its own beside this
file, tile_ROW_COLUMN.yaml, counted from 0 at the lower left: {cells} x {cells} cells of
{resolution:g} m."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class WrittenMap:
    """
    The map that was written.

    :param path: the map's YAML file.
    :param tiles: number of tiles that are not empty.
    :param cells: number of occupied cells.
    :param size: width and height of the map [m]
    """

    path: Path
    tiles: int
    cells: int
    size: tuple[float, float]


def check_target(folder: Path, force: bool) -> None:
    """
    Refuse to overwrite existing data.

    :param folder: folder of the map.
    :param force: whether an existing map may be replaced; other data may not.
    :raises InputError: if it exists, with the remedy.
    """
    if not (folder.exists() or folder.is_symlink()):
        return
    if not folder.is_dir() or folder.is_symlink():
        raise InputError('is no folder', str(folder), 'name another folder for the map')
    if not any(folder.iterdir()):
        return
    try:
        is_map = read_map_file(folder).tile_cells is not None
    except InputError:
        is_map = False
    if not is_map:
        raise InputError('is a folder with other things in it', str(folder),
                         'name a new folder for the map')
    if not force:
        raise InputError('is there already', str(folder), 'add --force to replace the map')


def write_map(raster: Raster, folder: Path, name: str, force: bool = False,
              progress: Progress | None = None) -> WrittenMap:
    """
    Write a map into a folder, which appears once it is complete.

    :param raster: the map to draw.
    :param folder: folder to write; it is created with its parents.
    :param name: name of the scenario, for the comment in the file.
    :param force: whether to replace an existing map.
    :param progress: called after each tile with the number drawn and the total.
    :raises InputError: if the folder exists, see `check_target`.
    :raises CrgameError: if the files cannot be written.
    """
    check_target(folder, force)
    part: Path | None = None
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f'.{folder.name}.', suffix='.part',
                                     dir=folder.parent))
        part.chmod(0o755)
        written = _fill(part, raster, name, progress)
        _move(part, folder)
    except OSError as error:
        raise CrgameError(f'{folder}: cannot write the map ({error.strerror})') from error
    finally:
        if part is not None:
            shutil.rmtree(part, ignore_errors=True)
    return WrittenMap(folder / INDEX_NAME, *written)


def _fill(part: Path, raster: Raster, name: str, progress: Progress | None
          ) -> tuple[int, int, tuple[float, float]]:
    spec = raster.spec
    filled = np.zeros((raster.rows, raster.columns), dtype=bool)
    cells = 0
    for done, (row, column, occupied) in enumerate(raster.tiles(), 1):
        if occupied is not None:
            filled[row, column] = True
            cells += int(occupied.sum())
            text = tile_name(row, column)
            image = text.replace('.yaml', '.pgm')
            corner = (round(raster.origin[0] + column * spec.tile, 9),
                      round(raster.origin[1] + row * spec.tile, 9))
            write_pgm(part / image, _pixels(occupied))
            (part / text).write_text(map_text(image, spec.resolution, corner), encoding='utf-8')
        if progress is not None:
            progress(done, raster.candidates)
    write_pgm(part / INDEX_IMAGE, _pixels(filled))
    comment = COMMENT.format(
        name=name, tile=spec.tile, cells=spec.tile_cells, resolution=spec.resolution,
        curbs=f'{spec.curb_width:g} m wide' if spec.curbs else 'left out',
        obstacles='drawn' if spec.obstacles else 'left out')
    (part / INDEX_NAME).write_text(
        map_text(INDEX_IMAGE, spec.tile, raster.origin, comment, spec.tile_cells),
        encoding='utf-8')
    return (int(filled.sum()), cells,
            (raster.columns * spec.tile, raster.rows * spec.tile))


def _pixels(occupied: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return the image of cells; its top row has the largest y."""
    return np.where(occupied[::-1], OCCUPIED, FREE).astype(np.uint8)


def _move(part: Path, folder: Path) -> None:
    """Move the finished folder to its place; an old one stays until then."""
    if not folder.exists():
        os.rename(part, folder)
        return
    old = Path(tempfile.mkdtemp(prefix=f'.{folder.name}.', suffix='.old', dir=folder.parent))
    os.rename(folder, old)
    try:
        os.rename(part, folder)
    except OSError:
        os.rename(old, folder)
        raise
    shutil.rmtree(old, ignore_errors=True)
