# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The progress of an AV along its plan between two replannings (CRG III-A2c, equations 15-16)."""

from typing import Literal

from crgame_ros.geometry.angles import interpolate_angle
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray

# If the plan's present state and the vehicle are further apart than this [m], an overdue plan has
# met a vehicle that braked meanwhile. The plan is then entered at the nearest point.
REALIGN_DISTANCE = 0.5


class ProgressTracker:
    """
    The progress sigma along a plan whose states are Delta t_c apart.

    By default sigma follows time, sigma = (n - n_request) / N from integers, and states are
    interpolated. With the paper's version (`nearest`, `floor`) an AV that replans every tick never
    moves.

    :param steps_per_tick: N
    :param realign: `time`, or `nearest` for CRG 16.
    :param sample: `interpolate`, or `floor` for CRG 15.
    """

    def __init__(
        self, steps_per_tick: int, realign: Literal['time', 'nearest'] = 'time',
        sample: Literal['interpolate', 'floor'] = 'interpolate',
    ) -> None:
        self._steps_per_tick = steps_per_tick
        self._realign = realign
        self._floor = sample == 'floor'
        self._states: list[list[float]] = []
        self._zero_n = 0
        self._offset = 0.0

    def adopt(
        self, states: NDArray[np.float64], request_n: int, n: int, vehicle: VehicleState,
    ) -> bool:
        """
        Adopt a new plan and align sigma.

        :param states: (S, 8) planned states in simulation coordinates
        :param request_n: simulation step of the request that the plan answers
        :param n: simulation step at which the plan is first sampled
        :param vehicle: present state of the vehicle, at step n - 1
        :return: True if sigma was aligned to the nearest point because the plan is elsewhere.
        """
        self._states = states.tolist()
        if self._realign == 'nearest':
            distance = np.hypot(states[:, StateColumn.X] - vehicle.x,
                                states[:, StateColumn.Y] - vehicle.y)
            self._zero_n, self._offset = n, float(np.argmin(distance))
            return False
        self._zero_n, self._offset = request_n, 0.0
        planned = self.sample(n - 1)
        if planned is not None and (
                abs(planned.x - vehicle.x) < REALIGN_DISTANCE
                and abs(planned.y - vehicle.y) < REALIGN_DISTANCE):
            return False
        self._zero_n, self._offset = n - 1, _nearest_progress(states, vehicle)
        return True

    def progress(self, n: int) -> float:
        """Return sigma at simulation step n [plan states]."""
        return self._offset + (n - self._zero_n) / self._steps_per_tick

    def sample(self, n: int) -> VehicleState | None:
        """Return the planned state at simulation step n; None when the plan is used up."""
        ticks, rest = divmod(n - self._zero_n, self._steps_per_tick)
        if self._offset:
            progress = self.progress(n)
            index = int(progress)
            share = progress - index
        else:
            index, share = ticks, rest / self._steps_per_tick
        if index < 0 or index >= len(self._states):
            return None
        first = self._states[index]
        if share == 0.0 or self._floor:
            return VehicleState(*first)
        if index + 1 >= len(self._states):
            return None
        second = self._states[index + 1]
        mixed = [a + share * (b - a) for a, b in zip(first, second, strict=True)]
        mixed[StateColumn.YAW] = interpolate_angle(
            first[StateColumn.YAW], second[StateColumn.YAW], share)
        return VehicleState(*mixed)


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
