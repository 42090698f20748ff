# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The kinematic single-track model (CRG 2-4) against closed forms and other integrators."""

import math

from crgame_ros.vehicle.models import integrate
import numpy as np
from numpy.typing import NDArray
import pytest
from scipy.integrate import solve_ivp
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.vehicle_dynamics_ks import vehicle_dynamics_ks

L = 2.5789128
State = tuple[float, float, float, float, float]


def slope(state: NDArray[np.float64], acceleration: float, rate: float) -> NDArray[np.float64]:
    """Return the derivative of CRG 2-4 as printed."""
    _, _, yaw, speed, steering = state
    return np.array([speed * math.cos(yaw), speed * math.sin(yaw),
                     speed * math.tan(steering) / L, acceleration, rate])


def textbook_step(state: State, acceleration: float, rate: float, dt: float) -> State:
    """Return a classical Runge-Kutta step with its four slopes."""
    start = np.array(state)
    first = slope(start, acceleration, rate)
    second = slope(start + 0.5 * dt * first, acceleration, rate)
    third = slope(start + 0.5 * dt * second, acceleration, rate)
    fourth = slope(start + dt * third, acceleration, rate)
    return tuple((start + dt / 6.0 * (first + 2 * second + 2 * third + fourth)).tolist())


def drive(state: State, acceleration: float, rate: float, duration: float,
          steps: int) -> NDArray[np.float64]:
    """Integrate in equal steps."""
    for _ in range(steps):
        state = integrate(*state, acceleration, rate, L, duration / steps)
    return np.array(state)


@pytest.mark.parametrize('steering', [0.05, 0.3, -0.6])
@pytest.mark.parametrize('speed', [10.0, -4.0])
def test_constant_speed_and_steering_is_a_circle(speed: float, steering: float) -> None:
    """
    The rear axle turns around (0, R) with R = L / tan(delta), forwards and backwards.

    A step of RK4 errs by v dt (w dt)^4 / 2880, here less than 1e-8 m.
    """
    radius = L / math.tan(steering)
    state: State = (0.0, 0.0, 0.0, speed, steering)
    for n in range(1, 1001):
        state = integrate(*state, 0.0, 0.0, L, 0.01)
        turned = speed * 0.01 * n / radius
        assert state[2] == pytest.approx(turned, abs=1e-10)
        assert math.hypot(state[0], state[1] - radius) == pytest.approx(abs(radius), abs=1e-6)
        assert state[0] == pytest.approx(radius * math.sin(turned), abs=1e-5)
        assert state[1] == pytest.approx(radius * (1.0 - math.cos(turned)), abs=1e-5)


def test_full_circle_returns_to_its_start() -> None:
    """After 2 pi R / v the car is back at its start."""
    speed, steering = 8.0, 0.25
    duration = 2.0 * math.pi * L / math.tan(steering) / speed
    end = drive((3.0, -2.0, 0.5, speed, steering), 0.0, 0.0, duration, 1000)
    np.testing.assert_allclose(end, (3.0, -2.0, 0.5 + 2.0 * math.pi, speed, steering), atol=1e-8)


def test_straight_line_is_exact() -> None:
    """Without steering s = v t + a t^2 / 2, to rounding, in any direction."""
    end = drive((1.0, 2.0, 0.7, 5.0, 0.0), 1.5, 0.0, 4.0, 13)
    distance = 5.0 * 4.0 + 0.5 * 1.5 * 16.0
    place = 1.0 + distance * math.cos(0.7), 2.0 + distance * math.sin(0.7)
    np.testing.assert_allclose(end, (*place, 0.7, 11.0, 0.0), rtol=1e-13)


def test_equals_the_textbook_step() -> None:
    """The shared slopes lose no accuracy: equal to 1e-13 over random states and inputs."""
    random = np.random.default_rng(11)
    for _ in range(500):
        state = (*random.uniform(-50, 50, 2), random.uniform(-3, 3), random.uniform(-10, 40),
                 random.uniform(-0.9, 0.9))
        acceleration, rate = random.uniform(-10, 10), random.uniform(-0.4, 0.4)
        dt = random.uniform(1e-4, 0.2)
        np.testing.assert_allclose(integrate(*state, acceleration, rate, L, dt),
                                   textbook_step(state, acceleration, rate, dt),
                                   rtol=1e-12, atol=1e-12)


def test_fourth_order_against_a_fine_reference() -> None:
    """Halving the step divides the error by 16: RK4 while braking and turning in."""
    start, acceleration, rate = (0.0, 0.0, 0.2, 15.0, -0.1), -2.0, 0.15
    reference = solve_ivp(lambda _, state: slope(state, acceleration, rate), (0.0, 3.0), start,
                          method='DOP853', rtol=1e-13, atol=1e-13).y[:, -1]
    errors = np.array([np.hypot(*(drive(start, acceleration, rate, 3.0, steps) - reference)[:2])
                       for steps in (30, 60, 120)])
    np.testing.assert_allclose(errors[:-1] / errors[1:], 16.0, rtol=0.1)
    # At the step of 10 ms the simulator errs by less than a micrometre in 3 s.
    end = drive(start, acceleration, rate, 3.0, 300)
    assert np.abs(end - reference).max() < 1e-6


def test_agrees_with_commonroad_vehicle_models() -> None:
    """The right-hand side of CommonRoad's own KS model, vehicle 2, integrated by scipy."""
    parameters = parameters_vehicle2()
    acceleration, rate = 0.8, -0.05
    # Their order: x, y, steering, speed, yaw; inputs: steering rate, acceleration.
    end = solve_ivp(lambda _, state: vehicle_dynamics_ks(state, [rate, acceleration], parameters),
                    (0.0, 2.0), (0.0, 0.0, 0.2, 12.0, -0.4), rtol=1e-11, atol=1e-11).y[:, -1]
    ours = drive((0.0, 0.0, -0.4, 12.0, 0.2), acceleration, rate, 2.0, 200)
    assert parameters.a + parameters.b == pytest.approx(L, abs=1e-9)
    np.testing.assert_allclose(ours, end[[0, 1, 4, 3, 2]], atol=1e-7)
