# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion of a kinematic single-track vehicle along a path, step by step."""

from collections.abc import Callable
import math
from typing import NamedTuple

from crgame_ros.errors import PlanningError
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.planner.rollout import Rollout
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
from crgame_ros.vehicle.steering import steering_rate
from crgame_ros.vehicle.stopping import moving_time
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Acceleration [m/s^2] as a function of step, arc length [m] and speed [m/s].
Longitudinal = Callable[[int, float, float], float]

MAX_HEADING_ERROR = 2.0
# Shares of the vehicle's limits that corrections may use; the path's own curvature needs the rest.
RATE_SHARE = 0.6
LATERAL_ACCELERATION = 1.5
CORRECTION_CURVATURE = 0.12
SHORTEST_CORRECTION = 6.0
CORRECTION_TIME = 2.5


class PathPosition(NamedTuple):
    """Arc length s [m], offset d to the left [m] and heading error [rad] against a path."""

    s: float
    d: float
    heading_error: float


class PathFollower:
    """
    A controller that steers a vehicle along a path within its steering limits.

    The offset follows the third derivative that a quintic d(l) to the path has at its start,
    d''' = -60 d / L^3 - 36 d' / L^2 - 9 d'' / L. It is evaluated at each step, which is the
    feedback form of replanning the quintic. The poles (-3.6, -2.7 ± 3.1i) / L are well damped, no
    state is kept between ticks, and every step is a step of the KS model (CRG 2-4), so that yaw,
    steering angle, speed and position agree.

    :param path: the path of the rear axle.
    :param vehicle: its parameters.
    """

    def __init__(self, path: ReferencePath, vehicle: VehicleParameters) -> None:
        self.path = path
        self._vehicle = vehicle

    def locate(self, x: float, y: float, yaw: float, guess: float) -> PathPosition:
        """Return the place of a pose on the path, near a guessed arc length [m]."""
        s, d, heading = self.path.locate(x, y, guess)
        return PathPosition(s, d, wrap_pi(yaw - heading))

    def correction_length(self, position: PathPosition, speed: float) -> float:
        """Return the length L over which the offset is corrected [m]."""
        d, error = abs(position.d), min(abs(position.heading_error), 1.2)
        rate = RATE_SHARE * self._vehicle.max_steering_rate
        jerk = speed * self._vehicle.wheelbase / max(rate, 1e-3)
        return max(
            SHORTEST_CORRECTION, CORRECTION_TIME * speed,
            speed * math.sqrt(5.8 * d / LATERAL_ACCELERATION),
            math.sqrt(5.8 * d / CORRECTION_CURVATURE),
            (60.0 * d * jerk) ** (1.0 / 3.0), math.sqrt(36.0 * error * jerk),
            6.0 * error / CORRECTION_CURVATURE)

    def drive(self, ego: VehicleState, start: PathPosition, steps: int, dt_s: float,
              longitudinal: Longitudinal) -> Array:
        """
        Drive along the path.

        :param ego: state at the start, kept as row 0 in all its columns.
        :param start: where the ego is on the path.
        :param steps: number of steps of dt_s [s].
        :param longitudinal: wanted acceleration at each step; the speed stops at 0.
        :return: (steps + 1, 8) rear-axle states; yaw continues that of the ego.
        :raises PlanningError: if the ego faces away from the path.
        """
        if abs(start.heading_error) > MAX_HEADING_ERROR:
            raise PlanningError(
                f'the vehicle faces away from its path by {start.heading_error:.2f} rad')
        length = self.correction_length(start, abs(ego.speed))
        gains = (60.0 / length ** 3, 36.0 / length ** 2, 9.0 / length)
        driven = Rollout(ego, dt_s, self._vehicle.wheelbase)
        locate, (s, d, error), moved = self.path.locate, start, 0.0
        for i in range(steps):
            if i:
                s, d, heading = locate(driven.x, driven.y, s + moved)
                error = wrap_pi(driven.yaw - heading)
            speed = driven.speed
            wanted = longitudinal(i, s, speed)
            moving_s = moving_time(speed, wanted, dt_s)
            moved = (speed + 0.5 * wanted * moving_s) * moving_s
            driven.step(wanted, self._steering_rate(
                s, d, error, driven.steering, moved, moving_s, gains), moving_s)
        return driven.states

    def _steering_rate(self, s: float, d: float, error: float, steering: float, moved: float,
                       time_s: float, gains: tuple[float, float, float]) -> float:
        """Return the rate at a place as of `PathPosition`, for a step of length `moved` [m]."""
        if -1e-4 < moved < 1e-4 or time_s <= 0.0:
            return 0.0
        vehicle, curvature_at = self._vehicle, self.path.curvature_at
        path_curvature = curvature_at(s)
        curvature = math.tan(steering) / vehicle.wheelbase
        # Comparisons take a third of the time of `min` and `max`.
        cos, inner = math.cos(error), 1.0 - path_curvature * d
        cos = cos if cos > 0.2 else 0.2
        bend = curvature - path_curvature * cos / (inner if inner > 0.3 else 0.3)
        third = -(gains[0] * d + gains[1] * math.sin(error) + gains[2] * cos * bend)
        change = curvature_at(s + moved) - path_curvature + third * moved
        limit = vehicle.max_steering_angle
        wanted = math.atan(vehicle.wheelbase * (curvature + change))
        wanted = limit if wanted > limit else -limit if wanted < -limit else wanted
        return steering_rate(wanted, steering, time_s, vehicle.max_steering_rate)
