# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lanes beside a path that a vehicle may use, and the width of the carriageway."""

from collections.abc import Iterator
import math
from typing import Literal, NamedTuple, TypeAlias

from crgame_ros.planner.reference_path import DrivingPath
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.vehicle.parameters import VehicleParameters
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Reach: TypeAlias = Literal['lane', 'lanes', 'carriageway']

ROAD_MARGIN = 0.2
# Distance between the samples of widths [m].
SPACING = 5.0
# Least and greatest distance between the centre lines of lanes side by side [m].
NEAREST, FARTHEST = 2.0, 6.0


class SideLane(NamedTuple):
    """
    A lane beside the path.

    :param offset: of its centre line to the left of the path [m]
    :param end_s: arc length of the path up to which the lane goes on beside it [m]
    """

    offset: float
    end_s: float


OWN_LANE = SideLane(0.0, math.inf)


def side_lanes(driving: DrivingPath, s: float, vehicle: VehicleParameters) -> list[SideLane]:
    """
    List the lanes of the same direction beside the path at an arc length, the left one first.

    :param s: [m]
    """
    roads, spans = driving.roads, driving.lanelet_spans
    inside = np.flatnonzero((spans[:, 0] <= s) & (s <= spans[:, 1]))
    if not len(inside):
        return []
    first = int(inside[0])
    point = driving.path.pose_at(np.array([s]))[:, :2]
    found = []
    for neighbour_of in (RoadNetwork.left_of, RoadNetwork.right_of):
        beside = neighbour_of(roads, driving.lanelets[first])
        if beside is None or not roads.is_drivable(beside):
            continue
        along, aside = roads.line(beside).project(point)
        offset = -float(aside[0])
        if (NEAREST < abs(offset) < FARTHEST
                and roads.width_at(beside, float(along[0])) > vehicle.width + 2.0 * ROAD_MARGIN):
            found.append(SideLane(offset, _end(driving, first, neighbour_of)))
    return found


def _end(driving: DrivingPath, first: int, neighbour_of: object) -> float:
    """Return the arc length up to which the path's lanelets have that neighbour."""
    roads = driving.roads
    beside = neighbour_of(roads, driving.lanelets[first])  # type: ignore[operator]
    for index in range(first, len(driving.lanelets)):
        if index == len(driving.lanelets) - 1:
            return np.inf
        following = driving.lanelets[index + 1]
        successors = roads.lanelet_network.find_lanelet_by_id(beside).successor
        beside = neighbour_of(roads, following)  # type: ignore[operator]
        if beside not in successors:
            return float(driving.lanelet_spans[index, 1])
    return np.inf


def road_bounds(driving: DrivingPath, vehicle: VehicleParameters, reach: Reach) -> Array:
    """
    Return how far the rear axle may leave the path within the lanes that the vehicle may use.

    :param reach: its lane alone, also the neighbours of the same direction, or also those of the
        other direction.
    :return: (N, 2) least and greatest offset at the path's samples [m]
    """
    s = driving.path.s
    bounds = np.zeros((len(s), 2))
    reserve = 0.5 * vehicle.width + ROAD_MARGIN
    for lanelet, (first, last) in zip(driving.lanelets, driving.lanelet_spans, strict=True):
        inside = (s >= first) & (s <= last)
        if not inside.any():
            continue
        at = np.append(np.arange(first, last, SPACING), last)
        points = driving.path.pose_at(at)[:, :2]
        along, aside = driving.roads.line(lanelet).project(points)
        widths = np.array([list(_widths(driving.roads, lanelet, float(place), reach))
                           for place in along])
        half = 0.5 * widths[:, 0]
        # The path is not in the lane's middle while it changes lanes.
        right = np.maximum(half + aside - reserve + widths[:, 1], 0.0)
        left = np.maximum(half - aside - reserve + widths[:, 2], 0.0)
        bounds[inside] = np.column_stack((np.interp(s[inside], at, -right),
                                          np.interp(s[inside], at, left)))
    return bounds


def _widths(roads: RoadNetwork, lanelet: int, s: float, reach: Reach) -> Iterator[float]:
    """Yield the widths of a lanelet and of its usable neighbours on the right and left [m]."""
    own = roads.lanelet_network.find_lanelet_by_id(lanelet)
    yield roads.width_at(lanelet, s)
    for neighbour, same_way in ((own.adj_right, own.adj_right_same_direction),
                                (own.adj_left, own.adj_left_same_direction)):
        usable = (neighbour in roads.lanelet_ids and roads.is_drivable(neighbour)
                  and reach != 'lane' and (same_way or reach == 'carriageway'))
        place = s if same_way or not usable else roads.line(neighbour).length - s
        yield roads.width_at(neighbour, place) if usable else 0.0
