# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The YAML file of a map_server map: which image, where it lies, and what its greys mean."""

from collections.abc import Mapping
from dataclasses import dataclass
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crgame_ros.errors import InputError
from crgame_ros.scenario.checked_values import short
from crgame_ros.scenario.game_file import read_yaml
from crgame_ros.scenario.occupancy_raster_spec import MAX_TILE_CELLS

INDEX_NAME = 'map.yaml'
REQUIRED = ('image', 'resolution', 'origin', 'negate', 'occupied_thresh', 'free_thresh')
# `scale` differs from `trinary` only in cells that are not occupied.
MODES = ('trinary', 'scale')
MAX_COORDINATE = 1e9
MIN_RESOLUTION, MAX_RESOLUTION = 1e-3, 1e5
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.25


@dataclass(frozen=True)
class MapFile:
    """
    What a map's YAML file says.

    :param path: the YAML file.
    :param image: the image file, inside the folder of the YAML file.
    :param resolution: edge of a pixel [m]
    :param origin: x, y of the lower left corner of the lower left pixel, frame map [m]
    :param negate: True where white is occupied.
    :param occupied_thresh: occupied is what has a larger probability of it, 0 to 1.
    :param tile_cells: cells along the edge of a tile, if the pixels stand for tiles, else None.
    """

    path: Path
    image: Path
    resolution: float
    origin: tuple[float, float]
    negate: bool = False
    occupied_thresh: float = OCCUPIED_THRESH
    tile_cells: int | None = None

    def occupied(self, pixels: NDArray[np.uint8], maximum: int) -> NDArray[np.bool_]:
        """
        Interpret grey values as map_server does; unknown is not occupied.

        :param pixels: (rows, columns) as in the image, the top row first.
        :param maximum: the value of white.
        :return: (rows, columns) with the bottom row first, so that rows grow with y.
        """
        shade = np.minimum(np.arange(256) / maximum, 1.0)
        probability = shade if self.negate else 1.0 - shade
        # Occupied greys are the darkest, or the lightest: to compare is quicker than to look up.
        count = int(np.count_nonzero(probability > self.occupied_thresh))
        if count in (0, 256):
            return np.full(pixels.shape, count > 0)
        upright = pixels[::-1]
        occupied: NDArray[np.bool_] = upright >= 256 - count if self.negate else upright < count
        return occupied


def read_map_file(path: Path) -> MapFile:
    """
    Read and check the YAML file of a map.

    :param path: the file, or the folder that holds it as `map.yaml`.
    :raises InputError: naming file, key and remedy.
    """
    file = path / INDEX_NAME if path.is_dir() else path
    if file.exists() and not file.is_file():
        raise InputError('is no regular file', str(file), 'name the YAML file of a map')
    values = read_yaml(file, 'map file')
    where = str(file)
    if not isinstance(values, Mapping):
        raise InputError('is no mapping', where, 'give the YAML file of a map_server map')
    for key in REQUIRED:
        if key not in values:
            raise InputError(f'"{key}" is missing', where, 'a map needs ' + ', '.join(REQUIRED))
    mode = values.get('mode', MODES[0])
    if mode not in MODES:
        raise InputError(f'"mode" is {short(mode)}', where, 'use ' + ' or '.join(MODES))
    occupied = _number(values, 'occupied_thresh', where, 0.0, 1.0)
    if _number(values, 'free_thresh', where, 0.0, 1.0) > occupied:
        raise InputError('"free_thresh" is larger than "occupied_thresh"', where, 'swap them')
    if values['negate'] not in (0, 1):
        raise InputError(f'"negate" is {short(values["negate"])}', where, 'give 0 or 1')
    return MapFile(
        file, _image(values['image'], file),
        _number(values, 'resolution', where, MIN_RESOLUTION, MAX_RESOLUTION),
        _origin(values['origin'], where), bool(values['negate']), occupied,
        _tile_cells(values.get('tile_cells'), where))


def map_text(image: str, resolution: float, origin: tuple[float, float], comment: str = '',
             tile_cells: int | None = None) -> str:
    """
    Write the YAML file of a map, readable by map_server.

    :param image: name of the image, in the same folder.
    :param resolution: edge of a pixel [m]
    :param origin: lower left corner [m]
    :param comment: lines to put first.
    :param tile_cells: if the pixels stand for tiles: cells along the edge of one.
    """
    lines = [f'# {line}' for line in comment.splitlines()]
    lines += [f'image: {image}', f'resolution: {resolution!r}',
              f'origin: [{origin[0]!r}, {origin[1]!r}, 0.0]', 'negate: 0',
              f'occupied_thresh: {OCCUPIED_THRESH}', f'free_thresh: {FREE_THRESH}',
              'mode: trinary']
    if tile_cells is not None:
        lines.append(f'tile_cells: {tile_cells}')
    return '\n'.join(lines) + '\n'


def _number(values: Mapping[str, Any], key: str, where: str, low: float, high: float) -> float:
    value = values[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise InputError(f'"{key}" is {short(value)}', where,
                         f'give a number from {low:g} to {high:g}')
    return float(value)


def _origin(value: Any, where: str) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) not in (2, 3) or not all(
            isinstance(number, int | float) and not isinstance(number, bool)
            and abs(number) <= MAX_COORDINATE for number in value):
        raise InputError(f'"origin" is {short(value)}', where, 'give [x, y, yaw] in m and rad')
    if len(value) == 3 and abs(math.remainder(value[2], math.tau)) > 1e-9:
        raise InputError(f'the map is turned: "origin" has the yaw {value[2]:g} rad', where,
                         'turn the image and give the yaw 0')
    return float(value[0]), float(value[1])


def _image(name: Any, file: Path) -> Path:
    where = str(file)
    if not isinstance(name, str) or not name or '\0' in name:
        raise InputError(f'"image" is {short(name)}', where, 'name a PGM image')
    image = (file.parent / name).resolve()
    if not image.is_relative_to(file.parent.resolve()):
        raise InputError(f'the image {short(name)} lies outside the folder of the map', where,
                         'put the image beside the YAML file')
    return image


def _tile_cells(value: Any, where: str) -> int | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MAX_TILE_CELLS:
        raise InputError(f'"tile_cells" is {short(value)}', where,
                         f'give a whole number from 1 to {MAX_TILE_CELLS}')
    return value
