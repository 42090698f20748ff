# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The curbs of a lanelet network: bands along the outside of the road (FS II-A2)."""

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from crgame_ros.occupancy.occupancy_raster_spec import RasterSpec
from crgame_ros.roads.road_surface import (
    lanelet_polygons,
    polygons_of,
    road_surface,
    seam_patches,
    SEAM_WIDTH,
)
import shapely

# A piece of outline so close to the end of a road belongs to it [m].
END_TOLERANCE = 0.02


def curbs(network: LaneletNetwork, origin: tuple[float, float], spec: RasterSpec
          ) -> list[shapely.Polygon]:
    """
    Draw a band along the outside of the road.

    The road is that of the check of road compliance: all lanelets united, seams closed; here also
    gaps between lanelets up to the size of the smallest island. It stays open where it ends with
    the map, that is where neither a lanelet nor any lanelet beside it leads on.

    :param network: the lanelet network.
    :param origin: position (x, y) from which the polygons count [m]
    :param spec: width of the curbs, smallest island, and whether ends are closed.
    :return: polygons that touch the road but don't overlap it.
    """
    polygons = lanelet_polygons(network.lanelets, origin)
    surface = _without_gaps(road_surface(polygons, seam_patches(shapely.union_all(polygons))),
                            spec.min_island)
    outline = surface.boundary
    if not spec.close_ends:
        outline = _without(outline, road_ends(network, origin))
    return polygons_of(outline.buffer(spec.curb_width, cap_style='flat').difference(surface))


def road_ends(network: LaneletNetwork, origin: tuple[float, float]) -> shapely.MultiLineString:
    """
    Find the lines at which roads end with the map.

    :param network: the lanelet network.
    :param origin: position (x, y) from which the lines count [m]
    """
    known = {lanelet.lanelet_id: lanelet for lanelet in network.lanelets}
    lines = []
    for lanelet in network.lanelets:
        for row, is_exit in ((0, False), (-1, True)):
            if not _leads_on(lanelet, is_exit, known):
                ends = (lanelet.left_vertices[row, :2], lanelet.right_vertices[row, :2])
                lines.append(shapely.LineString([end - origin for end in ends]))
    return shapely.MultiLineString(lines)


def _without_gaps(surface: shapely.Geometry, min_island: float) -> shapely.MultiPolygon:
    """Fill the holes in a surface that are smaller than an island [m^2]."""
    return shapely.MultiPolygon([
        shapely.Polygon(part.exterior, [ring for ring in part.interiors
                                        if shapely.Polygon(ring).area >= min_island])
        for part in polygons_of(surface)])


def _leads_on(lanelet: Lanelet, is_exit: bool, known: dict[int, Lanelet]) -> bool:
    """Return whether a lanelet, or one beside it, has another one behind this end."""
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
    """Cut road ends out of the outline."""
    cut = ends.buffer(END_TOLERANCE, cap_style='flat')
    pieces = shapely.get_parts(shapely.line_merge(outline.difference(cut)))
    # Where lanelets end beside each other, seams between them leave crumbs of the end.
    crumb = (shapely.length(pieces) < 2.0 * SEAM_WIDTH) \
        & shapely.dwithin(pieces, ends, SEAM_WIDTH)
    return shapely.MultiLineString(pieces[~crumb].tolist())
