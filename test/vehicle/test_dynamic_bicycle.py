# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""FS equation 2 against closed forms and an independent integration."""

from dataclasses import replace
import math

from crgame_ros.errors import InputError
from crgame_ros.vehicle.dynamic_bicycle import DynamicBicycle
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest
from scipy.integrate import solve_ivp

VEHICLE = load_vehicle_parameters()
# Without a limit of the steering rate FS 2 is linear in delta, v and a.
FREE = replace(VEHICLE, max_steering_rate=math.inf)
G_S, T_DELTA, T_A = 0.9, 0.2, 0.5
OPTIONS = {'slip': G_S, 'steering_lag': T_DELTA, 'acceleration_lag': T_A}


def run(model: DynamicBicycle, state: VehicleState, angle: float, acceleration: float,
        duration_s: float, dt_s: float) -> VehicleState:
    for _ in range(round(duration_s / dt_s)):
        state = model.step(state, angle, acceleration, dt_s)
    return state


@pytest.mark.parametrize('dt_s', [0.001, 0.01, 0.05])
def test_step_response_of_steering(dt_s: float) -> None:
    """63.2 % at T_delta and the exponential everywhere, for any step: it is exact."""
    model, state = DynamicBicycle(FREE, **OPTIONS), VehicleState(0.0, 0.0, 0.0, 5.0)
    for n in range(1, round(1.0 / dt_s) + 1):
        state = model.step(state, 0.1, 0.0, dt_s)
        exact = 0.1 * (1.0 - math.exp(-n * dt_s / T_DELTA))
        assert state.steering_angle == pytest.approx(exact, rel=1e-12)
        if n * dt_s == pytest.approx(T_DELTA):
            assert state.steering_angle == pytest.approx(0.0632, abs=2e-5)
    assert state.steering_rate < 0.01


@pytest.mark.parametrize('dt_s', [0.001, 0.01, 0.05])
def test_step_response_of_acceleration(dt_s: float) -> None:
    """63.2 % at T_a; v = v_0 + a_c (t - T_a (1 - e^(-t / T_a))), x its integral."""
    model, state = DynamicBicycle(VEHICLE, **OPTIONS), VehicleState(0.0, 0.0, 0.0, 10.0)
    for n in range(1, round(2.0 / dt_s) + 1):
        state = model.step(state, 0.0, 2.0, dt_s)
        t = n * dt_s
        lagged = T_A * (1.0 - math.exp(-t / T_A))
        assert state.acceleration == pytest.approx(2.0 * lagged / T_A, rel=1e-12)
        assert state.speed == pytest.approx(10.0 + 2.0 * (t - lagged), rel=1e-12)
        assert state.x == pytest.approx(10.0 * t + t * t - 2.0 * T_A * (t - lagged), rel=1e-7)
        if t == pytest.approx(T_A):
            assert state.acceleration == pytest.approx(2.0 * 0.632, abs=4e-4)


def test_radius_of_a_steady_circle() -> None:
    """R = L / (G_s tan delta), 28.9 m, to a tenth of a millimetre over two rounds."""
    model = DynamicBicycle(VEHICLE, **OPTIONS)
    radius = VEHICLE.wheelbase / (G_S * math.tan(0.098815))
    assert radius == pytest.approx(28.9, abs=0.05)
    state = VehicleState(radius, 0.0, 0.5 * math.pi, 8.0, 0.098815)
    for _ in range(4600):
        state = model.step(state, 0.098815, 0.0, 0.01)
        assert math.hypot(state.x, state.y) == pytest.approx(radius, abs=1e-4)
    assert state.yaw_rate == pytest.approx(8.0 / radius, rel=1e-12)


def derivative(model: DynamicBicycle, angle: float, command: float):  # noqa: ANN201
    """Return the derivative of FS 2 as printed, with the rate limit."""
    def change(_: float, z: np.ndarray) -> list[float]:
        _, _, theta, delta, v, a = z
        limit = model.vehicle.max_steering_rate
        return [v * math.cos(theta), v * math.sin(theta),
                G_S * v / VEHICLE.wheelbase * math.tan(delta),
                min(limit, max(-limit, (angle - delta) / T_DELTA)), a, (command - a) / T_A]
    return change


@pytest.mark.parametrize(('vehicle', 'tolerance'), [(FREE, 2e-7), (VEHICLE, 2e-5)],
                         ids=['unlimited', 'limited steering rate'])
def test_against_an_independent_integration(vehicle: object, tolerance: float) -> None:
    """Changing commands over 4 s at 10 ms, against scipy's DOP853 at a tolerance of 1e-12."""
    model = DynamicBicycle(vehicle, **OPTIONS)  # type: ignore[arg-type]
    state = VehicleState(1.0, -2.0, 3.0, 12.0, 0.02, 0.5)
    exact = np.array((1.0, -2.0, 3.0, 0.02, 12.0, 0.5))
    for angle, command in ((0.15, 1.0), (-0.2, -3.0), (0.05, 4.0), (0.0, -1.0)):
        state = run(model, state, angle, command, 1.0, 0.01)
        exact = solve_ivp(derivative(model, angle, command), (0.0, 1.0), exact, method='DOP853',
                          rtol=1e-12, atol=1e-12, max_step=0.01).y[:, -1]
        assert state.steering_angle == pytest.approx(exact[3], abs=1e-6)
        assert state.speed == pytest.approx(exact[4], abs=1e-9)
        assert (state.x, state.y) == pytest.approx(exact[:2], abs=tolerance)
        assert math.remainder(state.yaw - exact[2], 2.0 * math.pi) == pytest.approx(
            0.0, abs=tolerance)


def test_steering_rate_limit_then_exponential() -> None:
    """From 0 to 0.5 rad: 0.4 rad/s until 0.08 rad are left, after 1.05 s, then e^(-t / 0.2)."""
    model, state = DynamicBicycle(VEHICLE, **OPTIONS), VehicleState(0.0, 0.0, 0.0, 5.0)
    for n in range(1, 201):
        state = model.step(state, 0.5, 0.0, 0.01)
        t = 0.01 * n
        expected = 0.4 * t if t <= 1.05 else 0.5 - 0.08 * math.exp(-(t - 1.05) / T_DELTA)
        assert state.steering_angle == pytest.approx(expected, abs=1e-12)
        assert state.steering_rate <= 0.4 + 1e-12


def test_stop_is_where_the_closed_form_has_it() -> None:
    """v(t) = 0 within a step: x moves up to then by the exact integral, and rests after it."""
    model = DynamicBicycle(VEHICLE, **OPTIONS)
    state = run(model, VehicleState(0.0, 0.0, 0.0, 3.0), 0.0, -5.0, 3.0, 0.01)
    low, high = 0.5, 3.0
    for _ in range(80):
        t = 0.5 * (low + high)
        lagged = T_A * (1.0 - math.exp(-t / T_A))
        low, high = (t, high) if 3.0 - 5.0 * (t - lagged) > 0.0 else (low, t)
    way = 3.0 * t - 2.5 * t * t + 5.0 * T_A * (t - lagged)
    assert state.x == pytest.approx(way, abs=1e-8)
    assert (state.speed, state.acceleration) == (0.0, 0.0)


def test_slip_of_zero_goes_straight() -> None:
    state = run(DynamicBicycle(VEHICLE, slip=0.0), VehicleState(0.0, 0.0, 0.3, 10.0), 0.5, 0.0,
                2.0, 0.01)
    assert (state.yaw, state.yaw_rate) == (0.3, 0.0)
    assert math.atan2(state.y, state.x) == pytest.approx(0.3)


def test_defaults_come_from_the_configuration() -> None:
    settings = DynamicBicycle(VEHICLE).settings
    assert (settings.slip, settings.steering_lag, settings.acceleration_lag) == (0.95, 0.15, 0.3)
    assert DynamicBicycle(VEHICLE, slip=0.8).settings == replace(settings, slip=0.8)


@pytest.mark.parametrize(('option', 'value'), [
    ('slip', 1.01), ('slip', -0.1), ('steering_lag', 0.0), ('acceleration_lag', math.inf)])
def test_options_out_of_bounds_are_refused(option: str, value: float) -> None:
    with pytest.raises(InputError, match=f'"{option}" is {value}; give a number from'):
        DynamicBicycle(VEHICLE, **{option: value})
