# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Manoeuvres as actions: keep on, change lanes, drive faster or slower."""

import math

from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.scenario import Scenario
from crgame_ros.planner.path_following import PathFollower, PathPosition
from crgame_ros.planner.reference_path import (
    admissible_speeds,
    CHANGE_MIN,
    CHANGE_TIME,
    plan_driving_path,
)
from crgame_ros.planner.side_lanes import side_lanes
from crgame_ros.policy.actions import BRAKING, DRIVING, held_steps, MANOEUVRES
from crgame_ros.policy.route_guide import RESERVE
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

KEEP, LEFT, RIGHT, FASTER, SLOWER = range(len(MANOEUVRES))
# A manoeuvre changes the wanted speed by this, and keeps it within twice this of the speed [m/s].
SPEED_STEP = 2.0
# Time in which the speed approaches the wanted one [s].
APPROACH_S = 0.5
# Comfortable in curves [m/s^2], as for the planner idm; slower before them by this [m/s^2].
LATERAL, EASING = 2.5, 2.0
# Beyond this offset from the lane's middle, a change into it is under way [m].
UNDER_WAY = 0.5


class Manoeuvres:
    """
    The manoeuvres of one AV: a lane and a speed that it wants, and plans towards them.

    The lane is that of the vehicle, and where lanes fork the one of its route. Others are not
    heeded: gaps and distances are left to the policy.

    :param problem: the planning problem, for the route; None follows the lane.
    :param start: initial state, rear axle.
    :raises PlanningError: if there is no road to follow.
    """

    def __init__(self, scenario: Scenario, problem: PlanningProblem | None, start: VehicleState,
                 vehicle: VehicleParameters) -> None:
        self._scenario, self._problem, self._vehicle = scenario, problem, vehicle
        self.restart(start)

    def restart(self, state: VehicleState) -> None:
        """Start another drive, in the lane and with the speed of a state."""
        self._enter(state)
        self.speed = max(state.speed, 0.0)

    def mask(self, state: VehicleState) -> NDArray[np.bool_]:
        """
        Return which manoeuvres there are, (5) in the order of `MANOEUVRES`.

        There is a change if a lane of the same direction is there and lasts for as long as the
        change, and no change to that side is under way.
        """
        place = self._locate(state)
        mask = np.zeros(len(MANOEUVRES), dtype=bool)
        mask[[KEEP, FASTER, SLOWER]] = True, self.speed < self._vehicle.max_speed, self.speed > 0.0
        for lane, side in ((LEFT, 1.0), (RIGHT, -1.0)):
            mask[lane] = -side * place.d < UNDER_WAY and self._beside(side, place.s, state) != 0.0
        return mask

    def decide(self, action: int, state: VehicleState) -> str | None:
        """
        Begin a manoeuvre.

        :param action: its number.
        :return: why there is none, if it is masked; the vehicle keeps on then.
        """
        if not self.mask(state)[action]:
            return f'the manoeuvre "{MANOEUVRES[action]}" is masked'
        if action in (LEFT, RIGHT):
            s = self._s
            offset = self._beside(1.0 if action == LEFT else -1.0, s, state)
            x, y, yaw = self._driving.path.poses(np.array([s]), np.array([offset]))[0].tolist()
            self._enter(state._replace(x=x, y=y, yaw=yaw))
        elif action != KEEP:
            wanted = self.speed + (SPEED_STEP if action == FASTER else -SPEED_STEP)
            low, high = state.speed - 2.0 * SPEED_STEP, state.speed + 2.0 * SPEED_STEP
            self.speed = min(max(wanted, low, 0.0), high, self._vehicle.max_speed)
        return None

    def plan(self, state: VehicleState, dt_s: float) -> NDArray[np.float64]:
        """
        Return a plan towards lane and speed.

        :param dt_s: scenario step [s]
        :return: (S, 8) rear-axle states, the first one the present
        :raises PlanningError: if the vehicle faces away from its lane.
        """
        limits, step = self._limits, self._driving.path.step

        def acceleration(_: int, s: float, speed: float) -> float:
            wanted = min(self.speed, limits[min(max(int(s / step), 0), len(limits) - 1)])
            if speed < 0.0:
                return min(BRAKING, -speed / dt_s)
            return min(max((wanted - speed) / APPROACH_S, -BRAKING), DRIVING)

        return self._follower.drive(state, self._locate(state), held_steps(dt_s), dt_s,
                                    acceleration)

    def _enter(self, start: VehicleState) -> None:
        """Take the lane of a state."""
        self._driving = driving = plan_driving_path(
            self._scenario, self._problem, start, self._vehicle,
            follow_lane=self._problem is None, keep_lane=True)
        self._follower = PathFollower(driving.path, self._vehicle)
        self._s = driving.start_s
        self._limits: list[float] = admissible_speeds(
            driving, np.full(len(driving.path.s), self._vehicle.max_speed), self._vehicle,
            LATERAL, EASING).tolist()

    def _locate(self, state: VehicleState) -> PathPosition:
        path = self._driving.path
        place = self._follower.locate(state.x, state.y, state.yaw, self._s)
        if math.isinf(self._driving.end_s) and place.s > path.length - RESERVE:
            x, y, yaw = path.poses(np.array([place.s]), np.zeros(1))[0].tolist()
            self._enter(state._replace(x=x, y=y, yaw=yaw))
            place = self._follower.locate(state.x, state.y, state.yaw, self._s)
        self._s = place.s
        return place

    def _beside(self, side: float, s: float, state: VehicleState) -> float:
        """Return the offset of the lane to the left (1) or right (-1); 0 without one [m]."""
        length = max(CHANGE_MIN, CHANGE_TIME * state.speed)
        return next((lane.offset for lane in side_lanes(self._driving, s, self._vehicle)
                     if side * lane.offset > 0.0 and lane.end_s >= s + length), 0.0)
