# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steering of one agent along its reference: pure pursuit and kinematic bicycle."""

import math

from crgame_ros.traffic.compiling.compiled import compiled, inlined

# Time to the target point; Snider (2009) tunes it per course, 1 s is steady on straights [s]. Then
# the bounds of its distance [m].
PURSUIT_TIME, SHORTEST, LONGEST = 1.0, 3.0, 25.0
# Where the road bends, the chord to the target point leaves it by at most this [m].
CUT = 0.12
# In a curve the front swings out: the rear axle shifts to the inside by at most this [m].
MAX_CURVE_SHIFT = 1.0
# Greatest swing to the outside of a bend that is too tight otherwise [m].
MAX_SWING = 1.5
# Least distance from rear axle to front bumper of a long vehicle: one of over 6.25 m [m].
LONG_FRONT = 5.0


@inlined
def curve_shift(curvature: float, front: float) -> float:
    """
    Return how far to the left of the centre line a rear axle runs, negative to the right [m].

    With the rear axle f^2 / (4 R) inside a bend, the rear's inner and the front's outer corner are
    equally far out: the vehicle takes the same additional width on either side.

    :param curvature: 1 / R, positive to the left [1/m]
    :param front: f, from the rear axle to the front bumper [m]
    """
    return min(max(0.25 * curvature * front * front, -MAX_CURVE_SHIFT), MAX_CURVE_SHIFT)


@inlined
def swing_out(swing: float, swing_long: float, front: float) -> float:
    """
    Return how far to the left a vehicle swings out for a bend that is too tight otherwise [m].

    :param swing: of cars, at the point of the lane [1/m]
    :param swing_long: of long vehicles [1/m]
    :param front: from the rear axle to the front bumper [m]
    """
    rate = swing if front < LONG_FRONT else swing_long
    return min(max(rate * front * front, -MAX_SWING), MAX_SWING)


@compiled
def pursuit_distance(speed: float, curvature: float) -> float:
    """
    Return how far ahead on the reference the target point of `steer_towards` lies.

    A chord of length l leaves an arc by l^2 |kappa| / 8.

    :param speed: [m/s]
    :param curvature: of the road between here and there [1/m]
    :return: from the rear axle [m]
    """
    straight = min(max(PURSUIT_TIME * speed, SHORTEST), LONGEST)
    return max(min(straight, math.sqrt(8.0 * CUT / max(abs(curvature), 1e-6))), SHORTEST)


@inlined
def steer_towards(ahead: float, aside: float, wheelbase: float, steering: float,
                  max_steering: float, max_rate: float, dt_s: float) -> float:
    """
    Return the steering towards a point on the reference: pure pursuit (Snider 2009, section 2.2).

    The arc through the rear axle, tangent to the heading, and the point has the curvature
    2 y_t / (x_t^2 + y_t^2) with the point's coordinates in the vehicle's frame; the bicycle
    drives it with tan(delta) = L curvature. Exact on circles. Towards a point behind it the
    vehicle turns as sharply as it can.

    :param ahead, aside: the point, at `pursuit_distance`, in the frame of the rear axle [m]
    :param wheelbase: L [m]
    :param steering: angle now [rad]
    :param max_steering: its bound [rad]
    :param max_rate: bound of its rate [rad/s]
    :param dt_s: until the next call [s]
    :return: steering angle for the step [rad]
    """
    wanted = math.atan(2.0 * wheelbase * aside / max(ahead * ahead + aside * aside, 1e-6))
    if ahead < 0.0:
        wanted = math.copysign(max_steering, aside)
    reach = max_rate * dt_s
    changed = min(max(wanted, steering - reach), steering + reach)
    return min(max(changed, -max_steering), max_steering)


@inlined
def drive(speed: float, steering: float, acceleration: float, wheelbase: float,
          dt_s: float) -> tuple[float, float, float]:
    """
    Advance a kinematic bicycle (CRG 2-4) by one step along its heading, exactly.

    With constant steering angle and acceleration a rear axle drives an arc: the distance ds is
    quadratic in time, the turn is ds tan(delta) / L and the chord ds sin(turn / 2) / (turn / 2).
    A vehicle that brakes to rest within the step stays there; it never moves backwards.

    :param speed: at least 0 [m/s]
    :param steering: [rad]
    :param acceleration: [m/s^2]
    :param wheelbase: L [m]
    :return: the chord, at half the turn from the heading [m], half the turn [rad] and the speed
        after the step [m/s]
    """
    end_speed = max(speed + acceleration * dt_s, 0.0)
    driven = 0.5 * (speed + end_speed) * dt_s
    if end_speed == 0.0 and acceleration < 0.0:
        driven = 0.5 * speed * speed / -acceleration
    half_turn = 0.5 * driven * math.tan(steering) / wheelbase
    # sin(x) / x; a step turns by less than 0.1 rad.
    squared = half_turn * half_turn
    return driven * (1.0 - squared / 6.0 * (1.0 - squared / 20.0)), half_turn, end_speed
