# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The fleet of kinematic bicycles against the scalar model, circles and a swerve."""

from crgame_ros.traffic.lanes import pursuit
from crgame_ros.traffic.motion.elastic_band import ElasticBand
from crgame_ros.traffic.motion.passage import Obstacles
from crgame_ros.vehicle.models import integrate
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

# The functions of one vehicle, for fleets.
drive, steer_towards = np.vectorize(pursuit.drive), np.vectorize(pursuit.steer_towards)
distance_at = np.vectorize(pursuit.pursuit_distance)


def pursuit_distance(speed: Array, curvature: float = 0.0) -> Array:
    return distance_at(speed, curvature)


def move(x: Array, y: Array, yaw: Array, speed: Array, steering: Array, acceleration: Array,
         wheelbase: Array, dt_s: float) -> tuple[Array, Array, Array, Array]:
    chord, half, speed = drive(speed, steering, acceleration, wheelbase, dt_s)
    return (x + chord * np.cos(yaw + half), y + chord * np.sin(yaw + half), yaw + 2.0 * half,
            speed)


def steer(x: Array, y: Array, yaw: Array, target_x: Array, target_y: Array, wheelbase: Array,
          steering: Array, *limits: float) -> Array:
    dx, dy, cos, sin = target_x - x, target_y - y, np.cos(yaw), np.sin(yaw)
    return steer_towards(dx * cos + dy * sin, dy * cos - dx * sin, wheelbase, steering, *limits)


def test_motion_is_that_of_the_single_track_model() -> None:
    """200 vehicles over 1 s against CRG 2-4 by Runge-Kutta, one by one."""
    rng = np.random.default_rng(8)
    n = 200
    x, y = rng.uniform(-100.0, 100.0, (2, n))
    yaw, speed = rng.uniform(-4.0, 4.0, n), rng.uniform(5.0, 30.0, n)
    steering, acceleration = rng.uniform(-0.5, 0.5, n), rng.uniform(-4.0, 2.0, n)
    steering[::10] = 0.0
    wheelbase = rng.uniform(2.3, 6.0, n)
    scalar = [(x[i], y[i], yaw[i], speed[i], steering[i]) for i in range(n)]
    for _ in range(100):
        x, y, yaw, speed = move(x, y, yaw, speed, steering, acceleration, wheelbase, 0.01)
        scalar = [integrate(*state, acceleration[i], 0.0, wheelbase[i], 0.01)
                  for i, state in enumerate(scalar)]
    # The chord along the mean heading is exact; RK4 errs by less than 1e-6 m here.
    np.testing.assert_allclose(np.column_stack((x, y, yaw, speed)),
                               np.array(scalar)[:, :4], atol=1e-6)


def test_braking_ends_at_rest_after_the_braking_distance() -> None:
    """They stop after v^2 / (2 a), without a step more or backwards; standing agents stay."""
    speed, braking = np.array([10.0, 0.37, 0.0, 0.0]), np.array([-3.0, -8.0, -8.0, 0.0])
    distance = np.array([100.0 / 6.0, 0.37 ** 2 / 16.0, 0.0, 0.0])
    x, y, yaw, zero = (np.zeros(4) for _ in range(4))
    for _ in range(400):
        x, y, yaw, speed = move(x, y, yaw, speed, zero, braking, np.full(4, 2.6), 0.01)
    np.testing.assert_allclose(x, distance, atol=1e-12)
    np.testing.assert_array_equal(speed, 0.0)


@pytest.mark.parametrize('radius', [8.0, -25.0, 150.0])
def test_a_circle_is_driven_exactly(radius: float) -> None:
    """On the circle with tan(delta) = L / R, pure pursuit keeps the steering and the circle."""
    n, wheelbase = 3, np.array([2.4, 2.6, 4.0])
    speed = np.array([3.0, 6.0, 8.0])
    x, y, yaw = np.zeros(n), np.zeros(n), np.zeros(n)
    steering = np.arctan(wheelbase / radius)
    for _ in range(1500):
        angle = yaw + pursuit_distance(speed, 1.0 / radius) / radius
        target_x, target_y = radius * np.sin(angle), radius * (1.0 - np.cos(angle))
        steering = steer(x, y, yaw, target_x, target_y, wheelbase, steering, 1.0, 1.0, 0.01)
        np.testing.assert_allclose(np.tan(steering), wheelbase / radius, rtol=1e-6)
        x, y, yaw, speed = move(x, y, yaw, speed, steering, np.zeros(n), wheelbase, 0.01)
    np.testing.assert_allclose(np.hypot(x, y - radius), abs(radius), atol=1e-6)
    np.testing.assert_allclose(yaw, 15.0 * speed / radius, atol=1e-6)


def test_vehicles_come_back_to_a_line_without_swinging() -> None:
    """From 1 m beside a straight reference at 3 to 35 m/s; the overshoot stays below 10 %."""
    speed = np.array([3.0, 10.0, 20.0, 35.0])
    x, yaw, steering = np.zeros(4), np.zeros(4), np.zeros(4)
    y = np.ones(4)
    lowest = y.copy()
    for _ in range(2000):
        steering = steer(x, y, yaw, x + pursuit_distance(speed), np.zeros(4), np.full(4, 2.6),
                         steering, 0.7, 0.4, 0.01)
        x, y, yaw, speed = move(x, y, yaw, speed, steering, np.zeros(4), np.full(4, 2.6), 0.01)
        lowest = np.minimum(lowest, y)
    np.testing.assert_allclose(y, 0.0, atol=1e-3)
    assert lowest.min() > -0.1


def test_steering_keeps_its_limits() -> None:
    """To a point beside the vehicle or behind it: 0.4 rad/s until 0.6 rad, on both sides."""
    zero = np.zeros(3)
    target_x, target_y = np.array([0.5, 0.5, -3.0]), np.array([4.0, -4.0, 0.5])
    steering = zero
    for n in range(1, 301):
        steering = steer(zero, zero, zero, target_x, target_y, np.full(3, 2.6), steering,
                         np.array([0.6, 0.5, 0.6]), 0.4, 0.01)
        if n == 100:
            np.testing.assert_allclose(steering[:2], [0.4, -0.4])
    np.testing.assert_allclose(steering, [0.6, -0.5, 0.6])


@pytest.mark.exhaustive
def test_a_swerve_of_the_elastic_band_is_driven_with_its_clearance() -> None:
    """Along d(s) of a straight lane at its speed: the centre stays within 0.25 m of the band."""
    planner = ElasticBand()
    found = Obstacles(*np.array([[150.0], [0.0], [2.25], [0.9]]))
    for value in (5.0, 14.0, 25.0):
        d = planner.relax(np.full(301, 5.25), np.full(301, 1.75), value, found).d
        x, y, yaw, steering = (np.zeros(1) for _ in range(4))
        speed, wheelbase, beside = np.array([value]), np.array([2.6]), []
        while x[0] < 270.0:
            ahead = x + pursuit_distance(speed)
            steering = steer(x, y, yaw, ahead, np.interp(ahead, np.arange(301.0), d), wheelbase,
                             steering, 0.7, 0.4, 0.01)
            x, y, yaw, speed = move(x, y, yaw, speed, steering, np.zeros(1), wheelbase, 0.01)
            center_x, center_y = x + 1.4 * np.cos(yaw), y + 1.4 * np.sin(yaw)
            wanted = np.interp(center_x, np.arange(301.0), d)
            assert abs(center_y - wanted)[0] < 0.25
            if abs(center_x[0] - 150.0) < 2.25 + 2.5:
                beside.append(center_y[0] - 0.9 - 1.0)
        # Cutting the curve leaves at least the least clearance.
        assert min(beside) > 0.3
