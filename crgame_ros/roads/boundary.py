# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The road boundary: checks whether a vehicle has left the road (CRG III-D b)."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
import math

from commonroad.scenario.lanelet import LaneletNetwork
from commonroad_dc import pycrcc
from crgame_ros.geometry.outline import Footprint, triangle_corners
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.surface import (
    lanelet_polygons,
    polygons_of,
    road_surface,
    seam_patches,
)
import numpy as np
from numpy.typing import NDArray
import shapely

# Polygons of a tile. Building time grows with the number and the bends: 10 to 80 ms for 150.
TILE_POLYGONS = 150
# Number of cached surfaces and tiles: batches of runs need those of their roads many times.
_KEPT_SURFACES, _KEPT_TILES = 8, 32
# How far the boundary object reaches beyond the road [m]; nothing is detected beyond.
BOUNDARY_MARGIN = 2000.0
# Smaller pieces make more triangles to build, larger ones more to check [m].
PIECE_SIZE = 20.0
# Greatest number of pieces along a side of the map.
MOST_PIECES = 4000


@dataclass(frozen=True)
class _Tile:
    """
    The boundary around one place, exact for every footprint inside its circle.

    Bounds and boundary are relative to the centre, for small numbers.

    :param x: centre, from the origin of the network [m]
    :param y: likewise [m]
    :param radius: distance to the nearest piece of road that was left out [m]
    :param bounds: smallest x, smallest y, largest x, largest y of the road inside [m]
    :param boundary: collision objects that cover everything but the road.
    """

    x: float
    y: float
    radius: float
    bounds: tuple[float, float, float, float]
    boundary: pycrcc.ShapeGroup

    def covers(self, x: float, y: float, reach: float) -> bool:
        """Return whether a circle around (x, y) lies inside the tile."""
        return math.hypot(x - self.x, y - self.y) + reach < self.radius


class RoadBoundary:
    """
    The road boundary of a lanelet network.

    Around the positions given to `prepare` the boundary is triangulated, and a check takes a few
    microseconds. Elsewhere a check tests whether the footprint lies within the united lanelets,
    which gives the same answer in about 20 microseconds. A check never builds anything.

    :param lanelet_network: the CommonRoad lanelet network; it is not changed.
    """

    def __init__(self, lanelet_network: LaneletNetwork) -> None:
        # All coordinates are relative to the first lanelet: in projected coordinates of millions
        # of metres the union of polygons has holes of rounding width.
        lanelets = lanelet_network.lanelets
        x, y = lanelets[0].left_vertices[0][:2].tolist() if lanelets else (0.0, 0.0)
        self._origin = (x, y)
        self._polygons = tuple(shapely.to_wkb(lanelet_polygons(lanelets, self._origin)).tolist())
        self._surface = _united(self._polygons)[1]
        self._tiles: list[_Tile] = []
        self._footprints: dict[Shape, Footprint] = {}

    def prepare(self, positions: Iterable[tuple[float, float]]) -> None:
        """
        Build the boundary around positions (x, y) [m] if it is missing, in some 10 ms each.

        A map of up to `TILE_POLYGONS` polygons is built as a whole at the first position.
        """
        for x_map, y_map in positions:
            x, y = x_map - self._origin[0], y_map - self._origin[1]
            if math.isfinite(x + y) and not any(
                    tile.covers(x, y, 0.5 * tile.radius if tile.radius < math.inf else 0.0)
                    for tile in self._tiles):
                self._tiles.append(_tile_at(self._polygons, x, y))

    def is_off_road(self, x_center: float, y_center: float, yaw: float, shape: Shape) -> bool:
        """
        Return whether any part of a footprint is off the road.

        :param x_center: centre of the vehicle, not its rear axle [m]
        :param y_center: likewise [m]
        :param yaw: [rad]
        :param shape: footprint around the centre.
        """
        footprint = self._footprint(shape)
        x, y = x_center - self._origin[0], y_center - self._origin[1]
        for tile in self._tiles:
            if tile.covers(x, y, footprint.radius):
                return _is_off(tile, footprint, x, y, yaw)
        return not shapely.contains(self._surface, footprint.polygon(x, y, yaw))

    def are_off_road(self, poses: NDArray[np.float64], shape: Shape) -> NDArray[np.bool_]:
        """
        Return for many footprints whether any part is off the road, in 2 microseconds each.

        :param poses: (S, 3) x [m], y [m] and yaw [rad] of their centres
        :return: (S)
        """
        outlines = self._footprint(shape).outlines(poses - (*self._origin, 0.0))
        # Most plans are on a straight road, where one area around all footprints decides.
        if len(poses) > 1 and np.isfinite(poses).all() and shapely.contains(
                self._surface, shapely.convex_hull(shapely.linestrings(outlines.reshape(-1, 2)))):
            return np.zeros(len(poses), dtype=bool)
        return ~shapely.contains(self._surface, shapely.polygons(outlines))

    def are_beyond(self, poses: NDArray[np.float64], shape: Shape,
                   distance: float) -> NDArray[np.bool_]:
        """
        Return for many footprints whether their overhang exceeds a distance [m].

        Other parameters are as in `are_off_road`; the overhang is that of `overhang`.
        """
        corners = self._footprint(shape).outlines(poses - (*self._origin, 0.0))
        near = shapely.dwithin(self._surface, shapely.points(corners), distance)
        return ~near.all(axis=1)

    def overhang(self, x_center: float, y_center: float, yaw: float, shape: Shape) -> float:
        """
        Return how far a footprint reaches beyond the road: 0 on it [m].

        It is the distance from the road to the footprint's farthest corner, even if the whole
        footprint is off the road; infinite without any road. Parameters as in `is_off_road`.
        """
        if not self._polygons:
            return math.inf
        # No point between the corners counts: a vehicle crosses a gap narrower than its footprint
        # and does not leave the road there.
        pose = np.array(((x_center - self._origin[0], y_center - self._origin[1], yaw),))
        corners = shapely.points(self._footprint(shape).outlines(pose))
        return float(shapely.distance(self._surface, corners).max())

    def _footprint(self, shape: Shape) -> Footprint:
        footprint = self._footprints.get(shape)
        if footprint is None:
            footprint = self._footprints.setdefault(shape, Footprint(shape))
        return footprint


# The cache depends only on lanelets and place, so that a check never depends on other runs.
@lru_cache(_KEPT_SURFACES)
def _united(polygons: tuple[bytes, ...]) -> tuple[NDArray[np.object_], shapely.Geometry]:
    """Return the pieces of road, polygons (WKB) and patches of their seams, and their union."""
    lanelets = shapely.from_wkb(polygons).tolist() if polygons else []
    patches = seam_patches(shapely.union_all(lanelets))
    return np.array([*lanelets, *patches], dtype=object), road_surface(lanelets, patches)


@lru_cache(_KEPT_TILES)
def _tile_at(polygons: tuple[bytes, ...], x: float, y: float) -> _Tile:
    pieces, _ = _united(polygons)
    distances = shapely.distance(pieces, shapely.Point(x, y))
    order = np.argsort(distances, kind='stable')
    chosen = shapely.transform(pieces[order[:TILE_POLYGONS]], lambda points: points - (x, y))
    radius = float(distances[order[TILE_POLYGONS]]) if len(order) > TILE_POLYGONS else math.inf
    bounds = shapely.total_bounds(chosen).tolist() if len(chosen) else [math.inf] * 4
    return _Tile(x, y, radius, (bounds[0], bounds[1], bounds[2], bounds[3]),
                 _triangulated_outside(chosen.tolist()))


def _is_off(tile: _Tile, footprint: Footprint, x: float, y: float, yaw: float) -> bool:
    x, y = x - tile.x, y - tile.y
    x_min, y_min, x_max, y_max = tile.bounds
    # A centre beyond the road's bounds decides alone, so that no margin is too small.
    if not (x_min <= x <= x_max and y_min <= y <= y_max):
        return True
    for part in footprint.at(x, y, yaw):
        if tile.boundary.collide(part):
            return True
    return False


def _triangulated_outside(pieces: list[shapely.Polygon]) -> pycrcc.ShapeGroup:
    """
    Triangulate everything outside the pieces, up to `BOUNDARY_MARGIN` around them.

    The drivability checker's own boundary merges the lanelets of a section by the outermost
    bounds, which cuts off parts of the road where neighbours differ in length (a ramp beside its
    motorway), fails on neighbours that are missing, and needs a package that must be compiled.
    """
    if not pieces:
        return pycrcc.ShapeGroup()
    surface = road_surface(pieces, ())
    inner = shapely.box(*surface.bounds)
    # Mitred, so that the frame has straight sides and its triangles stay out of the inner box.
    frame = inner.buffer(BOUNDARY_MARGIN, join_style='mitre').difference(inner)
    strips = triangle_corners(np.array([frame, *_cut(inner.difference(surface))]))
    # Triangles created here would belong to Python, which reports them as leaks at its exit.
    return pycrcc.Util.convert_tristrips_to_triangles([strips.tolist()], surface.bounds, 0)


def _cut(area: shapely.Geometry) -> list[shapely.Polygon]:
    """
    Halve an area until its pieces are small or rectangular.

    The checker finds triangles by their extents: it would test a long one across a bend in every
    check there.
    """
    done: list[shapely.Polygon] = []
    low_x, low_y, high_x, high_y = area.bounds if not area.is_empty else (0.0, 0.0, 0.0, 0.0)
    # Around roads of hundreds of kilometres small pieces would be millions.
    smallest = max(PIECE_SIZE, max(high_x - low_x, high_y - low_y) / MOST_PIECES)
    pending = np.array(polygons_of(area), dtype=object)
    while len(pending):
        bounds = shapely.bounds(pending)
        size = bounds[:, 2:] - bounds[:, :2]
        large = (size.max(axis=1) > smallest) \
            & (shapely.area(pending) < (1.0 - 1e-9) * size.prod(axis=1))
        done += pending[~large].tolist()
        rows, axis = np.flatnonzero(large), size[large].argmax(axis=1)
        middle = bounds[rows, axis] + 0.5 * size[rows, axis]
        low, high = bounds.copy(), bounds.copy()
        low[rows, axis + 2] = high[rows, axis] = middle
        halves = shapely.box(*np.concatenate((low[rows], high[rows])).T)
        pending = np.array(polygons_of(shapely.intersection(np.tile(pending[rows], 2), halves)),
                           dtype=object)
    return done
