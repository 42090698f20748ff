# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pedals to acceleration (CRG 20-25) against numbers by hand."""

from dataclasses import replace
import math

from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.powertrain import pedal_response, Powertrain
import pytest

VEHICLE = load_vehicle_parameters()
MASS, WEIGHT = 1093.2952334674046, 1093.2952334674046 * 9.81
GRIP_FORCE = 1.0489 * WEIGHT
ROLLING_FORCE = 0.012 * WEIGHT
POWERTRAIN = Powertrain(VEHICLE)


def drag_force(speed: float) -> float:
    """Return rho / 2 C_D A_f v^2 of CRG 23 with the numbers of the BMW 320i."""
    return 0.5 * 1.225 * 0.29 * 2.11 * speed**2


@pytest.mark.parametrize(('travel', 'shape', 'response'), [
    (0.0, 4.0, 0.0), (1.0, 4.0, 1.0 - math.exp(-4.0)), (0.5, 4.0, 1.0 - math.exp(-2.0)),
    (1.0, 3.0, 0.950212931632136)])
def test_pedal_response(travel: float, shape: float, response: float) -> None:
    """CRG 20: alpha(p; k) = 1 - exp(-k p), with the paper's 4 for throttle and 3 for brake."""
    assert pedal_response(travel, shape) == pytest.approx(response, abs=1e-15)


def test_parameters_of_the_pedals_are_the_papers() -> None:
    """k_th = 4 and k_br = 3 (CRG III-C2a)."""
    assert (VEHICLE.throttle_shape, VEHICLE.brake_shape) == (4.0, 3.0)


def test_drive_force_is_limited_by_grip_then_by_power() -> None:
    """CRG 21: mu m g up to v = P / (mu m g) - eps = 11.90 m/s, then P / (v + eps)."""
    crossing = 135000.0 / GRIP_FORCE - 0.1
    assert crossing == pytest.approx(11.90, abs=0.01)
    for speed in (0.0, 5.0, crossing - 0.01, -5.0):
        assert POWERTRAIN.drive_force_limit(speed) == pytest.approx(GRIP_FORCE)
    for speed in (crossing + 0.01, 20.0, 50.0):
        assert POWERTRAIN.drive_force_limit(speed) == pytest.approx(135000.0 / (speed + 0.1))
    assert POWERTRAIN.drive_force_limit(20.0) == pytest.approx(6716.4, abs=0.1)
    assert POWERTRAIN.drive_force_limit(-20.0) == POWERTRAIN.drive_force_limit(20.0)


def test_coasting_is_drag_and_rolling_resistance() -> None:
    """At 30 m/s: 337.3 N of air and 128.7 N of tyres on 1093.3 kg."""
    assert drag_force(30.0) == pytest.approx(337.3, abs=0.1)
    assert ROLLING_FORCE == pytest.approx(128.7, abs=0.1)
    assert POWERTRAIN.command(DriverCommand(), 30.0, 1) == pytest.approx(
        -(drag_force(30.0) + ROLLING_FORCE) / MASS, rel=1e-12)
    assert POWERTRAIN.command(DriverCommand(), -10.0, -1) == pytest.approx(
        (drag_force(10.0) + ROLLING_FORCE) / MASS, rel=1e-12)


def test_sum_of_forces() -> None:
    """CRG 22-24 with both pedals half way at 20 m/s."""
    drive = (1.0 - math.exp(-2.0)) * 135000.0 / 20.1
    brake = (1.0 - math.exp(-1.5)) * 11250.0
    force = drive - brake - drag_force(20.0) - ROLLING_FORCE
    assert POWERTRAIN.command(DriverCommand(0.5, 0.5), 20.0, 1) == pytest.approx(force / MASS)


def test_command_is_saturated() -> None:
    """CRG 24: |a_cmd| <= a_max, both ways."""
    weak = Powertrain(replace(VEHICLE, max_acceleration=5.0))
    assert weak.command(DriverCommand(throttle=1.0), 5.0, 1) == 5.0
    assert weak.command(DriverCommand(brake=1.0), 30.0, 1) == -5.0
    assert weak.command(DriverCommand(throttle=1.0), -5.0, -1) == -5.0


def test_standing_car_is_held() -> None:
    """Static friction holds it: rolling resistance and brakes start no motion."""
    for gear in (1, -1):
        assert POWERTRAIN.command(DriverCommand(), 0.0, gear) == 0.0
        assert POWERTRAIN.command(DriverCommand(brake=1.0), 0.0, gear) == 0.0
        # 0.25 % of the throttle's travel push with 112 N, less than the rolling resistance.
        assert POWERTRAIN.command(DriverCommand(throttle=0.0025), 0.0, gear) == 0.0
        assert POWERTRAIN.command(DriverCommand(throttle=0.004), 0.0, gear) * gear > 0.0
    expected = ((1.0 - math.exp(-4.0)) * GRIP_FORCE - ROLLING_FORCE) / MASS
    assert POWERTRAIN.command(DriverCommand(throttle=1.0), 0.0, 1) == pytest.approx(expected)
    assert POWERTRAIN.command(DriverCommand(throttle=1.0), 0.0, -1) == pytest.approx(-expected)


def test_brake_opposes_the_motion() -> None:
    """Its force is negative forwards, and positive and equally strong in reverse."""
    brake = (1.0 - math.exp(-3.0)) * 11250.0
    for speed, gear in ((8.0, 1), (-8.0, -1)):
        acceleration = POWERTRAIN.command(DriverCommand(brake=1.0), speed, gear)
        assert acceleration == pytest.approx(
            -gear * (brake + drag_force(8.0) + ROLLING_FORCE) / MASS)


def test_lag_follows_its_closed_form() -> None:
    """CRG 25 from rest: a_n = a_cmd (1 - (1 - dt / tau)^n), tau = 0.15 s."""
    acceleration = 0.0
    for n in range(1, 101):
        acceleration = POWERTRAIN.lag(acceleration, 3.0, 0.01)
        assert acceleration == pytest.approx(3.0 * (1.0 - (1.0 - 0.01 / 0.15)**n), rel=1e-12)


def test_lag_uses_the_interval_and_does_not_overshoot() -> None:
    """Two short steps are nearly a long one; an interval beyond tau reaches the command."""
    twice = POWERTRAIN.lag(POWERTRAIN.lag(0.0, 2.0, 0.0005), 2.0, 0.0005)
    assert twice == pytest.approx(POWERTRAIN.lag(0.0, 2.0, 0.001), rel=0.01)
    assert POWERTRAIN.lag(-1.0, 2.0, 0.4) == 2.0
