# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Braking to a stop, and no farther, within a step."""

from math import copysign

from crgame_ros.vehicle.kinematic_single_track import integrate

# Braking where there is no plan to follow [m/s^2]: firm, well within a dry road's friction.
FIRM_BRAKING = 4.0


def braking_acceleration(speed: float, deceleration: float = FIRM_BRAKING) -> float:
    """
    Return the acceleration against a motion; none at rest.

    :param speed: signed [m/s]
    :param deceleration: above 0 [m/s^2]
    :return: signed along the heading [m/s^2]
    """
    return -copysign(deceleration, speed) if speed else 0.0


def moving_time(speed: float, acceleration: float, dt_s: float) -> float:
    """
    Return the part of a step until braking has brought a vehicle to rest [s].

    :return: all of the step where it does not, or where the acceleration is no braking.
    """
    return min(dt_s, -speed / acceleration) if speed * acceleration < 0.0 else dt_s


def step_to_rest(
    x: float, y: float, yaw: float, speed: float, steering_angle: float,
    acceleration: float, steering_rate: float, wheelbase: float, moving_s: float, dt_s: float,
) -> tuple[float, float, float, float, float]:
    """
    Advance the KS model over the part of a step in which it moves; then it stands.

    :param moving_s: `moving_time` [s]
    :return: as `integrate`, the speed exactly 0 after a stop.
    """
    x, y, yaw, end_speed, angle = integrate(
        x, y, yaw, speed, steering_angle, acceleration, steering_rate, wheelbase, moving_s)
    return x, y, yaw, 0.0 if moving_s < dt_s else end_speed, angle
