# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The answer when a planner has none: brake to a stop along the last plan's path."""

import math

from crgame_ros.geometry.curve import arc_length
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.planner.rollout import Rollout
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.standstill import REST
from crgame_ros.vehicle.state import StateColumn
from crgame_ros.vehicle.steering import steering_rate
from crgame_ros.vehicle.stopping import braking_acceleration, FIRM_BRAKING, moving_time
import numpy as np
from numpy.typing import NDArray

# Steps after the stop, so that a late next plan still finds the vehicle at rest.
REST_STEPS = 10


def braking_plan(request: PlanRequest, last_plan: Plan | None, vehicle: VehicleParameters,
                 deceleration: float = FIRM_BRAKING) -> Plan:
    """
    Brake to a stop along the last plan's path, beyond its end with constant curvature.

    The steering angle is taken from the last plan as a function of the distance covered and
    approached within the steering rate; every step is a step of the KS model (CRG 2-4).

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
    # Slower states do not say where the plan leads.
    ahead = along > origin + REST * request.time_step_s
    if not ahead.any():
        return here
    return (np.concatenate((here[0], along[ahead] - origin)),
            np.concatenate((here[1], states[ahead, StateColumn.STEERING_ANGLE])))
