# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A human's vehicle: command in, kinematic single-track motion out (CRG III-C2)."""

from math import tan

from crgame_ros.driver.command import DriverCommand
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.vehicle.kinematic_single_track import integrate
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.powertrain import Powertrain
from crgame_ros.vehicle.state import VehicleState
from crgame_ros.vehicle.steering import Steering


class HumanVehicle:
    """
    The low-level simulation of one HV (CRG III-A1a, III-C2c).

    The gear changes to or from reverse only at rest. Speed stays within the gear's direction:
    brakes stop the car within the step and hold it there.
    """

    def __init__(self, vehicle: VehicleParameters, state: VehicleState) -> None:
        self.vehicle = vehicle
        self.state = state
        self._gear = -1 if state.speed < 0.0 else 1
        self._powertrain = Powertrain(vehicle)
        self._steering = Steering(vehicle)

    @property
    def gear(self) -> int:
        """Engaged gear: 1 forward, -1 reverse."""
        return self._gear

    def step(self, command: DriverCommand, dt_s: float) -> VehicleState:
        """
        Advance by one cycle under a driver's command (CRG 20-27, then 2-4).

        :param command: the normalised command, within its ranges
        :param dt_s: Delta t_eff [s], greater than 0
        :return: the new state, rear axle
        """
        vehicle, state = self.vehicle, self.state
        speed = state.speed
        if speed == 0.0:
            self._gear = -1 if command.reverse else 1
        commanded = self._powertrain.command(command, speed, self._gear)
        if speed == 0.0 and commanded == 0.0:
            acceleration = 0.0
        else:
            acceleration = self._powertrain.lag(state.acceleration, commanded, dt_s)
        rate = self._steering.rate(
            self._steering.target_angle(command.steering, speed), state.steering_angle, dt_s)
        driven_s, acceleration = self._within_speed_limits(speed, acceleration, dt_s)
        x, y, yaw, new_speed, angle = integrate(
            state.x, state.y, state.yaw, speed, state.steering_angle,
            acceleration, rate, vehicle.wheelbase, driven_s)
        # A stop at the very end of the step may leave a rounding error behind zero.
        if driven_s < dt_s or self._gear * new_speed < 0.0:
            new_speed, acceleration = 0.0, 0.0
            angle += rate * (dt_s - driven_s)
        self.state = VehicleState(
            x, y, wrap_pi(yaw), new_speed, angle, acceleration,
            new_speed * tan(angle) / vehicle.wheelbase, rate)
        return self.state

    def _within_speed_limits(
        self, speed: float, acceleration: float, dt_s: float,
    ) -> tuple[float, float]:
        """Return for how long the car moves within the step [s], and its acceleration."""
        along = self._gear * speed
        along_acceleration = self._gear * acceleration
        end = along + along_acceleration * dt_s
        if end <= 0.0 and along_acceleration < 0.0:
            return min(dt_s, along / -along_acceleration), acceleration
        limit = self.vehicle.max_speed if self._gear > 0 else self.vehicle.max_reverse_speed
        if end > limit:
            return dt_s, self._gear * (limit - along) / dt_s
        return dt_s, acceleration
