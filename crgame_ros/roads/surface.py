# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The road as a surface: the union of all lanelets, closed over the seams between them."""

from collections.abc import Callable, Iterable, Sequence

from commonroad.scenario.lanelet import Lanelet
import numpy as np
from numpy.typing import NDArray
import shapely

# Converted maps leave slits between neighbouring lanelets, a few millimetres to centimetres
# wide; no vehicle leaves the road through one of them. Ditches and kerbs are wider.
SEAM_WIDTH = 0.1
# Patches reach this far into the lanelets around them, so that no slit of rounding width remains.
PATCH_OVERLAP = 1e-3


def lanelet_ring(lanelet: Lanelet) -> NDArray[np.float64]:
    """Return the bounds of a lanelet (n, 2), along the left and back along the right one [m]."""
    return np.concatenate((lanelet.left_vertices[:, :2], lanelet.right_vertices[::-1, :2]))


def lanelet_areas(lanelets: Iterable[Lanelet], origin: tuple[float, float] = (0.0, 0.0),
                  ) -> NDArray[np.object_]:
    """
    Build one valid geometry of each lanelet (L); one that crosses itself is repaired.

    :param lanelets: lanelets with at least two vertices on either side.
    :param origin: position (x, y) to which the areas are relative [m]
    """
    areas = np.array([shapely.Polygon(lanelet_ring(lanelet) - origin) for lanelet in lanelets],
                     dtype=object)
    invalid = ~shapely.is_valid(areas)
    areas[invalid] = shapely.make_valid(areas[invalid])
    return areas


def lanelet_polygons(lanelets: Iterable[Lanelet], origin: tuple[float, float]
                     ) -> list[shapely.Polygon]:
    """
    Build valid polygons of lanelets; one that crosses itself becomes several.

    Parameters as of `lanelet_areas`.
    """
    return polygons_of(lanelet_areas(lanelets, origin))


def seam_patches(surface: shapely.Geometry) -> list[shapely.Polygon]:
    """Find polygons that cover every slit and hole in a surface narrower than `SEAM_WIDTH`."""
    gaps = polygons_of(_closed(surface).difference(surface))
    # A hole of rounding width is lost in the difference, so holes are checked one by one.
    gaps += [hole for hole in _holes(surface) if _is_narrow(hole)]
    # The outline of a gap is widened, not the gap: a polygon of rounding width widens to nothing.
    covers = shapely.union_all([*gaps, *(gap.exterior.buffer(PATCH_OVERLAP) for gap in gaps)])
    return [shapely.Polygon(cover.exterior) for cover in polygons_of(covers)]


def road_surface(polygons: Sequence[shapely.Polygon],
                 patches: Sequence[shapely.Polygon]) -> shapely.Geometry:
    """Return polygons and patches as one surface, prepared for tests of containment."""
    # The union has new holes of rounding width along the edges of the patches.
    surface = filled(shapely.union_all([*polygons, *patches]), _is_narrow)
    shapely.prepare(surface)
    return surface


def filled(surface: shapely.Geometry,
           is_small: Callable[[shapely.Polygon], bool]) -> shapely.MultiPolygon:
    """Return a surface without its small holes."""
    return shapely.MultiPolygon([
        shapely.Polygon(part.exterior, [hole.exterior for hole in _holes(part)
                                        if not is_small(hole)])
        for part in polygons_of(surface)])


def polygons_of(geometry: shapely.Geometry | NDArray[np.object_]) -> list[shapely.Polygon]:
    """Return the polygons with an area in a geometry, or in an array of geometries."""
    parts = shapely.get_parts(shapely.get_parts(geometry))
    is_polygon = shapely.get_type_id(parts) == shapely.GeometryType.POLYGON
    return parts[is_polygon & (shapely.area(parts) > 0.0)].tolist()


def _closed(surface: shapely.Geometry) -> shapely.Geometry:
    half = 0.5 * SEAM_WIDTH
    return surface.buffer(half, join_style='mitre').buffer(-half, join_style='mitre')


def _is_narrow(hole: shapely.Polygon) -> bool:
    return bool(hole.buffer(-0.5 * SEAM_WIDTH).is_empty)


def _holes(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    return [shapely.Polygon(ring)
            for polygon in polygons_of(geometry) for ring in polygon.interiors]
