# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The states of a plan as they come about, each a step of the kinematic single-track model."""

import math

from crgame_ros.vehicle.state import StateColumn, VehicleState
from crgame_ros.vehicle.stopping import step_to_rest
import numpy as np
from numpy.typing import NDArray


class Rollout:
    """
    A plan that is driven step by step (CRG 2-4), with the derivatives that its steps had.

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

        :param moving_s: part of the step until it stands [s]
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
