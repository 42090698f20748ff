# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The roads as the page gets them: lanelets, the slits between them, and stop lines."""

from collections.abc import Mapping
from typing import Any

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork, LineMarking
from crgame_ros.cockpit.flat_points import flat, Points, simplified
from crgame_ros.roads.road_network import RoadNetwork
from crgame_ros.roads.road_surface import lanelet_areas
from crgame_ros.roads.signs import stop_line_ends
from crgame_ros.scenario.heights import LaneletHeights
import numpy as np
import shapely

Document = dict[str, Any]

# A hole in the road that is narrower is a gap of the map [m].
_GAP_WIDTH = 0.8


def lanelet_entries(network: LaneletNetwork,
                    heights: Mapping[int, LaneletHeights]) -> list[Document]:
    """
    Describe the lanelets in their order: bounds, markings, neighbours.

    :param heights: of those lanelets that have any
    """
    roads = RoadNetwork(network)
    crossing = {
        int(lanelet_id) for intersection in network.intersections
        for incoming in intersection.incomings
        for successors in (incoming.successors_left, incoming.successors_straight,
                           incoming.successors_right)
        for lanelet_id in successors or ()}
    return [_lanelet(lanelet, roads, crossing, heights.get(int(lanelet.lanelet_id)))
            for lanelet in network.lanelets]


def _lanelet(lanelet: Lanelet, roads: RoadNetwork, crossing: set[int],
             heights: LaneletHeights | None) -> Document:
    lanelet_id = int(lanelet.lanelet_id)
    types = sorted(kind.value for kind in lanelet.lanelet_type)
    left = simplified(_raised(lanelet.left_vertices, None if heights is None else heights.left))
    right = simplified(_raised(lanelet.right_vertices, None if heights is None else heights.right))
    return {
        'id': lanelet_id,
        'left': flat(left[:, :2]), 'right': flat(right[:, :2]),
        'center': flat(simplified(lanelet.center_vertices[:, :2])), 'types': types,
        'left_z': _heights(left), 'right_z': _heights(right),
        'left_line': marking_name(lanelet.line_marking_left_vertices),
        'right_line': marking_name(lanelet.line_marking_right_vertices),
        'one_way': not lanelet.user_bidirectional,
        'speed_limit': roads.speed_limit(lanelet_id),
        'intersection': lanelet_id in crossing or 'intersection' in types,
        'adj_left': lanelet.adj_left, 'adj_left_same': bool(lanelet.adj_left_same_direction),
        'adj_right': lanelet.adj_right, 'adj_right_same': bool(lanelet.adj_right_same_direction),
        'successors': [int(number) for number in lanelet.successor]}


def _raised(vertices: Points, heights: Points | None) -> Points:
    """Return the vertices their heights, if they have any: (N, 3), else (N, 2) [m]."""
    return vertices[:, :2] if heights is None else np.column_stack((vertices[:, :2], heights))


def _heights(vertices: Points) -> list[float] | None:
    """Return a bound's heights [m]; None of a lanelet that is flat."""
    return flat(vertices[:, 2]) if vertices.shape[1] > 2 else None


def gap_outlines(network: LaneletNetwork) -> list[list[float]]:
    """
    Return the slits between lanelets that are no ground to the eye, only cracks in the map.

    They are for display alone: whether a vehicle is on the road is not decided with them.
    """
    road = shapely.union_all(lanelet_areas(network.lanelets))
    holes = [shapely.Polygon(ring) for part in getattr(road, 'geoms', [road])
             if part.geom_type == 'Polygon' for ring in part.interiors]
    return [flat(np.asarray(hole.exterior.coords)[:-1, :2]) for hole in holes
            if hole.buffer(-0.5 * _GAP_WIDTH).is_empty]


def stop_line_entries(network: LaneletNetwork) -> list[Document]:
    """Describe the stop lines: their ends, how they are painted, and whose they are."""
    return [{'points': flat(stop_line_ends(lanelet)), 'lanelet': int(lanelet.lanelet_id),
             'line': marking_name(lanelet.stop_line.line_marking)}
            for lanelet in network.lanelets if lanelet.stop_line is not None]


def marking_name(marking: LineMarking | None) -> str:
    """Name a line marking as CommonRoad's files do."""
    return 'no_marking' if marking is None else str(marking.value)
