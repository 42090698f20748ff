# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion of a kinematic single-track vehicle, step by step: along a path, or of a plan."""

from collections.abc import Callable
import math
from typing import NamedTuple

from crgame_ros.errors import PlanningError
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.curve import arc_length
from crgame_ros.geometry.polyline import ReferencePath
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
# Steps after the stop, so that a late next plan still finds the vehicle at rest.
REST_STEPS = 10


def covering_steps(time_s: float, dt_s: float) -> int:
    """Return how many steps cover a time; one that a rounding error adds is left out."""
    return math.ceil(time_s / dt_s - 1e-9)


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
