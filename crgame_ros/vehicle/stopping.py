# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Braking to a stop within a step, without reversing."""

import math
from math import copysign

from crgame_ros.vehicle.models import integrate
from crgame_ros.vehicle.parameters import VehicleParameters
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class SpeedEnvelope:
    """
    The speed allowed at each arc length, so that braking suffices for all limits ahead.

    v(s)^2 = min over s' >= s of V(s')^2 + 2 b (s' - s), where V is the limit at s'.

    :param s: (n,) arc lengths, ascending [m]
    :param limit: (n,) V, finite [m/s]
    :param deceleration: b [m/s^2]
    """

    def __init__(self, s: FloatArray, limit: FloatArray, deceleration: float) -> None:
        self._s = s
        potential = limit**2 + 2.0 * deceleration * s
        reachable = np.minimum.accumulate(potential[::-1])[::-1]
        self._squares: FloatArray = np.maximum(reachable - 2.0 * deceleration * s, 0.0)

    @property
    def speeds(self) -> FloatArray:
        """Return the speed allowed at each of the arc lengths, (n,) [m/s]."""
        return np.asarray(np.sqrt(self._squares))

    def at(self, s: float) -> float:
        """Return the speed allowed at an arc length [m/s]; exact under constant deceleration."""
        return math.sqrt(np.interp(s, self._s, self._squares))


# Braking without a plan to follow [m/s^2]: firm, well within a dry road's friction.
FIRM_BRAKING = 4.0


def firm_braking(vehicle: VehicleParameters) -> float:
    """Return the deceleration without a plan to follow, which a slippery road limits [m/s^2]."""
    return min(FIRM_BRAKING, vehicle.max_acceleration)


def braking_acceleration(speed: float, deceleration: float = FIRM_BRAKING) -> float:
    """
    Return the acceleration against a motion; 0 at rest.

    :param speed: signed [m/s]
    :param deceleration: above 0 [m/s^2]
    :return: signed along the heading [m/s^2]
    """
    return -copysign(deceleration, speed) if speed else 0.0


def moving_time(speed: float, acceleration: float, dt_s: float) -> float:
    """
    Return the part of a step until braking has brought a vehicle to rest [s].

    :return: all of the step if it does not, or if the acceleration does not brake.
    """
    return min(dt_s, -speed / acceleration) if speed * acceleration < 0.0 else dt_s


def step_to_rest(
    x: float, y: float, yaw: float, speed: float, steering_angle: float,
    acceleration: float, steering_rate: float, wheelbase: float, moving_s: float, dt_s: float,
) -> tuple[float, float, float, float, float]:
    """
    Advance the KS model over the part of a step in which it moves; for the rest it stands.

    :param moving_s: `moving_time` [s]
    :return: as `integrate`, the speed exactly 0 after a stop.
    """
    x, y, yaw, end_speed, angle = integrate(
        x, y, yaw, speed, steering_angle, acceleration, steering_rate, wheelbase, moving_s)
    return x, y, yaw, 0.0 if moving_s < dt_s else end_speed, angle
