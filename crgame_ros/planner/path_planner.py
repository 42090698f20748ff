# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The base class of planners that follow a reference path."""

from abc import abstractmethod
import math

from crgame_ros.errors import InputError, PlanningError
from crgame_ros.geometry.reference_point import ahead
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.planner.interface import Planner, PlannerContext
from crgame_ros.planner.path_following import PathFollower, PathPosition
from crgame_ros.planner.reference_path import DrivingPath, plan_driving_path
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np

# Beyond this offset the vehicle has left its path [m].
LOST = 4.0
RETRY_DISTANCE = 20.0
# Least length of path ahead of the vehicle; with less, a path that goes on is planned anew [m].
RESERVE = 300.0


def initial_state(context: PlannerContext) -> VehicleState:
    """Return the initial rear-axle state of a planning problem, which gives the centre."""
    start = context.planning_problem.initial_state
    (x, y), yaw = start.position[:2].tolist(), float(start.orientation)
    return VehicleState(*ahead(x, y, yaw, -context.vehicle.rear_to_center), yaw,
                        float(getattr(start, 'velocity', 0.0)))


def check_positive(planner: str, **options: float | None) -> None:
    """
    Check that options are positive finite numbers; None stands for a default.

    :raises InputError: naming planner and option.
    """
    for name, value in options.items():
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise InputError(f'"{name}" is {value!r}', f'options of planner {planner}',
                             'give a positive number')


class PathPlanner(Planner):
    """A planner on a reference path: it plans the path and tracks the vehicle's place on it."""

    follow_lane = False

    def setup(self, context: PlannerContext) -> None:
        """Plan the path from the planning problem's initial state."""
        self._context = context
        self._plan_path(initial_state(context))

    @property
    def driving(self) -> DrivingPath:
        """Return the present path; `locate` may replace it."""
        return self._driving

    @abstractmethod
    def prepare(self, driving: DrivingPath, vehicle: VehicleParameters) -> None:
        """Prepare for a new path."""

    def locate(self, request: PlanRequest) -> PathPosition:
        """
        Find the ego on the path; plan a new path where it has left the old one for good.

        :raises PlanningError: if there is no road to follow.
        """
        ego = request.ego
        position = self._locate(ego)
        driving = self._driving
        leaving = math.isinf(driving.end_s) and position.s > driving.path.length - RESERVE
        lost = abs(position.d) > LOST and math.hypot(
            ego.x - self._planned_at[0], ego.y - self._planned_at[1]) > RETRY_DISTANCE
        if lost or leaving:
            self._plan_path(ego)
            position = self._locate(ego)
        if not math.isfinite(position.s + position.d):
            raise PlanningError('the state of the vehicle is not finite')
        self._last_s = position.s
        return position

    def answer(self, request: PlanRequest, states: np.ndarray) -> Plan:
        """Return states as the plan that answers a request."""
        return Plan(request.stamp_ns, states)

    def _plan_path(self, start: VehicleState) -> None:
        context = self._context
        self._set_path(plan_driving_path(
            context.scenario, context.planning_problem, start, context.vehicle,
            self.follow_lane), start)

    def _set_path(self, driving: DrivingPath, start: VehicleState) -> None:
        """Set the path, planned from the vehicle's present state."""
        self._driving = driving
        self._planned_at = (start.x, start.y)
        self._last_s = driving.start_s
        self.follower = PathFollower(driving.path, self._context.vehicle)
        self.prepare(driving, self._context.vehicle)

    def _locate(self, ego: VehicleState) -> PathPosition:
        """Search near the last position first, because a closed loop passes a place twice."""
        path = self._driving.path
        here = np.array([[ego.x, ego.y]])
        s, d = path.project(here, self._last_s - 10.0, self._last_s + 30.0 + abs(ego.speed))
        if not abs(float(d[0])) < LOST:
            s, d = path.project(here)
        return self.follower.locate(ego.x, ego.y, ego.yaw, float(s[0]))
