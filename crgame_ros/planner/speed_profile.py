# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The speed profile of a path: desired speed, speed limits and curves."""

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.planner.reference_path import DrivingPath
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.stopping import SpeedEnvelope
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Least desired speed on a road without signs: 30 km/h [m/s].
SLOWEST_DESIRED = 30.0 / 3.6
STEERING_RATE_SHARE = 0.6


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
