# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steering agents along their references: pure pursuit and kinematic bicycle, vectorised."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Below this turn per step the chord of an arc is its length: sin(x) / x is 1 to 4e-18.
STRAIGHT = 1e-8


def pursuit_distance(speed: Array, time: float = 1.0, shortest: float = 4.0,
                     longest: float = 25.0) -> Array:
    """
    Give how far ahead on the reference the target point of `steer` lies.

    :param speed: (A,) [m/s]
    :param time: by which it grows with the speed; Snider (2009) tunes it per course, 1 s is
        steady on straights and cuts curves little (ours) [s]
    :param shortest: [m]
    :param longest: [m]
    :return: (A,) from the rear axle [m]
    """
    return np.clip(time * speed, shortest, longest)


def steer(x: Array, y: Array, yaw: Array, target_x: Array, target_y: Array, wheelbase: Array,
          steering: Array, max_steering: Array | float, max_rate: Array | float,
          dt_s: float) -> Array:
    """
    Steer towards points on the reference: pure pursuit (Snider 2009, section 2.2).

    The arc through the rear axle, tangent to the heading, and the point has the curvature
    2 y_t / (x_t^2 + y_t^2) with the point's coordinates in the vehicle's frame; the bicycle
    drives it with tan(delta) = L curvature. Exact on circles.

    :param x, y, yaw: (A,) of the rear axles [m], [rad]
    :param target_x, target_y: (A,) the points, at `pursuit_distance` [m]
    :param wheelbase: L, (A,) [m]
    :param steering: (A,) steering angles now [rad]
    :param max_steering: (A,) their bound [rad]
    :param max_rate: (A,) bound of their rate [rad/s]
    :param dt_s: until the next call [s]
    :return: (A,) steering angles for the step [rad]
    """
    dx, dy = target_x - x, target_y - y
    lateral = dy * np.cos(yaw) - dx * np.sin(yaw)
    squared = np.maximum(dx * dx + dy * dy, 1e-6)
    wanted = np.arctan(2.0 * wheelbase * lateral / squared)
    reach = max_rate * dt_s
    changed = np.minimum(np.maximum(wanted, steering - reach), steering + reach)
    return np.minimum(np.maximum(changed, -max_steering), max_steering)


def move(x: Array, y: Array, yaw: Array, speed: Array, steering: Array, acceleration: Array,
         wheelbase: Array, dt_s: float) -> tuple[Array, Array, Array, Array]:
    """
    Advance kinematic bicycles (CRG 2-4) by one step, exactly.

    With constant steering angle and acceleration a rear axle drives an arc: the distance ds is
    quadratic in time, the turn is ds tan(delta) / L and the chord ds sin(turn / 2) / (turn / 2).
    Vehicles that brake to rest within the step stay there; none moves backwards.

    :param x, y, yaw: (A,) of the rear axles [m], [rad]
    :param speed: (A,) at least 0 [m/s]
    :param steering: (A,) [rad]
    :param acceleration: (A,) [m/s^2]
    :param wheelbase: L, (A,) [m]
    :return: x, y, yaw (not normalised) and speed after the step, each (A,)
    """
    end_speed = np.maximum(speed + acceleration * dt_s, 0.0)
    stops = (end_speed == 0.0) & (acceleration < 0.0)
    driven = 0.5 * (speed + end_speed) * dt_s
    braking = np.where(stops, -acceleration, 1.0)
    driven = np.where(stops, 0.5 * speed * speed / braking, driven)
    half_turn = 0.5 * driven * np.tan(steering) / wheelbase
    curved = np.abs(half_turn) > STRAIGHT
    divisor = np.where(curved, half_turn, 1.0)
    chord = driven * np.where(curved, np.sin(divisor) / divisor, 1.0)
    middle = yaw + half_turn
    return (x + chord * np.cos(middle), y + chord * np.sin(middle), middle + half_turn,
            end_speed)


def centers(x: Array, y: Array, yaw: Array, rear_to_center: Array) -> tuple[Array, Array]:
    """
    Give the centres of vehicles whose rear axles are known.

    :param x, y, yaw: (A,) of the rear axles [m], [rad]
    :param rear_to_center: (A,) [m]
    :return: x, y, both (A,) [m]
    """
    return x + rear_to_center * np.cos(yaw), y + rear_to_center * np.sin(yaw)
