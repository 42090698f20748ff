# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Draws the permanent obstacles of a scenario (FS II-A2), and writes the map into a folder.

A cell is occupied if its interior intersects a curb or an obstacle. Every point of these is in an
occupied cell, and the centre of an occupied cell is no more than half a cell away from them, in x
and in y. Cells that only share an edge with them stay free.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import math
import os
from pathlib import Path
import shutil
import tempfile

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.objects import Role
from crgame_ros.geometry.outline import placed_polygon
from crgame_ros.occupancy.map_file import INDEX_NAME, map_text, RasterSpec, read_map_file
from crgame_ros.occupancy.sources import MAX_TILES, tile_name, write_pgm
from crgame_ros.roads.surface import (
    filled,
    lanelet_polygons,
    polygons_of,
    road_surface,
    seam_patches,
    SEAM_WIDTH,
)
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
import numpy as np
from numpy.typing import NDArray
import shapely

# Parts of the outline within this distance of a road's end belong to it [m].
END_TOLERANCE = 0.02
OCCUPIED, FREE = 0, 255
INDEX_IMAGE = 'tiles.pgm'
COMMENT = """\
Permanent obstacles of {name}: curbs {curbs}, obstacles {obstacles}.
Each pixel of the image is a tile of {tile:g} m. A black one has a map of its own beside this
file, tile_ROW_COLUMN.yaml, counted from 0 at the lower left: {cells} x {cells} cells of
{resolution:g} m."""

Progress = Callable[[int, int], None]


def curbs(network: LaneletNetwork, origin: tuple[float, float], spec: RasterSpec
          ) -> list[shapely.Polygon]:
    """
    Return bands along the outside of the road.

    The road is that of the road compliance check: the union of all lanelets with closed seams.
    Here gaps between lanelets up to the size of the smallest island are closed as well. The band
    stays open where the road ends with the map: where neither a lanelet nor any lanelet beside it
    continues.

    :param origin: position (x, y) to which the polygons are relative [m]
    :param spec: width of the curbs, smallest island, and whether ends are closed.
    :return: polygons that touch the road but do not overlap it.
    """
    polygons = lanelet_polygons(network.lanelets, origin)
    surface = filled(road_surface(polygons, seam_patches(shapely.union_all(polygons))),
                     lambda hole: hole.area < spec.min_island)
    outline = surface.boundary
    if not spec.close_ends:
        outline = _without(outline, road_ends(network, origin))
    return polygons_of(outline.buffer(spec.curb_width, cap_style='flat').difference(surface))


def road_ends(network: LaneletNetwork, origin: tuple[float, float]) -> shapely.MultiLineString:
    """
    Return the lines at which roads end with the map.

    :param origin: position (x, y) to which the lines are relative [m]
    """
    known = {lanelet.lanelet_id: lanelet for lanelet in network.lanelets}
    lines = []
    for lanelet in network.lanelets:
        for row, is_exit in ((0, False), (-1, True)):
            if not _leads_on(lanelet, is_exit, known):
                ends = (lanelet.left_vertices[row, :2], lanelet.right_vertices[row, :2])
                lines.append(shapely.LineString([end - origin for end in ends]))
    return shapely.MultiLineString(lines)


def _leads_on(lanelet: Lanelet, is_exit: bool, known: dict[int, Lanelet]) -> bool:
    """Return whether a lanelet, or one beside it, continues beyond this end."""
    pending, seen = [(lanelet, is_exit)], {lanelet.lanelet_id}
    while pending:
        here, out = pending.pop()
        if here.successor if out else here.predecessor:
            return True
        for other, same in ((here.adj_left, here.adj_left_same_direction),
                            (here.adj_right, here.adj_right_same_direction)):
            if other in known and other not in seen:
                seen.add(other)
                pending.append((known[other], out if same else not out))
    return False


def _without(outline: shapely.Geometry, ends: shapely.MultiLineString) -> shapely.Geometry:
    """Return the outline without road ends."""
    cut = ends.buffer(END_TOLERANCE, cap_style='flat')
    pieces = shapely.get_parts(shapely.line_merge(outline.difference(cut)))
    # Where lanelets end beside each other, seams between them leave small remains of the end.
    crumb = (shapely.length(pieces) < 2.0 * SEAM_WIDTH) \
        & shapely.dwithin(pieces, ends, SEAM_WIDTH)
    return shapely.MultiLineString(pieces[~crumb].tolist())


# Cells are reduced by this on all sides [cells], so that a shape that only touches one is outside.
INSET = 1e-6


class Raster:
    """
    The permanent obstacles of a scenario, cut into tiles.

    :raises InputError: if there is nothing to draw, or the map is too wide.
    """

    def __init__(self, loaded: LoadedScenario, spec: RasterSpec) -> None:
        self.spec = spec
        # Relative to the road numbers are small, even on maps in projected coordinates.
        near = loaded.scenario.lanelet_network.lanelets[0].center_vertices[0][:2].tolist()
        shapes = _permanent_shapes(loaded, spec, (near[0], near[1]))
        if not shapes:
            raise InputError('has nothing to draw', loaded.source,
                             'draw curbs too, or give a scenario with static obstacles')
        low_x, low_y, high_x, high_y = shapely.total_bounds(shapes).tolist()
        self.origin = (_on_lattice(near[0] + low_x, spec.resolution),
                       _on_lattice(near[1] + low_y, spec.resolution))
        shift = (near[0] - self.origin[0], near[1] - self.origin[1])
        self.columns = max(1, math.ceil((high_x + shift[0]) / spec.tile))
        self.rows = max(1, math.ceil((high_y + shift[1]) / spec.tile))
        if self.rows * self.columns > MAX_TILES:
            raise InputError(
                f'the map is {high_x - low_x:.0f} m x {high_y - low_y:.0f} m wide, which makes '
                f'{self.columns} x {self.rows} tiles', loaded.source, 'give a larger --tile')
        self._shapes = np.array([shapely.transform(shape, lambda points: points + shift)
                                 for shape in shapes], dtype=object)
        shapely.prepare(self._shapes)
        columns, rows = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        boxes = shapely.box(columns.ravel() * spec.tile, rows.ravel() * spec.tile,
                            (columns.ravel() + 1) * spec.tile, (rows.ravel() + 1) * spec.tile)
        found = shapely.STRtree(self._shapes).query(boxes, predicate='intersects')
        self._near: dict[int, list[int]] = {}
        for tile, shape in found.T.tolist():
            self._near.setdefault(tile, []).append(shape)

    @property
    def candidates(self) -> int:
        """Return the number of tiles to draw; some of them may be empty."""
        return len(self._near)

    def tiles(self) -> Iterator[tuple[int, int, NDArray[np.bool_] | None]]:
        """
        Yield the tiles, row by row from the lower left.

        :return: row, column and (tile_cells, tile_cells) cells, whose row indices grow with y;
            None in place of the cells if none is occupied.
        """
        spec = self.spec
        for tile in sorted(self._near):
            row, column = divmod(tile, self.columns)
            occupied = np.zeros((spec.tile_cells, spec.tile_cells), dtype=bool)
            for shape in sorted(self._near[tile]):
                draw(self._shapes[shape], (column * spec.tile, row * spec.tile), spec.resolution,
                     occupied)
            yield row, column, occupied if occupied.any() else None


def draw(shape: shapely.Geometry, origin: tuple[float, float], resolution: float,
         occupied: NDArray[np.bool_]) -> None:
    """
    Occupy every cell whose interior intersects a shape.

    The area is divided into quarters recursively: parts outside the shape are dropped, parts
    within it are filled.

    :param shape: prepared, for speed.
    :param origin: lower left corner of the cells [m]
    :param resolution: edge of a cell [m]
    :param occupied: (rows, columns), changed in place; rows grow with y.
    """
    inset = INSET * resolution
    # Columns: first row, row after the last, first column, column after the last.
    parts = np.array([[0, occupied.shape[0], 0, occupied.shape[1]]])
    while len(parts):
        low, high, left, right = parts.T * resolution
        boxes = shapely.box(origin[0] + left + inset, origin[1] + low + inset,
                            origin[0] + right - inset, origin[1] + high - inset)
        meets = shapely.intersects(shape, boxes)
        parts, boxes = parts[meets], boxes[meets]
        single = (parts[:, 1] - parts[:, 0] == 1) & (parts[:, 3] - parts[:, 2] == 1)
        occupied[parts[single, 0], parts[single, 2]] = True
        parts, boxes = parts[~single], boxes[~single]
        filled = shapely.contains_properly(shape, boxes)
        for low_row, high_row, first, behind in parts[filled].tolist():
            occupied[low_row:high_row, first:behind] = True
        parts = _quartered(parts[~filled])


def _quartered(parts: NDArray[np.int64]) -> NDArray[np.int64]:
    low, high, left, right = parts.T
    # Rounded up, so that a part one cell wide is not split: its second half is empty.
    row, column = (low + high + 1) // 2, (left + right + 1) // 2
    quarters = np.concatenate([
        np.stack(ends, axis=1) for ends in (
            (low, row, left, column), (low, row, column, right),
            (row, high, left, column), (row, high, column, right))])
    return quarters[(quarters[:, 0] < quarters[:, 1]) & (quarters[:, 2] < quarters[:, 3])]


def _permanent_shapes(loaded: LoadedScenario, spec: RasterSpec, origin: tuple[float, float]
                      ) -> list[shapely.Geometry]:
    shapes: list[shapely.Geometry] = []
    if spec.curbs:
        shapes += curbs(loaded.scenario.lanelet_network, origin, spec)
    if spec.obstacles:
        obstacles = ScenarioObstacles(loaded)
        poses = obstacles.states_at(obstacles.first_k).poses.tolist()
        shapes += [placed_polygon(item.shape, x - origin[0], y - origin[1], yaw)
                   for item, (x, y, yaw) in zip(obstacles.descriptions, poses, strict=True)
                   if item.role is Role.STATIC]
    return shapes


def _on_lattice(coordinate: float, resolution: float) -> float:
    """Round down to a multiple of the resolution, in decimals that a person can read."""
    return round(math.floor(coordinate / resolution + INSET) * resolution, 9)


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
        is_map = read_map_file(folder).entry.tile_cells is not None
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
