# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lanes beside a path, and the first lane change of a route."""

from collections.abc import Iterator
from dataclasses import replace
from enum import auto, Enum
import math
from typing import Literal, NamedTuple, TypeAlias

from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.messages.plan import PlanRequest
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.path_following import covering_steps
from crgame_ros.planner.path_obstacles import Corridor, ObstacleProjector
from crgame_ros.planner.reference_path import CHANGE_MIN, DrivingPath, plan_driving_path
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Reach: TypeAlias = Literal['lane', 'lanes', 'carriageway']

ROAD_MARGIN = 0.2
# Distance between the samples of widths [m].
SPACING = 5.0
# Least and greatest distance between the centre lines of lanes side by side [m].
NEAREST, FARTHEST = 2.0, 6.0
# Vehicles that come into the lane within this time count as well [s].
LOOK_AHEAD_S = 1.0
BEHIND, AHEAD = 120.0, 120.0
SIDE_MARGIN = 0.4
# Least gap [m], and least headway of the follower and to the leader [s].
SHORTEST = 2.0
HEADWAY_BEHIND_S, HEADWAY_AHEAD_S = 0.6, 0.4
# A faster follower reacts after this time [s] and brakes no harder than this [m/s^2].
REACTION_S = 0.7
DECELERATION = 2.5


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


def has_gap(projector: ObstacleProjector, path: ReferencePath, request: PlanRequest, s: float,
            offset: float, vehicle: VehicleParameters, ahead_too: bool = True) -> bool:
    """
    Return whether the ego may change into the lane beside it.

    It may if no vehicle is beside it there, and if the gaps to follower and leader are so large
    that the vehicle behind in each keeps `SHORTEST` with a late reaction and moderate braking.

    :param path: runs along the lane, at a constant distance.
    :param s: arc length of the ego's rear axle [m]
    :param offset: of the lane's centre line to the left of the path [m]
    :param ahead_too: False if the caller itself checks the vehicle ahead.
    """
    speed = max(request.ego.speed, 0.0)
    rear, front = vehicle.rear, vehicle.front
    corridor = Corridor(s, offset, 1.0, AHEAD, 0.5 * vehicle.width + SIDE_MARGIN, front,
                        offset, BEHIND)
    steps = 1 + covering_steps(LOOK_AHEAD_S, request.time_step_s)
    others = projector.project(path, corridor, request, steps)
    for column in range(len(others.ids)):
        at = int(np.argmax(others.blocking[:, column]))
        here = s + speed * request.time_step_s * at
        behind = here + rear - float(others.front[at, column])
        ahead = float(others.rear[at, column]) - here - front
        other = float(others.speed[at, column])
        if behind >= ahead:
            needed = SHORTEST + HEADWAY_BEHIND_S * max(other, 0.0) + _closing(other - speed)
        elif ahead > 0.0 and not ahead_too:
            continue
        else:
            needed = SHORTEST + HEADWAY_AHEAD_S * speed + _closing(speed - other)
        if max(behind, ahead) < needed:
            return False
    return True


def _closing(speed: float) -> float:
    """Return the distance lost while reacting and braking down a closing speed [m]."""
    faster = max(speed, 0.0)
    return REACTION_S * faster + faster ** 2 / (2.0 * DECELERATION)


# Beyond this offset from its lane's centre line a change is under way. It is done when the vehicle
# is nearer to the other lane's centre line by this [m].
UNDER_WAY = 0.5
NEARER = 0.5
# The search for a gap begins this time before the change [s], but at least this distance [m].
NOTICE_S, NOTICE = 1.0, 5.0
# Reserve at the end of a lane behind the last place for the change [m].
RESERVE = 5.0


class Verdict(Enum):
    """The state of a lane change."""

    FAR = auto()
    FREE = auto()
    BLOCKED = auto()
    UNDER_WAY = auto()
    DONE = auto()


class LaneChange:
    """
    The first lane change of a path.

    :param driving: the path with the change.
    :param start: where the path was planned from.
    :param projector: of the obstacles.
    """

    def __init__(self, context: PlannerContext, driving: DrivingPath, start: VehicleState,
                 projector: ObstacleProjector) -> None:
        assert driving.change_to is not None
        self._vehicle = context.vehicle
        self._projector = projector
        self._target = driving.roads.line(driving.change_to)
        kept = plan_driving_path(context.scenario, context.planning_problem, start,
                                 context.vehicle, keep_lane=True)
        if np.isfinite(kept.end_s):
            # The rest of the lane must suffice for the change, from rest.
            last = kept.end_s - CHANGE_MIN - RESERVE
            kept = replace(kept, end_s=max(last, min(kept.start_s + 2.0 * CHANGE_MIN,
                                                     kept.end_s - RESERVE)))
        self.kept = kept
        self._begin = driving.change_s - driving.start_s + kept.start_s
        self._s = kept.start_s

    def judge(self, request: PlanRequest) -> Verdict:
        """Return the present state of the change."""
        ego = request.ego
        here = np.array([[ego.x, ego.y]])
        path = self.kept.path
        s, d = (float(value[0]) for value in path.project(here, self._s - 20.0, self._s + 60.0))
        self._s = s
        speed = max(ego.speed, 0.0)
        if s < self._begin - max(NOTICE, NOTICE_S * speed):
            return Verdict.FAR
        place = path.pose_at(np.array([s]))[:, :2]
        offset = -float(self._target.project(place)[1][0])
        if abs(offset - d) < abs(d) - NEARER:
            return Verdict.DONE
        if abs(d) > UNDER_WAY and d * offset > 0.0:
            return Verdict.UNDER_WAY
        free = has_gap(self._projector, path, request, s, offset, self._vehicle)
        return Verdict.FREE if free else Verdict.BLOCKED
