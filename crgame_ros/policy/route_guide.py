# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The route of a seat: the vehicle's place on it, the speed limit and the distance to the goal."""

import math
from typing import NamedTuple

from commonroad.geometry.shape import Shape
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.scenario import Scenario
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.planner.reference_path import (
    default_speed,
    desired_speeds,
    DrivingPath,
    plan_driving_path,
    SLOWEST_DESIRED,
)
from crgame_ros.policy.observation_spec import FAR
from crgame_ros.roads.route import goal_lanelets
from crgame_ros.scenario.exact_values import group_outline
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import shapely

# A path that goes on is planned anew when less than this is left of it [m].
RESERVE = 300.0
# A vehicle farther than this beside the route, or that has moved farther than this at once, is
# searched on the whole route [m].
LOST, JUMP = 10.0, 20.0


class RoutePlace(NamedTuple):
    """
    The place of a vehicle on its route.

    :param s: arc length of the rear axle [m]
    :param d: its offset to the left [m]
    :param heading_error: of the vehicle from the route, in (-pi, pi] [rad]
    :param curvature: of the route there [1/m]
    :param speed_limit: there [m/s]
    :param goal_distance: along the route, 1000 m at most [m]
    :param progress: distance along the route since the previous place [m]
    """

    s: float
    d: float
    heading_error: float
    curvature: float
    speed_limit: float
    goal_distance: float
    progress: float


class _Route(NamedTuple):
    """
    A planned route.

    :param driving: its path.
    :param limits: speed limits at the path's points [m/s]
    :param goal_s: arc length at which it reaches the goal; inf without one [m]
    """

    driving: DrivingPath
    limits: list[float]
    goal_s: float


class RouteGuide:
    """
    The route of one vehicle, on which its place is tracked.

    An AV's route leads to the goal of its planning problem, a human's along its lane.

    :param scenario: with at least one lanelet.
    :param problem: None follows the lane.
    :param start: initial state of the vehicle, rear axle, scenario coordinates.
    :raises PlanningError: if there is no road to follow.
    """

    def __init__(self, scenario: Scenario, problem: PlanningProblem | None, start: VehicleState,
                 vehicle: VehicleParameters) -> None:
        self._scenario, self._problem, self._vehicle = scenario, problem, vehicle
        self._first = self._route = self._planned(start)
        self._s = self._search(start)

    @property
    def driving(self) -> DrivingPath:
        """Return the present path, which is planned anew near its end if the road goes on."""
        return self._route.driving

    @property
    def first(self) -> DrivingPath:
        """Return the path with which every drive starts."""
        return self._first.driving

    def restart(self, state: VehicleState) -> None:
        """Start another drive on the first route."""
        self._route = self._first
        self._s = self._search(state)

    def follow(self, state: VehicleState) -> RoutePlace:
        """Return the vehicle's present place, searched near the previous one."""
        path, before = self.driving.path, self._s
        s, d, heading = path.locate(state.x, state.y, before)
        if not (abs(d) < LOST and abs(s - before) < JUMP):
            s, d, heading = path.locate(state.x, state.y, self._search(state))
        progress = s - before
        if math.isinf(self.driving.end_s) and s > path.length - RESERVE:
            self._route = self._planned(state)
            path = self.driving.path
            s, d, heading = path.locate(state.x, state.y, self._search(state))
        self._s = s
        limits = self._route.limits
        row = min(max(round(s / path.step), 0), len(limits) - 1)
        return RoutePlace(
            s, d, wrap_pi(state.yaw - heading), path.curvature_at(s), limits[row],
            min(max(self._route.goal_s - s, 0.0), FAR), progress)

    def _planned(self, state: VehicleState) -> _Route:
        problem = self._problem
        driving = plan_driving_path(
            self._scenario, problem, state, self._vehicle, follow_lane=problem is None)
        usual = max(SLOWEST_DESIRED, abs(state.speed)) if problem is None \
            else default_speed(problem)
        return _Route(driving, desired_speeds(driving, None, usual).tolist(),
                      _goal(driving, problem))

    def _search(self, state: VehicleState) -> float:
        s, _ = self.driving.path.project(np.array([[state.x, state.y]]))
        return float(s[0])


def _goal(driving: DrivingPath, problem: PlanningProblem | None) -> float:
    """Return the arc length at which the route reaches its goal; inf without one."""
    if problem is None or not driving.reaches_goal:
        return math.inf
    path = driving.path
    ahead = path.s >= driving.start_s
    for state in problem.goal.state_list:
        position = getattr(state, 'position', None)
        if isinstance(position, Shape):
            inside = shapely.intersects_xy(group_outline(position), *path.points.T)
            found = np.flatnonzero(ahead & inside)
            if len(found):
                return float(path.s[found[0]])
    goals = goal_lanelets(driving.roads, problem)
    return min((first for lanelet, (first, _) in zip(
        driving.lanelets, driving.lanelet_spans.tolist(), strict=True) if lanelet in goals),
        default=math.inf)
