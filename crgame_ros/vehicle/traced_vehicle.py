# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A human's vehicle that follows a recorded path, whatever its driver does."""

from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray


class TracedVehicle:
    """
    A substitute for a `HumanVehicle`, with known states.

    :param states: (N, 8) rear-axle states of step 0, 1, …, columns as in `StateColumn`; after the
        last one it stays there.
    """

    def __init__(self, states: NDArray[np.float64]) -> None:
        self._states = [VehicleState(*row) for row in states.tolist()]
        self._n = 0

    @property
    def state(self) -> VehicleState:
        """Return the state of the present step, rear axle."""
        return self._states[self._n]

    def step(self, _command: DriverCommand, _dt_s: float) -> VehicleState:
        """Advance to the next step; command and interval have no effect."""
        self._n = min(self._n + 1, len(self._states) - 1)
        return self.state
