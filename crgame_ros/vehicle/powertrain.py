# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pedals to acceleration: CRG equations 20-25, with the signs of a real car."""

from math import exp

from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.parameters import VehicleParameters


def pedal_response(travel: float, shape: float) -> float:
    """
    Return the response alpha = 1 - exp(-k p) to a pedal's travel p in [0, 1] (CRG 20).

    :param shape: k > 0 [-]
    """
    return 1.0 - exp(-shape * travel)


class Powertrain:
    """
    Longitudinal dynamics of a human's vehicle.

    Beyond the printed equations: the engine pushes in the direction of the gear; brake force and
    rolling resistance oppose the motion and never start one; at rest under brakes the lagged
    acceleration is cleared.
    """

    def __init__(self, vehicle: VehicleParameters) -> None:
        self._vehicle = vehicle
        self._friction_limit = vehicle.friction * vehicle.mass * vehicle.gravity
        self._drag = 0.5 * vehicle.air_density * vehicle.drag_coefficient * vehicle.frontal_area
        self._rolling = vehicle.mass * vehicle.gravity * vehicle.rolling_resistance

    def drive_force_limit(self, speed: float) -> float:
        """
        Return the largest tractive force by engine power and friction (CRG 21).

        :param speed: signed speed [m/s]
        :return: F_max [N]
        """
        vehicle = self._vehicle
        return min(vehicle.max_power / (abs(speed) + vehicle.speed_regularization),
                   self._friction_limit)

    def command(self, pedals: DriverCommand, speed: float, gear: int) -> float:
        """
        Find the commanded acceleration a_cmd (CRG 22-24).

        :param speed: signed speed [m/s]
        :param gear: 1 forward, -1 reverse
        :return: a_cmd, signed along the heading [m/s^2]
        """
        vehicle = self._vehicle
        drive = gear * pedal_response(pedals.throttle, vehicle.throttle_shape) \
            * self.drive_force_limit(speed)
        brake = pedal_response(pedals.brake, vehicle.brake_shape) * vehicle.max_brake_force
        drag = self._drag * abs(speed) * speed
        if speed != 0.0:
            direction = 1.0 if speed > 0.0 else -1.0
            force = drive - drag - direction * (brake + self._rolling)
        else:
            # Static friction holds the car until the engine overcomes it.
            holding = brake + self._rolling
            force = 0.0 if abs(drive) <= holding else drive - gear * holding
        limit = vehicle.max_acceleration
        return min(limit, max(-limit, force / vehicle.mass))

    def lag(self, acceleration: float, commanded: float, dt_s: float) -> float:
        """
        Filter the commanded acceleration by a lag of first order (CRG 25).

        :param acceleration: delivered acceleration a_n [m/s^2]
        :param commanded: a_cmd [m/s^2]
        :param dt_s: Delta t_eff, the interval that the state advances by [s]
        :return: a_{n+1} [m/s^2]
        """
        share = dt_s / self._vehicle.longitudinal_lag
        # The printed Euler step overshoots where the interval exceeds the time constant.
        return acceleration + min(1.0, share) * (commanded - acceleration)
