# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The kinematic single-track (bicycle) model of CRG equations 2-4."""

from math import cos, sin, tan


def integrate(
    x: float, y: float, yaw: float, speed: float, steering_angle: float,
    acceleration: float, steering_rate: float, wheelbase: float, dt_s: float,
) -> tuple[float, float, float, float, float]:
    """
    Advance the KS model by one classical Runge-Kutta step (CRG 2-4).

    States: rear-axle position x, y [m], heading [rad], signed speed v [m/s], front-wheel steering
    angle delta [rad]. Inputs: acceleration a [m/s^2] and steering rate [rad/s], constant over the
    step. Continuous dynamics: x' = v cos(yaw), y' = v sin(yaw), yaw' = v tan(delta) / L, v' = a,
    delta' = steering rate. Speed and steering angle are linear over the step, so that two of the
    four slopes coincide. The step below equals the textbook's with fewer evaluations.

    :param wheelbase: L [m]
    :param dt_s: length of the step [s]
    :return: x, y, yaw, speed, steering angle after the step; the yaw is not normalised.
    """
    half = 0.5 * dt_s
    middle_speed = speed + half * acceleration
    end_speed = speed + dt_s * acceleration
    end_steering = steering_angle + dt_s * steering_rate
    yaw_rate_1 = speed * tan(steering_angle) / wheelbase
    yaw_rate_2 = middle_speed * tan(steering_angle + half * steering_rate) / wheelbase
    yaw_rate_4 = end_speed * tan(end_steering) / wheelbase
    yaw_2 = yaw + half * yaw_rate_1
    yaw_3 = yaw + half * yaw_rate_2
    yaw_4 = yaw + dt_s * yaw_rate_2
    sixth = dt_s / 6.0
    return (
        x + sixth * (speed * cos(yaw) + 2.0 * middle_speed * (cos(yaw_2) + cos(yaw_3))
                     + end_speed * cos(yaw_4)),
        y + sixth * (speed * sin(yaw) + 2.0 * middle_speed * (sin(yaw_2) + sin(yaw_3))
                     + end_speed * sin(yaw_4)),
        yaw + sixth * (yaw_rate_1 + 4.0 * yaw_rate_2 + yaw_rate_4),
        end_speed,
        end_steering,
    )
