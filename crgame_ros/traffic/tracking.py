# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steering one agent along its reference: pure pursuit and kinematic bicycle."""

import math

from crgame_ros.traffic.compiled import compiled

# Below this turn per step the chord of an arc is its length: sin(x) / x is 1 to 4e-18.
STRAIGHT = 1e-8
# Time by which the target point is ahead; Snider (2009) tunes it per course, 1 s is steady on
# straights [s]; and the bounds of its distance [m].
PURSUIT_TIME, SHORTEST, LONGEST = 1.0, 3.0, 25.0
# Where the road bends, the chord to the target point leaves it by at most this [m].
CUT = 0.12


@compiled
def pursuit_distance(speed: float, curvature: float) -> float:
    """
    Give how far ahead on the reference the target point of `steer` lies.

    A chord of length l leaves an arc by l^2 |kappa| / 8.

    :param speed: [m/s]
    :param curvature: of the road between here and there [1/m]
    :return: from the rear axle [m]
    """
    straight = min(max(PURSUIT_TIME * speed, SHORTEST), LONGEST)
    return max(min(straight, math.sqrt(8.0 * CUT / max(abs(curvature), 1e-6))), SHORTEST)


@compiled
def steer(x: float, y: float, yaw: float, target_x: float, target_y: float, wheelbase: float,
          steering: float, max_steering: float, max_rate: float, dt_s: float) -> float:
    """
    Steer towards a point on the reference: pure pursuit (Snider 2009, section 2.2).

    The arc through the rear axle, tangent to the heading, and the point has the curvature
    2 y_t / (x_t^2 + y_t^2) with the point's coordinates in the vehicle's frame; the bicycle
    drives it with tan(delta) = L curvature. Exact on circles.

    :param x, y, yaw: of the rear axle [m], [rad]
    :param target_x, target_y: the point, at `pursuit_distance` [m]
    :param wheelbase: L [m]
    :param steering: angle now [rad]
    :param max_steering: its bound [rad]
    :param max_rate: bound of its rate [rad/s]
    :param dt_s: until the next call [s]
    :return: steering angle for the step [rad]
    """
    dx, dy = target_x - x, target_y - y
    lateral = dy * math.cos(yaw) - dx * math.sin(yaw)
    squared = max(dx * dx + dy * dy, 1e-6)
    wanted = math.atan(2.0 * wheelbase * lateral / squared)
    reach = max_rate * dt_s
    changed = min(max(wanted, steering - reach), steering + reach)
    return min(max(changed, -max_steering), max_steering)


@compiled
def move(x: float, y: float, yaw: float, speed: float, steering: float, acceleration: float,
         wheelbase: float, dt_s: float) -> tuple[float, float, float, float]:
    """
    Advance a kinematic bicycle (CRG 2-4) by one step, exactly.

    With constant steering angle and acceleration a rear axle drives an arc: the distance ds is
    quadratic in time, the turn is ds tan(delta) / L and the chord ds sin(turn / 2) / (turn / 2).
    Who brakes to rest within the step stays there; nobody moves backwards.

    :param x, y, yaw: of the rear axle [m], [rad]
    :param speed: at least 0 [m/s]
    :param steering: [rad]
    :param acceleration: [m/s^2]
    :param wheelbase: L [m]
    :return: x, y, yaw (not normalised) and speed after the step
    """
    end_speed = max(speed + acceleration * dt_s, 0.0)
    driven = 0.5 * (speed + end_speed) * dt_s
    if end_speed == 0.0 and acceleration < 0.0:
        driven = 0.5 * speed * speed / -acceleration
    half_turn = 0.5 * driven * math.tan(steering) / wheelbase
    chord = driven * (math.sin(half_turn) / half_turn if abs(half_turn) > STRAIGHT else 1.0)
    middle = yaw + half_turn
    return (x + chord * math.cos(middle), y + chord * math.sin(middle), middle + half_turn,
            end_speed)
