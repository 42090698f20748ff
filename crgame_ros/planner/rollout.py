# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The states of a plan, driven step by step with the kinematic single-track model."""

import math

from crgame_ros.geometry.curve import arc_length
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import REST, StateColumn, VehicleState
from crgame_ros.vehicle.steering import steering_rate
from crgame_ros.vehicle.stopping import (
    braking_acceleration,
    FIRM_BRAKING,
    moving_time,
    step_to_rest,
)
import numpy as np
from numpy.typing import NDArray

# Steps after the stop, so that a late next plan still finds the vehicle at rest.
REST_STEPS = 10


class Rollout:
    """
    A plan that is driven step by step (CRG 2-4), with the derivatives of each step.

    Attributes `x`, `y` [m], `yaw` [rad], `speed` [m/s] and `steering` [rad] are those of the
    rear axle after the last step.

    :param ego: state at the start, kept as row 0 in all its columns.
    :param dt_s: length of a step [s]
    :param wheelbase: L [m]
    """

    def __init__(self, ego: VehicleState, dt_s: float, wheelbase: float) -> None:
        self._dt_s, self._wheelbase = dt_s, wheelbase
        self.x, self.y, self.yaw, self.speed, self.steering = ego[:5]
        self._rows: list[list[float]] = [[*ego]]

    @property
    def states(self) -> NDArray[np.float64]:
        """Return all states up to the last step (steps + 1, 8)."""
        return np.array(self._rows, dtype=np.float64)

    def step(self, acceleration: float, steering_rate: float, moving_s: float) -> None:
        """
        Drive a step.

        :param moving_s: part of the step until the vehicle stands [s]
        """
        dt_s, rows, before = self._dt_s, self._rows, self.speed
        self.x, self.y, self.yaw, self.speed, self.steering = step_to_rest(
            self.x, self.y, self.yaw, before, self.steering, acceleration, steering_rate,
            self._wheelbase, moving_s, dt_s)
        if len(rows) > 1:
            rows[-1][StateColumn.ACCELERATION] = (self.speed - before) / dt_s
            rows[-1][StateColumn.STEERING_RATE] = steering_rate * moving_s / dt_s
        rows.append([self.x, self.y, self.yaw, self.speed, self.steering, 0.0,
                     self.speed * math.tan(self.steering) / self._wheelbase, 0.0])


def braking_plan(request: PlanRequest, last_plan: Plan | None, vehicle: VehicleParameters,
                 deceleration: float = FIRM_BRAKING) -> Plan:
    """
    Return a plan that brakes to a stop on the last plan's path, with constant curvature behind it.

    The wanted steering angle is that of the last plan as a function of the distance covered. It is
    approached within the steering rate. Every step is a step of the KS model (CRG 2-4).

    :param last_plan: the plan followed so far; None keeps the steering angle.
    :param deceleration: [m/s^2]
    :return: a plan with `fallback` set, from the request's ego state to rest and a second more.
    """
    ego, dt_s = request.ego, request.time_step_s
    steps = math.ceil(abs(ego.speed) / (deceleration * dt_s)) + REST_STEPS
    distances, angles = _steering_over_distance(request, last_plan)
    drive = Rollout(ego, dt_s, vehicle.wheelbase)
    covered = 0.0
    for _ in range(steps):
        speed, rate = drive.speed, 0.0
        acceleration = braking_acceleration(speed, deceleration)
        moving_s = moving_time(speed, acceleration, dt_s) if speed else 0.0
        covered += abs(speed + 0.5 * acceleration * moving_s) * moving_s
        if moving_s > 0.0:
            wanted = float(np.interp(covered, distances, angles))
            rate = steering_rate(wanted, drive.steering, moving_s, vehicle.max_steering_rate)
        drive.step(acceleration, rate, moving_s)
    return Plan(request.stamp_ns, drive.states, fallback=True)


def _steering_over_distance(request: PlanRequest, last_plan: Plan | None,
                            ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the last plan's steering angles over the distance from the ego, (n) and (n)."""
    here = np.zeros(1), np.array([request.ego.steering_angle])
    if last_plan is None or len(last_plan.states) < 2:
        return here
    states = last_plan.states
    elapsed = (request.stamp_ns - last_plan.stamp_ns) * 1e-9 / request.time_step_s
    position = min(max(elapsed, 0.0), len(states) - 1.0)
    along = arc_length(states[:, :2])
    origin = float(np.interp(position, np.arange(len(states)), along))
    # States at rest do not show where the plan leads.
    ahead = along > origin + REST * request.time_step_s
    if not ahead.any():
        return here
    return (np.concatenate((here[0], along[ahead] - origin)),
            np.concatenate((here[1], states[ahead, StateColumn.STEERING_ANGLE])))
