# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The drivable path of a planning problem: routed, smoothed, extended; and its speeds."""

from dataclasses import dataclass
from itertools import pairwise

from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.scenario import Scenario
from crgame_ros.errors import CrgameError, PlanningError
from crgame_ros.geometry.curve import arc_length, Curve
from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.route import find_route, goal_lanelets, in_lane, Route, start_lanelet
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
from crgame_ros.vehicle.stopping import SpeedEnvelope
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BEHIND = 30.0
BEYOND = 250.0
LENGTH = 1500.0
CHANGE_TIME = 4.0
CHANGE_MIN = 25.0
# At this distance from its lane's centre line a path has begun to change lanes [m].
BEGUN = 0.2
# Least desired speed on a road without signs: 30 km/h [m/s].
SLOWEST_DESIRED = 30.0 / 3.6
STEERING_RATE_SHARE = 0.6


@dataclass(frozen=True)
class DrivingPath:
    """
    The path that the rear axle follows, with data of the map along it.

    :param roads: the road network that it follows.
    :param path: the smooth path; it begins some way behind the vehicle.
    :param start_s: arc length at which the vehicle starts [m]
    :param end_s: arc length at which the road ends; infinite if it goes on [m]
    :param lanelets: ids of the lanelets passed.
    :param lanelet_spans: (n, 2) arc lengths at which each is entered and left [m]
    :param reaches_goal: True if the route leads to the goal's position.
    :param change_s: arc length at which its first lane change begins; infinite without one [m]
    :param change_to: lanelet into which it changes.
    :param changes: number of its lane changes.
    """

    roads: RoadNetwork
    path: ReferencePath
    start_s: float
    end_s: float
    lanelets: tuple[int, ...]
    lanelet_spans: Array
    reaches_goal: bool
    change_s: float = np.inf
    change_to: int | None = None
    changes: int = 0


def plan_driving_path(scenario: Scenario, problem: PlanningProblem | None, start: VehicleState,
                      vehicle: VehicleParameters, follow_lane: bool = False,
                      keep_lane: bool = False) -> DrivingPath:
    """
    Compute the route and the path of a planning problem.

    The path follows the centre lines to the goal and blends lane changes over a length that grows
    with the speed. It goes on beyond the goal for at least 200 m, along the straightest
    successors, then straight ahead where the map ends.

    :param start: where the vehicle is (rear axle); it need not be on the road.
    :param problem: None only with `follow_lane`.
    :param follow_lane: ignore the goal and follow the lane.
    :param keep_lane: follow the route up to its first lane change, and then the lane.
    :raises PlanningError: if the scenario has no lanelets or no usable geometry.
    """
    if not scenario.lanelet_network.lanelets:
        raise PlanningError('the scenario has no lanelets to follow')
    roads = RoadNetwork(scenario.lanelet_network)
    lanelet, s = start_lanelet(roads, start.x, start.y, start.yaw)
    goals = frozenset[int]() if follow_lane or problem is None \
        else goal_lanelets(roads, problem)
    route = find_route(roads, lanelet, s, goals, LENGTH)
    if keep_lane:
        route = in_lane(roads, route, LENGTH)
    change = max(CHANGE_MIN, CHANGE_TIME * abs(start.speed))
    try:
        line = _center_line(roads, route, s, change)
        before = _before(roads, lanelet, line)
        after = line[-1] + _direction(line[-3:]) * np.array([[10.0], [0.5 * BEYOND], [BEYOND]])
        # The largest steering angle bounds the curvature; a reserve is kept for corrections.
        bound = 0.8 * np.tan(vehicle.max_steering_angle) / vehicle.wheelbase
        path = ReferencePath.from_polyline(np.concatenate((before, line, after)),
                                           max_curvature=float(bound))
    except CrgameError as error:
        raise PlanningError(f'no path along lanelet {lanelet}: {error}') from error
    start_s = float(path.project(np.array([[start.x, start.y]]), 0.0, BEHIND + s + 20.0)[0][0])
    end_s = float(path.length - BEYOND) if route.road_ends else np.inf
    lanelets, spans = _spans(roads, route, path)
    change_s, change_to = _first_change(roads, route, path, spans)
    return DrivingPath(roads, path, start_s, end_s, lanelets, spans, route.goal is not None,
                       change_s, change_to, len(route.legs) - 1)


def _center_line(roads: RoadNetwork, route: Route, start_s: float, change: float) -> Array:
    """Join the centre lines of the legs, blending each lane change."""
    parts: list[Array] = []
    position = start_s
    entered = 0.0
    for index, leg in enumerate(route.legs):
        lines = [roads.line(lanelet) for lanelet in leg]
        points = np.concatenate([line.points for line in lines])
        if index:
            points = points[arc_length(points) > entered + 0.5]
            position = 0.0
        if index + 1 < len(route.legs):
            following = roads.line(route.legs[index + 1][0])
            s = arc_length(points)
            first = s[-1] - (lines[-1].length if len(leg) > 1 else s[-1])
            first = max(first, min(position, s[-1] - 5.0), 0.0)
            # Several changes in a row share the rest of the lane.
            share = 1 + _changes_in_row(route, index)
            last = min(first + change, first + (s[-1] - first) / share)
            blended, entered = _blend(points, s, following, first, last)
            points = np.concatenate((points[s < first - 0.1], blended))
        parts.append(points)
    return np.concatenate(parts)


def _changes_in_row(route: Route, index: int) -> int:
    """Count the further lane changes that must happen beside the same stretch of road."""
    count = 0
    for leg in route.legs[index + 1:-1]:
        if len(leg) > 1:
            break
        count += 1
    return count


def _blend(points: Array, s: Array, target: Curve, first: float,
           last: float) -> tuple[Array, float]:
    u = np.linspace(0.0, 1.0, max(8, int(last - first)))
    at = first + u * (last - first)
    here = np.column_stack((np.interp(at, s, points[:, 0]), np.interp(at, s, points[:, 1])))
    along, _ = target.project(here)
    there = target.pose_at(along)[:, :2]
    weight = (u ** 3 * (10.0 - 15.0 * u + 6.0 * u ** 2))[:, None]
    return here * (1.0 - weight) + there * weight, float(along[-1])


def _before(roads: RoadNetwork, lanelet: int, line: Array) -> Array:
    predecessor = roads.straightest_predecessor(lanelet)
    points = np.empty((0, 2))
    if predecessor is not None:
        points = roads.line(predecessor).points[:-1]
        ahead = arc_length(np.concatenate((points, line[:1])))
        points = points[ahead[-1] - ahead[:-1] < BEHIND]
    head = np.concatenate((points, line))[:3]
    return np.concatenate((head[:1] - _direction(head) * BEHIND, points))


def _direction(points: Array) -> Array:
    """Return the unit vector from the first to the last of a few points."""
    chord = points[-1] - points[0]
    return np.asarray(chord / max(float(np.hypot(*chord)), 1e-6))


def _spans(roads: RoadNetwork, route: Route,
           path: ReferencePath) -> tuple[tuple[int, ...], Array]:
    """Find where the path enters and leaves each lanelet, in order."""
    lanelets = tuple(lanelet for leg in route.legs for lanelet in leg)
    spans = np.empty((len(lanelets), 2))
    at = 0.0
    for row, lanelet in enumerate(lanelets):
        line = roads.line(lanelet)
        low, high = max(0.0, at - 60.0), at + line.length + 80.0
        ends, _ = path.project(line.points[[0, -1]], low, high)
        spans[row] = ends
        at = max(at, float(ends[1]))
    # The lanelets of a lane change run side by side: one span ends where the other begins.
    last = -1
    for leg, following in pairwise(route.legs):
        last += len(leg)
        spans[last, 1] = spans[last + 1, 0] = _crossing(
            roads, path, (leg[-1], following[0]), spans[last:last + 2])
    return lanelets, spans


def _first_change(roads: RoadNetwork, route: Route, path: ReferencePath,
                  spans: Array) -> tuple[float, int | None]:
    """Find where the path begins to leave its first lane, and the lanelet to which it changes."""
    if len(route.legs) < 2:
        return np.inf, None
    leg = route.legs[0]
    first, last = spans[len(leg) - 1]
    s = np.arange(max(first, 0.0), max(last, first + path.step), path.step)
    aside = np.abs(roads.line(leg[-1]).project(path.pose_at(s)[:, :2])[1])
    # From the crossing back to where the path is still in the lane's middle.
    inside = np.flatnonzero(aside < BEGUN)
    return float(s[inside[-1]] if len(inside) else s[0]), route.legs[1][0]


def _crossing(roads: RoadNetwork, path: ReferencePath, pair: tuple[int, int],
              spans: Array) -> float:
    """Find where the path is nearer to the second of two lanelets than to the first."""
    first = float(spans[:, 0].max())
    s = np.arange(first, max(float(spans[:, 1].min()), first + path.step), path.step)
    points = path.pose_at(s)[:, :2]
    aside = [np.abs(roads.line(lanelet).project(points)[1]) for lanelet in pair]
    over = np.flatnonzero(aside[1] < aside[0])
    return float(s[over[0]] if len(over) else s[-1])


def default_speed(problem: PlanningProblem) -> float:
    """
    Return the desired speed on roads without speed limits.

    It is the initial speed, the middle of the goal's speed interval or 30 km/h, whichever is
    largest, because a vehicle that starts from rest or in a queue has a low initial speed.

    :return: [m/s]
    """
    speeds = [SLOWEST_DESIRED, float(getattr(problem.initial_state, 'velocity', 0.0))]
    for state in problem.goal.state_list:
        interval = getattr(state, 'velocity', None)
        if interval is not None:
            low = getattr(interval, 'start', interval)
            speeds.append(0.5 * float(low + getattr(interval, 'end', low)))
    return max(speeds)


def desired_speeds(driving: DrivingPath, wanted: float | None, default: float) -> Array:
    """
    Return the desired speed along a path.

    :param wanted: the planner's option v0; None takes the signs, or the default without any [m/s]
    :param default: `default_speed` [m/s]
    :return: (N) at the path's samples, never above a speed limit [m/s]
    """
    s = driving.path.s
    speeds = np.full(len(s), np.nan)
    for lanelet, (first, last) in zip(driving.lanelets, driving.lanelet_spans, strict=True):
        limit = driving.roads.speed_limit(lanelet)
        if limit is not None:
            speeds[(s >= first) & (s <= last)] = limit
    if wanted is not None:
        return np.asarray(np.fmin(speeds, wanted))
    known = np.flatnonzero(~np.isnan(speeds))
    if not len(known):
        return np.full(len(s), default)
    # A lanelet without a sign keeps the limit of the one before it.
    before = np.searchsorted(known, np.arange(len(s)), side='right') - 1
    return np.where(before < 0, default, speeds[known[np.maximum(before, 0)]])


def admissible_speeds(driving: DrivingPath, desired: Array, vehicle: VehicleParameters,
                      lateral_acceleration: float, deceleration: float) -> Array:
    """
    Return the desired speed, lowered for curves and for lower speeds ahead.

    :param desired: (N) [m/s]
    :param vehicle: whose largest acceleration, less on a slippery road, limits the next two.
    :param lateral_acceleration: comfortable in curves [m/s^2]
    :param deceleration: towards a lower speed ahead [m/s^2]
    :return: (N) [m/s]
    """
    path = driving.path
    lateral_acceleration = min(lateral_acceleration, vehicle.max_acceleration)
    deceleration = min(deceleration, vehicle.max_acceleration)
    curvature = np.maximum(np.abs(path.curvature), 1e-6)
    slope = np.maximum(np.abs(np.gradient(path.curvature, path.step)), 1e-6)
    cos = 1.0 / np.hypot(1.0, vehicle.wheelbase * curvature)
    rate = STEERING_RATE_SHARE * vehicle.max_steering_rate
    limit = np.minimum(desired, np.sqrt(lateral_acceleration / curvature))
    limit = np.minimum(limit, rate / (vehicle.wheelbase * slope * cos ** 2))
    limit = np.clip(limit, 0.5, vehicle.max_speed)
    return SpeedEnvelope(path.s, limit, deceleration).speeds
