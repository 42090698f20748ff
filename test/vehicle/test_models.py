# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Properties of every vehicle model, and of the kinematic one."""

from dataclasses import replace
import math

from crgame_ros.vehicle.models import KinematicSingleTrack, VEHICLE_MODELS, VehicleModel
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest

VEHICLE = load_vehicle_parameters()
DT = 0.01
MODELS = ['ks', 'dynamic-bicycle']


def made(name: str, **options: object) -> VehicleModel:
    model: VehicleModel = VEHICLE_MODELS.create(name, options, vehicle=VEHICLE)
    return model


def at(speed: float, **others: float) -> VehicleState:
    return VehicleState(0.0, 0.0, 0.0, speed, **others)


def test_the_names() -> None:
    assert VEHICLE_MODELS.names()[:2] == ('ks', 'dynamic-bicycle')


@pytest.mark.parametrize('name', MODELS)
@pytest.mark.parametrize('gear', [1, -1])
def test_a_brake_command_stops_and_holds(name: str, gear: int) -> None:
    """From 5 m/s in either direction: monotone to 0, then not a millimetre in 3 s."""
    model, state = made(name), at(5.0 * gear)
    model.gear = gear
    stopped = None
    for _ in range(500):
        before, state = state, model.step(state, 0.0, -4.0 * gear, DT)
        assert 0.0 <= state.speed * gear <= before.speed * gear
        assert (state.x - before.x) * gear >= 0.0
        stopped = state.x if state.speed == 0.0 and stopped is None else stopped
    # 5^2 / (2 4) m, with FS 2 about 5 m/s 0.3 s more.
    assert abs(state.x) == pytest.approx(3.125 + (1.3 if name != 'ks' else 0.0), abs=0.1)
    assert (state.x, state.speed, state.acceleration, state.yaw_rate) == (stopped, 0.0, 0.0, 0.0)


@pytest.mark.parametrize('name', MODELS)
def test_the_gear_decides_which_command_moves(name: str) -> None:
    for gear in (1, -1):
        for command in (3.0, -3.0):
            model, state = made(name), at(0.0)
            model.gear = gear
            for _ in range(100):
                state = model.step(state, 0.0, command, DT)
            if command * gear > 0.0:
                assert state.speed * gear > 1.9
                assert state.x * gear > 0.5
            else:
                assert (state.x, state.speed, state.acceleration) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize('name', MODELS)
def test_wheels_turn_at_rest(name: str) -> None:
    """The wheels turn while a brake holds the car, at no more than 0.4 rad/s."""
    model, state = made(name), at(0.0)
    for _ in range(300):
        state = model.step(state, 0.5, -1.0, DT)
    assert state.steering_angle == pytest.approx(0.5, abs=1e-3)
    assert (state.x, state.y, state.yaw) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize('name', MODELS)
@pytest.mark.parametrize(('start', 'command', 'limit'), [(50.0, 9.0, 50.8), (-13.0, -9.0, -13.9)])
def test_speed_reaches_its_limit_and_stays(name: str, start: float, command: float,
                                           limit: float) -> None:
    model, state = made(name), at(start)
    for _ in range(300):
        state = model.step(state, 0.0, command, DT)
        assert abs(state.speed) <= abs(limit) + 1e-12
    assert state.speed == pytest.approx(limit, abs=1e-9)
    assert state.acceleration == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('name', MODELS)
@pytest.mark.parametrize('speed', [60.0, -20.0])
def test_above_its_limit_a_car_rolls_on_and_brakes_as_any(name: str, speed: float) -> None:
    """A game may begin so; the speed does not jump to the limit."""
    model = made(name)
    state = model.step(at(speed), 0.0, math.copysign(9.0, speed), DT)
    assert (state.speed, state.acceleration) == (speed, 0.0)
    for _ in range(100):
        state = model.step(state, 0.0, -math.copysign(4.0, speed), DT)
    assert 2.5 < abs(speed) - abs(state.speed) < 4.001


@pytest.mark.parametrize('name', MODELS)
@pytest.mark.parametrize('seed', range(3))
def test_limits_hold_under_any_command(name: str, seed: int) -> None:
    """Commands far outside: angle 0.91 rad, rate 0.4 rad/s, 11.5 m/s^2; no change of direction."""
    random = np.random.default_rng(seed)
    model = made(name)
    state = at(float(random.uniform(-10.0, 50.0)))
    for _ in range(60):
        angle, command = random.uniform((-3.0, -40.0), (3.0, 40.0)).tolist()
        if state.speed == 0.0:
            model.gear = int(random.choice((-1, 1)))
        for dt in random.uniform(1e-4, 0.05, 30).tolist():
            before, direction = state, model.direction(state.speed)
            state = model.step(state, angle, command, dt)
            assert state.speed * direction >= 0.0
            assert abs(state.steering_angle) <= 0.91
            assert abs(state.steering_angle - before.steering_angle) <= 0.4 * dt + 1e-12
            assert abs(state.acceleration) <= 11.5 + 1e-9
            assert abs(state.speed - before.speed) <= 11.5 * dt + 1e-9
            assert -math.pi < state.yaw <= math.pi
            moved = math.hypot(state.x - before.x, state.y - before.y)
            assert moved <= (max(abs(before.speed), abs(state.speed)) + 11.5 * dt) * dt + 1e-9


def test_kinematic_model_obeys_at_once() -> None:
    """Acceleration in the first step, the steering angle at 0.4 rad/s; the circle's radius."""
    model = KinematicSingleTrack(VEHICLE)
    state = model.step(at(10.0), 0.1, 2.0, DT)
    assert (state.speed, state.acceleration) == (10.02, 2.0)
    assert state.steering_angle == pytest.approx(0.004)
    state = at(10.0, steering_angle=0.1)
    xs = []
    for _ in range(2000):
        state = model.step(state, 0.1, 0.0, DT)
        xs.append(state.x)
    # An odd multiple of a quarter turn inside: both extremes are reached.
    radius = VEHICLE.wheelbase / math.tan(0.1)
    assert (max(xs) - min(xs)) / 2.0 == pytest.approx(radius, rel=1e-5)


def test_kinematic_model_with_the_powertrain_lag() -> None:
    """CRG 25: a_n = a_c (1 - (1 - dt / tau)^n)."""
    vehicle = replace(VEHICLE, longitudinal_lag=0.2)
    model, state = KinematicSingleTrack(vehicle, powertrain_lag=True), at(10.0)
    for n in range(1, 50):
        state = model.step(state, 0.0, 2.0, DT)
        assert state.acceleration == pytest.approx(2.0 * (1.0 - 0.95 ** n), rel=1e-12)
