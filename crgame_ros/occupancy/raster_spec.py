# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Settings for drawing permanent obstacles into an occupancy map."""

from dataclasses import dataclass, fields
import math

from crgame_ros.errors import InputError

# Greatest edge of a tile: 4 MiB of memory.
MAX_TILE_CELLS = 2048
BOUNDS = {'resolution': (0.01, 10.0), 'tile': (1.0, 10_000.0), 'curb_width': (0.01, 10.0),
          'min_island': (0.0, 1e6)}


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
        for field in fields(self):
            low, high = BOUNDS.get(field.name, (-math.inf, math.inf))
            value = getattr(self, field.name)
            if not low <= value <= high:
                raise InputError(f'is {value:g}', '--' + field.name.replace('_', '-'),
                                 f'give a number from {low:g} to {high:g}')
        cells = self.tile / self.resolution
        if abs(cells - round(cells)) > 1e-6 or not 1 <= round(cells) <= MAX_TILE_CELLS:
            raise InputError(f'{self.tile:g} m are {cells:g} cells of {self.resolution:g} m',
                             '--tile', f'give a whole number of cells, 1 to {MAX_TILE_CELLS}')

    @property
    def tile_cells(self) -> int:
        """Return the number of cells along the edge of a tile."""
        return round(self.tile / self.resolution)
