# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame rasterize`."""

import argparse
from collections.abc import Callable
from pathlib import Path
import sys
import time

from crgame_ros.library.lookup import find_scenario
from crgame_ros.occupancy.map_file import RasterSpec

DESCRIPTION = """\
Draw the permanent obstacles of a CommonRoad scenario (curbs along the outside of the road, static
obstacles) as an occupancy map in tiles. Each tile is a map_server map (PGM and YAML). A game takes
the map with its key "occupancy"."""
# Shorter work shows no progress [s].
SILENT_S = 2.0
REPORT_S = 1.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    default = RasterSpec()
    add = parser.add_argument
    add('scenario', type=find_scenario, help='CommonRoad XML file, or benchmark id')
    add('out', type=Path, help='folder for the map; it must be new')
    add('--resolution', type=float, default=default.resolution, metavar='M',
        help='edge of a cell [m] (default: %(default)g)')
    add('--tile', type=float, default=default.tile, metavar='M',
        help='edge of a tile [m], a whole number of cells (default: %(default)g)')
    add('--curb-width', type=float, default=default.curb_width, metavar='M',
        help='width of the curbs, outwards from the edge of the road [m] (default: %(default)g)')
    add('--min-island', type=float, default=default.min_island, metavar='M2',
        help='holes in the road smaller than this have no curb [m^2] (default: %(default)g)')
    add('--no-curbs', dest='curbs', action='store_false', help='draw no curbs')
    add('--no-obstacles', dest='obstacles', action='store_false', help='draw no static obstacles')
    add('--close-ends', action='store_true',
        help='draw curbs also across the ends of the roads, where the map ends')
    add('--force', action='store_true', help='replace a map that is in the folder')
    parser.set_defaults(command=run)


def run(values: argparse.Namespace) -> int:
    """Write the map, and print a summary; return the exit code."""
    from crgame_ros.occupancy.rasterize import check_target, Raster, write_map
    from crgame_ros.scenario.loading import load_scenario
    spec = RasterSpec(values.resolution, values.tile, values.curb_width, values.min_island,
                      values.curbs, values.obstacles, values.close_ends)
    # Check before the work.
    check_target(values.out, values.force)
    report = _reporter(time.monotonic())
    loaded = load_scenario(values.scenario)
    for notice in loaded.notices:
        print(f'note: {notice}', file=sys.stderr)
    raster = Raster(loaded, spec)
    written = write_map(raster, values.out, loaded.benchmark_id, values.force, report)
    print(f'{written.path}: {written.cells} occupied cells of {spec.resolution:g} m, '
          f'{written.tiles} of {raster.rows * raster.columns} tiles of {spec.tile:g} m have some, '
          f'{written.size[0]:g} m x {written.size[1]:g} m')
    return 0


def _reporter(start_s: float) -> Callable[[int, int], None]:
    """Return a function that prints progress once a second, if the work takes long."""
    due_s = start_s + SILENT_S

    def report(done: int, total: int) -> None:
        nonlocal due_s
        now_s = time.monotonic()
        if now_s >= due_s and done < total:
            due_s = now_s + REPORT_S
            print(f'rasterize: {100 * done // total} % ({done} of {total} tiles drawn)',
                  file=sys.stderr, flush=True)

    return report
