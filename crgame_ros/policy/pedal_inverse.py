# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pedals and the steering wheel that bring a wanted motion about: CRG 20-27 backwards."""

import math

from crgame_ros.policy.actions import WantedMotion
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.powertrain import pedal_response, Powertrain
from crgame_ros.vehicle.steering import load_steering_ratio

# Rounds in which the steering ratio, which depends on the angle sought, settles.
_ROUNDS = 6


class PedalInverse:
    """
    Drives a human's vehicle by acceleration and curvature.

    What pedals cannot do is done as far as they can. The lag of the powertrain stays.

    :param vehicle: its parameters.
    """

    def __init__(self, vehicle: VehicleParameters) -> None:
        self._vehicle = vehicle
        self._powertrain = Powertrain(vehicle)
        self._table = load_steering_ratio(vehicle.steering_ratio)

    def command(self, wanted: WantedMotion, speed: float) -> DriverCommand:
        """
        Return the command for a motion, forwards.

        :param speed: present one [m/s]
        """
        vehicle = self._vehicle
        # What drag and rolling resistance do by themselves; at rest nothing moves.
        coasting = self._powertrain.command(RELEASED, speed, 1) if speed else 0.0
        force = vehicle.mass * (wanted.acceleration - coasting)
        if force >= 0.0 and not (speed == 0.0 and wanted.acceleration <= 0.0):
            if speed == 0.0:
                force += vehicle.mass * vehicle.gravity * vehicle.rolling_resistance
            share = force / self._powertrain.drive_force_limit(speed)
            throttle, brake = _travel(share, vehicle.throttle_shape), 0.0
        else:
            share = -force / vehicle.max_brake_force if vehicle.max_brake_force else 0.0
            throttle, brake = 0.0, _travel(share, vehicle.brake_shape)
        return DriverCommand(throttle, brake, self._wheel(wanted.curvature, speed))

    def _wheel(self, curvature: float, speed: float) -> float:
        """Return the normalised steering for a curvature."""
        angle, full = math.atan(self._vehicle.wheelbase * curvature), \
            self._vehicle.max_steering_wheel_angle
        turned = 0.0
        for _ in range(_ROUNDS):
            turned = min(full, max(-full, angle * self._table.ratio(speed, turned)))
        return turned / full


def _travel(share: float, shape: float) -> float:
    """Return the pedal's travel in [0, 1] whose response (CRG 20) is a share."""
    if share >= pedal_response(1.0, shape):
        return 1.0
    return -math.log(1.0 - max(share, 0.0)) / shape
