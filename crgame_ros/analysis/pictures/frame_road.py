# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The road in frames: its surface, its edges and the lines between lanes, cut to a window."""

from collections.abc import Iterator
from typing import NamedTuple

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork, LineMarking
from crgame_ros.analysis.pictures.frame_window import FrameWindow
from crgame_ros.roads.road_surface import (
    lanelet_polygons,
    polygons_of,
    road_surface,
    seam_patches,
)
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

# Nobody sees smaller bends [m].
SIMPLIFIED = 0.03
_SOLID = (LineMarking.SOLID, LineMarking.BROAD_SOLID)


class RoadInWindow(NamedTuple):
    """
    A piece of road in a window's own coordinates [m].

    :param surfaces: rings of each piece of road: the outer one (n, 2), then those of its holes.
    :param bounds: lanelets' bounds that are neither edge nor line, as on junctions.
    :param dashed: lines between lanes that may be crossed.
    :param solid: lines between lanes that may not.
    :param edges: of the surface.
    """

    surfaces: tuple[tuple[FloatArray, ...], ...]
    bounds: tuple[FloatArray, ...]
    dashed: tuple[FloatArray, ...]
    solid: tuple[FloatArray, ...]
    edges: tuple[FloatArray, ...]


class PicturedRoad:
    """
    The road around where people drove.

    :param network: the scenario's.
    :param area: smallest x, smallest y, largest x, largest y of what will be shown [m]
    """

    def __init__(self, network: LaneletNetwork, area: tuple[float, float, float, float]) -> None:
        wanted = shapely.box(*area)
        lanelets = [item for item in network.lanelets
                    if shapely.box(*_extent(item)).intersects(wanted)]
        # In projected coordinates of millions of metres uniting would leave slits.
        self._origin = (area[0], area[1])
        polygons = lanelet_polygons(lanelets, self._origin)
        patches = seam_patches(shapely.union_all(polygons))
        self._surface = shapely.simplify(road_surface(polygons, patches), SIMPLIFIED)
        known = {item.lanelet_id for item in lanelets}
        lines: dict[str, list[shapely.LineString]] = {'bounds': [], 'dashed': [], 'solid': []}
        for kind, points in (line for item in lanelets for line in _lines(item, known)):
            lines[kind].append(shapely.LineString(points - self._origin))
        self._lines = {kind: shapely.simplify(shapely.MultiLineString(found), SIMPLIFIED)
                       for kind, found in lines.items()}
        self._lines['edges'] = shapely.boundary(self._surface)
        for geometry in (self._surface, *self._lines.values()):
            shapely.prepare(geometry)

    def within(self, window: FrameWindow) -> RoadInWindow:
        """Cut a window out of it."""
        cut = shapely.transform(window.polygon(margin=1.0), lambda points: points - self._origin)
        surfaces = tuple(
            tuple(self._seen(ring, window) for ring in (piece.exterior, *piece.interiors))
            for piece in polygons_of(shapely.intersection(self._surface, cut)))
        return RoadInWindow(surfaces, **{
            kind: tuple(self._seen(line, window) for line in shapely.get_parts(shapely.line_merge(
                shapely.intersection(lines, cut))) if isinstance(line, shapely.LineString))
            for kind, lines in self._lines.items()})

    def across(self, window: FrameWindow) -> tuple[float, float]:
        """Return from where to where road lies in a window, across it; 0, 0 without any [m]."""
        cut = shapely.transform(window.polygon(), lambda points: points - self._origin)
        points = shapely.get_coordinates(shapely.intersection(self._surface, cut))
        if not len(points):
            return 0.0, 0.0
        heights = window.of(points + self._origin)[:, 1]
        return float(heights.min()), float(heights.max())

    def _seen(self, line: shapely.LineString, window: FrameWindow) -> FloatArray:
        return window.of(shapely.get_coordinates(line) + self._origin)


def _extent(lanelet: Lanelet) -> list[float]:
    points = np.concatenate((lanelet.left_vertices[:, :2], lanelet.right_vertices[:, :2]))
    return [*points.min(axis=0).tolist(), *points.max(axis=0).tolist()]


def _lines(lanelet: Lanelet, known: set[int]) -> Iterator[tuple[str, FloatArray]]:
    """Yield what a lanelet's bounds are; of those that two lanelets share one tells."""
    for points, neighbour, same, marking in (
            (lanelet.left_vertices, lanelet.adj_left, lanelet.adj_left_same_direction,
             lanelet.line_marking_left_vertices),
            (lanelet.right_vertices, lanelet.adj_right, lanelet.adj_right_same_direction,
             lanelet.line_marking_right_vertices)):
        if neighbour not in known:
            yield 'bounds', points[:, :2]
        elif (points is lanelet.left_vertices) if same else lanelet.lanelet_id < neighbour:
            yield 'solid' if marking in _SOLID else 'dashed', points[:, :2]
