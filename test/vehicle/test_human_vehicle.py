# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A human's vehicle as a whole: energy, limits, stopping, reverse."""

from dataclasses import replace
import math

from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.dynamic_bicycle import DynamicBicycle
from crgame_ros.vehicle.human_vehicle import HumanVehicle
from crgame_ros.vehicle.models import KinematicSingleTrack
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest

VEHICLE = load_vehicle_parameters()
# Without drivetrain lag, for comparison with a closed form.
DIRECT = replace(VEHICLE, longitudinal_lag=1e-9)
RELEASED, THROTTLE = DriverCommand(), DriverCommand(throttle=1.0)
BRAKE, BACK = DriverCommand(brake=1.0), DriverCommand(throttle=0.5, reverse=True)
ROLLING_FORCE = 0.012 * VEHICLE.mass * 9.81
DRAG = 0.5 * 1.225 * 0.29 * 2.11


def at_speed(speed: float, **others: float) -> VehicleState:
    """Make a car at the origin."""
    return VehicleState(0.0, 0.0, 0.0, speed, **others)


def test_coasting_conserves_energy() -> None:
    """The work of drag and rolling resistance equals the lost kinetic energy within 0.1 %."""
    car = HumanVehicle(DIRECT, at_speed(35.0))
    work, dt = 0.0, 0.01
    for _ in range(3000):
        before = car.state
        after = car.step(RELEASED, dt)
        middle = 0.5 * (before.speed + after.speed)
        work += (ROLLING_FORCE + DRAG * middle**2) * (after.x - before.x)
    lost = 0.5 * VEHICLE.mass * (35.0**2 - car.state.speed**2)
    assert car.state.speed < 30.0
    assert work == pytest.approx(lost, rel=1e-3)


def test_coasting_follows_its_closed_form() -> None:
    """For m v' = -(c + k v^2), v = sqrt(c/k) tan(atan(v0 sqrt(k/c)) - sqrt(k c) t / m)."""
    car = HumanVehicle(DIRECT, at_speed(35.0))
    shape = math.sqrt(ROLLING_FORCE / DRAG)
    for n in range(1, 6001):
        state = car.step(RELEASED, 0.01)
        angle = math.atan(35.0 / shape) - math.sqrt(DRAG * ROLLING_FORCE) * 0.01 * n / VEHICLE.mass
        assert state.speed == pytest.approx(shape * math.tan(angle), abs=0.005)


def test_acceleration_lags_the_pedal() -> None:
    """From a standstill under constant command: CRG 25's closed form, speed its sum."""
    car = HumanVehicle(VEHICLE, at_speed(0.0))
    commanded = ((1.0 - math.exp(-4.0)) * 1.0489 * VEHICLE.mass * 9.81 - ROLLING_FORCE) \
        / VEHICLE.mass
    speed = 0.0
    for n in range(1, 21):
        state = car.step(THROTTLE, 0.01)
        expected = commanded * (1.0 - (1.0 - 0.01 / 0.15)**n)
        speed += 0.01 * expected
        # Drag, which the closed form leaves out, is below 1 N here.
        assert state.acceleration == pytest.approx(expected, abs=2e-3)
        assert state.speed == pytest.approx(speed, abs=1e-3)


@pytest.mark.parametrize('command', [
    RELEASED, BRAKE, DriverCommand(brake=1.0, reverse=True), DriverCommand(steering=0.7)])
def test_standing_car_does_not_move(command: DriverCommand) -> None:
    """Rolling resistance and brakes never start a motion."""
    car = HumanVehicle(VEHICLE, at_speed(0.0))
    for _ in range(500):
        state = car.step(command, 0.01)
        assert (state.x, state.y, state.yaw, state.speed, state.acceleration) == (0.0,) * 5


def test_acceleration_does_not_linger_at_rest() -> None:
    """Static friction holds a car that starts at rest with a lagged acceleration."""
    for command in (RELEASED, BRAKE):
        state = HumanVehicle(VEHICLE, at_speed(0.0, acceleration=2.0)).step(command, 0.01)
        assert (state.x, state.speed, state.acceleration) == (0.0, 0.0, 0.0)


def test_wheels_turn_for_the_whole_step_in_which_the_car_stops() -> None:
    """Braking from 0.02 m/s takes 2 ms of 10; the wheels turn at 0.4 rad/s for all 10 ms."""
    car = HumanVehicle(DIRECT, at_speed(0.02))
    state = car.step(DriverCommand(brake=1.0, steering=1.0), 0.01)
    assert state.speed == 0.0
    assert state.steering_angle == pytest.approx(0.004)


def test_braking_stops_within_the_step_and_holds() -> None:
    """The distance is v^2 / 2 a to a millimetre for any step, and the car stays there."""
    for dt in (0.001, 0.01, 0.05):
        car = HumanVehicle(replace(DIRECT, drag_coefficient=0.0), at_speed(10.0))
        while car.state.speed > 0.0:
            car.step(BRAKE, dt)
        deceleration = ((1.0 - math.exp(-3.0)) * 11250.0 + ROLLING_FORCE) / VEHICLE.mass
        assert car.state.x == pytest.approx(100.0 / (2.0 * deceleration), abs=1e-3)
        assert (car.state.speed, car.state.acceleration, car.state.yaw_rate) == (0.0, 0.0, 0.0)
        place = car.state.x
        for _ in range(100):
            car.step(BRAKE, dt)
        assert (car.state.x, car.state.speed, car.state.acceleration) == (place, 0.0, 0.0)


def test_stop_at_the_end_of_a_step_leaves_no_negative_speed() -> None:
    """If a step's braking takes the speed to zero within rounding, it is 0, never -1e-18."""
    commanded = -((1.0 - math.exp(-3.0)) * 11250.0 + ROLLING_FORCE) / VEHICLE.mass
    car = replace(DIRECT, drag_coefficient=0.0)
    random = np.random.default_rng(31)
    for dt in random.uniform(0.001, 0.05, 300).tolist():
        stop = -commanded * dt
        for speed in (stop, float(np.nextafter(stop, 0.0)), float(np.nextafter(stop, 9.0))):
            assert HumanVehicle(car, at_speed(speed)).step(BRAKE, dt).speed >= 0.0
            back = HumanVehicle(car, at_speed(-speed)).step(BRAKE, dt)
            assert back.speed <= 0.0


def test_reverse_is_a_gear_that_engages_at_rest() -> None:
    """Selected while rolling forwards, it waits for the stop; then throttle drives backwards."""
    car = HumanVehicle(VEHICLE, at_speed(3.0))
    for _ in range(50):
        car.step(DriverCommand(throttle=0.2, reverse=True), 0.01)
    assert car.gear == 1
    assert car.state.speed > 3.0
    while car.state.speed > 0.0:
        car.step(DriverCommand(brake=1.0, reverse=True), 0.01)
    place = car.state.x
    for _ in range(200):
        car.step(BACK, 0.01)
        assert car.state.speed <= 0.0
    assert car.gear == -1
    assert car.state.speed < -3.0
    assert car.state.x < place - 3.0


def test_brake_stops_a_car_in_reverse() -> None:
    """The brake opposes the motion, never reverses it, and forward gear engages at rest."""
    car = HumanVehicle(VEHICLE, at_speed(-5.0))
    assert car.gear == -1
    for _ in range(200):
        before = car.state.speed
        car.step(BRAKE, 0.01)
        assert before <= car.state.speed <= 0.0
    assert car.state.speed == 0.0
    car.step(THROTTLE, 0.01)
    assert car.gear == 1
    assert car.state.speed > 0.0


def test_steering_in_reverse_turns_the_other_way() -> None:
    """KS: yaw rate v tan(delta) / L changes its sign with v."""
    left = DriverCommand(steering=0.3)
    forwards = HumanVehicle(VEHICLE, at_speed(3.0)).step(left, 0.05)
    backwards = HumanVehicle(VEHICLE, at_speed(-3.0)).step(left, 0.05)
    assert forwards.yaw > 0.0 > backwards.yaw


@pytest.mark.parametrize(('start', 'command', 'limit'), [
    (49.0, THROTTLE, 50.8), (-12.0, DriverCommand(throttle=1.0, reverse=True), -13.9)])
def test_speed_reaches_its_limit_and_stays(start: float, command: DriverCommand,
                                           limit: float) -> None:
    """50.8 m/s forwards and 13.9 m/s in reverse (vehicle 2)."""
    car = HumanVehicle(VEHICLE, at_speed(start))
    for _ in range(1000):
        car.step(command, 0.01)
        assert abs(car.state.speed) <= abs(limit) + 1e-12
    assert car.state.speed == pytest.approx(limit, abs=1e-9)
    assert car.state.acceleration == pytest.approx(0.0, abs=1e-9)


def test_steering_angle_runs_at_the_rate_limit_to_its_target() -> None:
    """At rest the full wheel's target is 7.85 / 13 rad; 0.4 rad/s reach it in 1.51 s."""
    car = HumanVehicle(VEHICLE, at_speed(0.0))
    for n in range(1, 201):
        state = car.step(DriverCommand(steering=1.0), 0.01)
        assert state.steering_angle == pytest.approx(min(0.004 * n, 7.85 / 13.0), abs=1e-9)
        assert abs(state.steering_rate) <= 0.4
    assert state.steering_rate == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('seed', range(4))
def test_limits_hold_under_any_command(seed: int) -> None:
    """For any command: speed in the gear's direction, angle, rate and yaw in bounds."""
    random = np.random.default_rng(seed)
    car = HumanVehicle(VEHICLE, at_speed(random.uniform(0.0, 50.0)))
    for _ in range(60):
        pedals_and_wheel = random.uniform((-0.5, -0.5, -1.0), 1.0)
        command = DriverCommand(*pedals_and_wheel, bool(random.random() < 0.3))
        for dt in random.uniform(1e-4, 0.05, 40).tolist():
            before = car.state
            state = car.step(command.rounded(), dt)
            assert state.speed * car.gear >= 0.0
            assert -13.9 - 1e-9 <= state.speed <= 50.8 + 1e-9
            assert abs(state.steering_angle) <= 0.91
            assert abs(state.steering_angle - before.steering_angle) <= 0.4 * dt + 1e-12
            assert abs(state.acceleration) <= VEHICLE.max_acceleration + 1e-9
            assert -math.pi < state.yaw <= math.pi
            assert state.yaw_rate == pytest.approx(
                state.speed * math.tan(state.steering_angle) / VEHICLE.wheelbase, abs=1e-12)
            moved = math.hypot(state.x - before.x, state.y - before.y)
            assert moved <= max(abs(before.speed), abs(state.speed)) * dt + 1e-9


# A drive of 16 s recorded when the paper's model was built into the vehicle, before there were
# others: throttle, a turn, a stop, reverse.
RECORDED = (
    (DriverCommand(0.6, 0.0, 0.2),
     (71.16189173677351, 57.34910564924894, 0.816549336462861, 31.330158304366456,
      0.004593216617870214, 3.18562601094422, 0.05580150511475296, -0.0007469203820323865), 1),
    (DriverCommand(0.0, 0.0, -0.5),
     (176.01067340301393, 120.50670457058048, 0.2520284995107501, 30.046150734275628,
      -0.012611021893988375, -0.4285266072614553, -0.14693507790287907,
      -0.0003020292695402049), 1),
    (DriverCommand(0.0, 1.0, 0.1, True),
     (222.69058813864538, 134.4271362826756, 0.41073671789084226, 0.0, 0.05064516206933854, 0.0,
      0.0, 0.0), -1),
    (DriverCommand(0.4, 0.0, -0.9, True),
     (224.5973571347342, 98.39341935277528, 2.4765882997772746, -13.9, -0.10046928061492343, 0.0,
      0.5433455992040656, 0.0), -1))


@pytest.mark.parametrize('named', [False, True], ids=['no model', 'ks with the powertrain lag'])
def test_without_a_model_the_car_is_that_of_the_paper(named: bool) -> None:
    """It reproduces a recorded drive, to the rounding of another machine's tangent."""
    model = KinematicSingleTrack(VEHICLE, powertrain_lag=True) if named else None
    car = HumanVehicle(VEHICLE, VehicleState(1.0, -2.0, 0.5, 12.0), model)
    for command, state, gear in RECORDED:
        for n in range(400):
            car.step(command.rounded(), (0.01, 0.013, 0.0071)[n % 3])
        assert tuple(car.state) == pytest.approx(state, rel=1e-11, abs=1e-13)
        assert car.gear == gear


def test_dynamic_bicycle_answers_with_its_lags() -> None:
    """Steering and throttle held at 10 m/s: 63.2 % after T_delta = 0.2 s and T_a = 0.5 s."""
    model = DynamicBicycle(VEHICLE, slip=0.9, steering_lag=0.2, acceleration_lag=0.5)
    car = HumanVehicle(VEHICLE, at_speed(10.0), model)
    # 0.05 * 7.85 rad at the wheel over the ratio of 36 at 10 m/s.
    command = DriverCommand(throttle=0.02, steering=0.05)
    angle = 0.05 * 7.85 / 36.0
    for n in range(1, 41):
        state = car.step(command, 0.01)
        # The ratio grows a little with the speed.
        assert state.steering_angle == pytest.approx(
            angle * (1.0 - math.exp(-n / 20.0)), rel=0.03)
        assert state.yaw_rate == pytest.approx(
            0.9 * state.speed / VEHICLE.wheelbase * math.tan(state.steering_angle), rel=1e-12)
    force = (1.0 - math.exp(-0.08)) * 1.0489 * VEHICLE.mass * 9.81
    commanded = (force - ROLLING_FORCE - DRAG * 100.0) / VEHICLE.mass
    fresh = HumanVehicle(VEHICLE, at_speed(10.0), DynamicBicycle(VEHICLE, acceleration_lag=0.5))
    for _ in range(50):
        state = fresh.step(command, 0.01)
    assert state.acceleration == pytest.approx(0.632 * commanded, rel=0.02)


def test_dynamic_bicycle_stops_and_reverses_like_the_other() -> None:
    """The gear waits for the stop, brakes hold, and throttle drives backwards."""
    car = HumanVehicle(VEHICLE, at_speed(5.0), DynamicBicycle(VEHICLE))
    while car.state.speed > 0.0:
        assert car.gear == 1
        car.step(DriverCommand(brake=1.0, reverse=True), 0.01)
    place = car.state.x
    for _ in range(100):
        car.step(DriverCommand(brake=1.0, reverse=True), 0.01)
    assert (car.state.x, car.state.speed, car.gear) == (place, 0.0, -1)
    for _ in range(200):
        car.step(BACK, 0.01)
    assert car.state.speed < -3.0
