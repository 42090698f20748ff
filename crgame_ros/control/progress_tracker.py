# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The progress of an AV along its plan between two replannings (CRG III-A2c, equations 15-16)."""

import math
from typing import Literal

from crgame_ros.control.plan_motion import JoinedMotion, PlanMotion
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray

# If the plan's present state and the vehicle are further apart than this [m], an overdue plan has
# met a vehicle that braked meanwhile. The plan is then entered at the nearest point. A tracked
# vehicle may be further off, and is never at the place itself.
REALIGN_DISTANCE, TRACKED_REALIGN_DISTANCE = 0.5, 3.0
# Smaller differences between the plan's present state and the vehicle's are rounding [m], [rad]
# and [m/s].
SAME_PLACE, SAME_SPEED = 1e-4, 1e-3


class ProgressTracker:
    """
    The progress sigma along a plan whose states are Delta t_c apart.

    By default sigma follows time, sigma = (n - n_request) / N from integers, states are
    interpolated, and a plan that came late is joined in one motion. With the paper's version
    (`nearest`, `floor`) an AV that replans every tick never moves.

    :param steps_per_tick: N
    :param time_step_s: Delta t_c [s]
    :param parameters: of the vehicle
    :param realign: `time`, or `nearest` for CRG 16.
    :param sample: `interpolate`, or `floor` for CRG 15.
    """

    def __init__(
        self, steps_per_tick: int, time_step_s: float, parameters: VehicleParameters,
        realign: Literal['time', 'nearest'] = 'time',
        sample: Literal['interpolate', 'floor'] = 'interpolate',
    ) -> None:
        self._steps_per_tick = steps_per_tick
        self._time_step_s = time_step_s
        self._dt_s = time_step_s / steps_per_tick
        self._parameters = parameters
        self._realign = realign
        self._floor = sample == 'floor'
        self._plan: PlanMotion | None = None
        self._joined: JoinedMotion | None = None
        self._joined_n = 0
        self._zero_n = 0
        self._offset = 0.0

    def adopt(
        self, states: NDArray[np.float64], request_n: int, n: int, vehicle: VehicleState,
        acceleration: float = 0.0,
    ) -> bool:
        """
        Adopt a new plan and align sigma.

        :param states: (S, 8) planned states in simulation coordinates
        :param request_n: simulation step of the request that the plan answers
        :param n: simulation step at which the plan is first sampled
        :param vehicle: present state of the vehicle, at step n - 1
        :param acceleration: with which it has come there [m/s^2]
        :return: True if sigma was aligned to the nearest point because the plan is elsewhere.
        :raises InputError: if the vehicle cannot join the plan; the one before stays.
        """
        plan = PlanMotion(states, self._time_step_s)
        if self._realign == 'nearest':
            distance = np.hypot(states[:, StateColumn.X] - vehicle.x,
                                states[:, StateColumn.Y] - vehicle.y)
            self._follow(plan, n, float(np.argmin(distance)))
            return False
        planned = _at(plan, n - 1 - request_n, self._steps_per_tick)
        in_time = _within(planned, vehicle, REALIGN_DISTANCE)
        if planned is not None and _same(planned, vehicle):
            self._follow(plan, request_n)
            return False
        since = (n - 1 - request_n) / self._steps_per_tick if in_time \
            else _nearest_progress(states, vehicle)
        joined = JoinedMotion(plan, since, vehicle, acceleration, self._parameters, self._dt_s,
                              in_time=in_time)
        self._follow(plan, n - 1, since)
        self._joined, self._joined_n = joined, n - 1
        return not in_time

    def align(
        self, states: NDArray[np.float64], request_n: int, n: int, vehicle: VehicleState,
    ) -> bool:
        """
        Align sigma to a new plan for a vehicle that tracks it; parameters as of `adopt`.

        :return: True if sigma was aligned to the nearest point because the plan is elsewhere.
        """
        plan = PlanMotion(states, self._time_step_s)
        planned = _at(plan, n - 1 - request_n, self._steps_per_tick)
        if _within(planned, vehicle, TRACKED_REALIGN_DISTANCE):
            self._follow(plan, request_n)
            return False
        self._follow(plan, n - 1, _nearest_progress(states, vehicle))
        return True

    def _follow(self, plan: PlanMotion, zero_n: int, offset: float = 0.0) -> None:
        self._plan, self._joined = plan, None
        self._zero_n, self._offset = zero_n, offset

    def progress(self, n: int) -> float:
        """Return sigma at simulation step n [plan states]."""
        return self._offset + (n - self._zero_n) / self._steps_per_tick

    def time_s(self, n: int) -> float:
        """Return the time within the plan at simulation step n [s]."""
        return self._offset * self._time_step_s + (n - self._zero_n) * self._dt_s

    def sample(self, n: int) -> VehicleState | None:
        """Return the state to be in at simulation step n; None when the plan is used up."""
        if self._plan is None:
            return None
        if self._joined is not None:
            row = n - self._joined_n
            return VehicleState(*self._joined.states[row].tolist()) \
                if 0 <= row < len(self._joined.states) else None
        if self._offset:
            progress = self.progress(n)
            return _state(self._plan, int(progress), progress % 1.0, self._floor)
        return _at(self._plan, n - self._zero_n, self._steps_per_tick, self._floor)


def _at(plan: PlanMotion, step: int, steps_per_tick: int, floor: bool = False
        ) -> VehicleState | None:
    """Return the planned state a number of simulation steps after the first; None beyond it."""
    index, rest = divmod(step, steps_per_tick)
    return _state(plan, index, rest / steps_per_tick, floor)


def _state(plan: PlanMotion, index: int, share: float, floor: bool) -> VehicleState | None:
    share = 0.0 if floor else share
    if index < 0 or index + (share > 0.0) >= len(plan):
        return None
    return plan.at(index, share)


def _within(planned: VehicleState | None, vehicle: VehicleState, distance: float) -> bool:
    """Return whether a vehicle is within a distance [m] of where its plan is now."""
    return planned is not None and math.hypot(
        planned.x - vehicle.x, planned.y - vehicle.y) < distance


def _same(planned: VehicleState, vehicle: VehicleState) -> bool:
    """Return whether a plan goes on from the vehicle's place, heading and speed."""
    return (math.hypot(planned.x - vehicle.x, planned.y - vehicle.y) < SAME_PLACE
            and abs(wrap_pi(planned.yaw - vehicle.yaw)) < SAME_PLACE
            and abs(planned.speed - vehicle.speed) < SAME_SPEED)


def _nearest_progress(states: NDArray[np.float64], vehicle: VehicleState) -> float:
    """Return the vehicle's projection onto the plan's polyline, as an index with its fraction."""
    if len(states) == 1:
        return 0.0
    points = states[:, :2]
    segments = np.diff(points, axis=0)
    to_vehicle = np.array((vehicle.x, vehicle.y)) - points[:-1]
    lengths = np.maximum(np.einsum('ij,ij->i', segments, segments), 1e-12)
    shares = np.clip(np.einsum('ij,ij->i', to_vehicle, segments) / lengths, 0.0, 1.0)
    gaps = to_vehicle - shares[:, None] * segments
    index = int(np.argmin(np.einsum('ij,ij->i', gaps, gaps)))
    return index + float(shares[index])
