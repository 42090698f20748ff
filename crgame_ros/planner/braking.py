# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The answer when a planner has none: brake to a stop along the last plan's path."""

import math

import numpy as np
from numpy.typing import NDArray

from crgame_ros.planner.interface import Plan, PlanRequest
from crgame_ros.vehicle.kinematic_single_track import integrate
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn

# Steps after the stop, so that a late next plan still finds the vehicle at rest.
REST_STEPS = 10
# Plans of a lesser speed do not say where they lead [m/s].
CREEPING = 0.05


def braking_plan(request: PlanRequest, last_plan: Plan | None, vehicle: VehicleParameters,
                 deceleration: float = 4.0) -> Plan:
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
    states = np.empty((steps + 1, STATE_WIDTH))
    states[0] = ego
    x, y, yaw, speed, steering = ego[:5]
    covered = 0.0
    for i in range(steps):
        before = speed
        acceleration = -math.copysign(deceleration, speed) if speed else 0.0
        moving = min(dt_s, abs(speed) / deceleration)
        moved = abs(speed + 0.5 * acceleration * moving) * moving
        wanted = float(np.interp(covered + moved, distances, angles))
        rate = 0.0
        if moving > 0.0:
            limit = vehicle.max_steering_rate
            rate = min(max((wanted - steering) / moving, -limit), limit)
            x, y, yaw, speed, steering = integrate(
                x, y, yaw, speed, steering, acceleration, rate, vehicle.wheelbase, moving)
        if moving < dt_s:
            speed = 0.0
        covered += moved
        states[i + 1] = (x, y, yaw, speed, steering, 0.0,
                         speed * math.tan(steering) / vehicle.wheelbase, 0.0)
        if i:
            states[i, StateColumn.ACCELERATION] = (speed - before) / dt_s
            states[i, StateColumn.STEERING_RATE] = rate * moving / dt_s
    return Plan(request.stamp_ns, states, fallback=True)


def _steering_over_distance(request: PlanRequest, last_plan: Plan | None,
                            ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the last plan's steering angles over the distance from the ego, (n) and (n)."""
    here = np.zeros(1), np.array([request.ego.steering_angle])
    if last_plan is None or len(last_plan.states) < 2:
        return here
    states = last_plan.states
    elapsed = (request.stamp_ns - last_plan.stamp_ns) * 1e-9 / request.time_step_s
    position = min(max(elapsed, 0.0), len(states) - 1.0)
    lengths = np.hypot(*np.diff(states[:, :2], axis=0).T)
    along = np.concatenate(([0.0], np.cumsum(lengths)))
    origin = float(np.interp(position, np.arange(len(states)), along))
    ahead = along > origin + CREEPING * request.time_step_s
    if not ahead.any():
        return here
    return (np.concatenate((here[0], along[ahead] - origin)),
            np.concatenate((here[1], states[ahead, StateColumn.STEERING_ANGLE])))
