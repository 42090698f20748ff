# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The YAML file of a map_server map (image, position, grey values), and what makes such a map."""

from dataclasses import dataclass, field, fields
import math
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from crgame_ros.errors import InputError, short
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Meaning, Parts, Within, Wording
from crgame_ros.schema.reading import read
from crgame_ros.yaml_text import read_yaml
import numpy as np
from numpy.typing import NDArray

# Greatest edge of a tile: 4 MiB of memory.
MAX_TILE_CELLS = 2048
BOUNDS = {'resolution': (0.01, 10.0), 'tile': (1.0, 10_000.0), 'curb_width': (0.01, 10.0),
          'min_island': (0.0, 1e6)}
INDEX_NAME = 'map.yaml'
MAX_COORDINATE = 1e9
MIN_RESOLUTION, MAX_RESOLUTION = 1e-3, 1e5
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.25


@dataclass(frozen=True)
class RasterSpec:
    """
    Settings of an occupancy map.

    :param resolution: edge of a cell [m]; 0.1 m is finer than the accuracy of a vehicle's pose.
    :param tile: edge of a tile, a whole number of cells [m]
    :param curb_width: width of a curb, outwards from the edge of the road [m]; kerb stones are
        0.12 to 0.18 m wide.
    :param min_island: smaller holes in the road are gaps between lanelets, as in the middle of
        junctions, and have no curb [m^2]; 2 m^2 separates them from islands in the maps tested.
    :param curbs: draw the edges of the road.
    :param obstacles: draw the scenario's static and environment obstacles.
    :param close_ends: draw curbs across the ends of the map's roads too.
    """

    resolution: float = 0.1
    tile: float = 100.0
    curb_width: float = 0.15
    min_island: float = 2.0
    curbs: bool = True
    obstacles: bool = True
    close_ends: bool = False

    def __post_init__(self) -> None:
        """Refuse numbers out of bounds."""
        for each in fields(self):
            low, high = BOUNDS.get(each.name, (-math.inf, math.inf))
            value = getattr(self, each.name)
            if not low <= value <= high:
                raise InputError(f'is {value:g}', '--' + each.name.replace('_', '-'),
                                 f'give a number from {low:g} to {high:g}')
        cells = self.tile / self.resolution
        if abs(cells - round(cells)) > 1e-6 or not 1 <= round(cells) <= MAX_TILE_CELLS:
            raise InputError(f'{self.tile:g} m are {cells:g} cells of {self.resolution:g} m',
                             '--tile', f'give a whole number of cells, 1 to {MAX_TILE_CELLS}')

    @property
    def tile_cells(self) -> int:
        """Return the number of cells along the edge of a tile."""
        return round(self.tile / self.resolution)


@dataclass(frozen=True)
class MapEntry:
    """
    A map in the format of map_server; other keys are ignored.

    :param image: a PGM image in the folder of the file, or below it.
    :param resolution: edge of a pixel [m]
    :param origin: lower left corner of the lower left pixel [m, m, rad]; rotated maps are refused.
    :param negate: 1 where white is occupied.
    :param occupied_thresh: pixels with a larger probability of occupancy are occupied.
    :param free_thresh: pixels with a smaller probability are free.
    :param mode: scale differs from trinary only in cells that are not occupied.
    :param tile_cells: cells along the edge of a tile, if each pixel represents a tile.
    """

    FORM: ClassVar[Form] = Form('give the YAML file of a map_server map', rest='others')

    image: Annotated[str, Wording(r'[\s\S]+', 'name a PGM image')]
    resolution: Annotated[float, Within(MIN_RESOLUTION, MAX_RESOLUTION)]
    origin: Annotated[tuple[float, float, float], Parts(('x', 'y', 'yaw'), 1),
                      Within(-MAX_COORDINATE, MAX_COORDINATE)]
    negate: Annotated[int, Within(0, 1), Meaning(False, 0), Meaning(True, 1)]
    occupied_thresh: Annotated[float, Within(0.0, 1.0)]
    free_thresh: Annotated[float, Within(0.0, 1.0)]
    mode: Literal['trinary', 'scale'] = 'trinary'
    tile_cells: Annotated[int, Within(1, MAX_TILE_CELLS)] | None = None
    others: dict[str, object] = field(default_factory=dict)

    def check(self) -> None:
        """Refuse thresholds in the wrong order, and a rotated map."""
        if self.free_thresh > self.occupied_thresh:
            raise InputError('"free_thresh" is larger than "occupied_thresh"', '', 'swap them')
        if abs(math.remainder(self.origin[2], math.tau)) > 1e-9:
            raise InputError(f'the map is turned: "origin" has the yaw {self.origin[2]:g} rad',
                             '', 'turn the image and give the yaw 0')


@dataclass(frozen=True)
class MapFile:
    """
    A map's YAML file, which has been checked.

    :param path: the file.
    :param image: the image file, inside its folder.
    :param entry: what it says.
    """

    path: Path
    image: Path
    entry: MapEntry

    def occupied(self, pixels: NDArray[np.uint8], maximum: int) -> NDArray[np.bool_]:
        """
        Return which grey values are occupied, as in map_server; unknown is not occupied.

        :param pixels: (rows, columns) as in the image, the top row first.
        :param maximum: the value of white.
        :return: (rows, columns) with the bottom row first, so that row indices grow with y.
        """
        shade = np.minimum(np.arange(256) / maximum, 1.0)
        probability = shade if self.entry.negate else 1.0 - shade
        # Occupied greys are the darkest or the lightest: a comparison is faster than a table.
        count = int(np.count_nonzero(probability > self.entry.occupied_thresh))
        if count in (0, 256):
            return np.full(pixels.shape, count > 0)
        upright = pixels[::-1]
        return upright >= 256 - count if self.entry.negate else upright < count


def read_map_file(path: Path) -> MapFile:
    """
    Read and check the YAML file of a map.

    :param path: the file, or the folder that holds it as `map.yaml`.
    :raises InputError: naming file, key and remedy.
    """
    file = path / INDEX_NAME if path.is_dir() else path
    entry = read(MapEntry, read_yaml(file, 'map file'), str(file))
    image = (file.parent / entry.image).resolve()
    if not image.is_relative_to(file.parent.resolve()):
        raise InputError(f'the image {short(entry.image)} lies outside the folder of the map',
                         str(file), 'put the image beside the YAML file')
    return MapFile(file, image, entry)


def map_text(image: str, resolution: float, origin: tuple[float, float], comment: str = '',
             tile_cells: int | None = None) -> str:
    """
    Return the YAML text of a map, readable by map_server.

    :param image: name of the image, in the same folder.
    :param resolution: edge of a pixel [m]
    :param origin: lower left corner [m]
    :param comment: comment lines at the top.
    :param tile_cells: cells along the edge of a tile, if each pixel represents a tile.
    """
    lines = [f'# {line}' for line in comment.splitlines()]
    lines += [f'image: {image}', f'resolution: {resolution!r}',
              f'origin: [{origin[0]!r}, {origin[1]!r}, 0.0]', 'negate: 0',
              f'occupied_thresh: {OCCUPIED_THRESH}', f'free_thresh: {FREE_THRESH}',
              'mode: trinary']
    if tile_cells is not None:
        lines.append(f'tile_cells: {tile_cells}')
    return '\n'.join(lines) + '\n'
