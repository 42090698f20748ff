# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A human's vehicle: command in, motion out (CRG III-C2), or known states in their order."""

from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.models import KinematicSingleTrack, VehicleModel
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.powertrain import Powertrain
from crgame_ros.vehicle.state import VehicleState
from crgame_ros.vehicle.steering import Steering
import numpy as np
from numpy.typing import NDArray


class HumanVehicle:
    """
    The low-level simulation of one HV (CRG III-A1a, III-C2c).

    The gear changes to or from reverse only at rest. Speed stays within the gear's direction:
    brakes stop the car within the step and hold it there.

    :param vehicle: parameters of the vehicle
    :param state: at the start, rear axle
    :param model: its motion model, used by this vehicle alone; that of the paper where None:
        kinematic single-track (CRG 2-4) behind the powertrain's lag (CRG 25).
    """

    def __init__(self, vehicle: VehicleParameters, state: VehicleState,
                 model: VehicleModel | None = None) -> None:
        self.vehicle = vehicle
        self.state = state
        self._model = model or KinematicSingleTrack(vehicle, powertrain_lag=True)
        self._model.gear = -1 if state.speed < 0.0 else 1
        self._powertrain = Powertrain(vehicle)
        self._steering = Steering(vehicle)

    @property
    def gear(self) -> int:
        """Return the engaged gear: 1 forward, -1 reverse."""
        return self._model.gear

    def stand(self, state: VehicleState) -> None:
        """Stop the vehicle by other means than the brakes, in a state without speed."""
        self.state = state

    def step(self, command: DriverCommand, dt_s: float) -> VehicleState:
        """
        Advance by one cycle under a driver's command (CRG 20-24 and 26, then the model).

        :param command: the normalised command, within its ranges
        :param dt_s: Delta t_eff [s], greater than 0
        :return: the new state, rear axle
        """
        state = self.state
        speed = state.speed
        if speed == 0.0:
            self._model.gear = -1 if command.reverse else 1
        acceleration = self._powertrain.command(command, speed, self._model.gear)
        angle = self._steering.target_angle(command.steering, speed)
        self.state = self._model.step(state, angle, acceleration, dt_s)
        return self.state


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
