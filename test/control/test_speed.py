# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed control: ramps, stops, limits, anti-windup, noise."""

from dataclasses import replace
import math

import control_support as support
from control_support import DT, DT_C, VEHICLE
from crgame_ros.control.speed import SpeedController
from crgame_ros.control.tracker import Reference
from crgame_ros.vehicle.control_settings import control_settings
from crgame_ros.vehicle.dynamic_bicycle import DynamicBicycle
from crgame_ros.vehicle.models import KinematicSingleTrack, VehicleModel
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest

SETTINGS = control_settings().speed_control


def gentle(deceleration: float, after_s: float) -> object:
    """Brake from a time on; the deceleration builds up within 1 s, as with people."""
    return lambda t: -deceleration * min(1.0, max(0.0, t - after_s))


@pytest.mark.parametrize('slope', [1.0, 2.0, -2.0])
def test_ramps_are_followed(slope: float) -> None:
    """
    The speed lags a step of a by less than a T_a; both speed and position errors vanish.

    Without the feed-forward the position loop alone would lag a ramp by more.
    """
    states = support.plan(15.0, 12.0, acceleration=lambda t: slope if 1.0 < t < 5.0 else 0.0)
    _, errors, execution = support.track(states, support.tracker())
    assert execution.worst.speed < 0.5 * abs(slope) * 0.3
    assert execution.worst.along < 0.05 * abs(slope)
    assert np.abs(errors[-100:, 1]).max() < 0.02
    assert np.abs(errors[-100:, 3]).max() < 0.02


@pytest.mark.parametrize('name', ['lqr', 'pure-pursuit'])
@pytest.mark.parametrize(('speed', 'deceleration'), [(5.0, 1.0), (15.0, 2.0), (30.0, 4.0),
                                                     (15.0, 6.0)])
def test_stops_where_the_plan_stops(name: str, speed: float, deceleration: float) -> None:
    """The stop is within 2 cm and 0.3 s of the plan, without rolling back or creeping."""
    states = support.plan(speed, speed / deceleration + 5.0,
                          acceleration=gentle(deceleration, 1.0))  # type: ignore[arg-type]
    driven, _, _ = support.track(states, support.tracker(name))
    assert driven[-1, 3] == 0.0
    assert driven[-1, 0] == pytest.approx(states[-1, 0], abs=0.02)
    assert np.diff(driven[:, 0]).min() >= 0.0
    planned = np.flatnonzero(states[:, 3] == 0.0)[0] * DT_C
    stands = np.flatnonzero(driven[:, 3] == 0.0)[0] * DT
    assert abs(stands - planned) < 0.3
    assert driven[:, 5].min() > -1.3 * deceleration - 0.3


@pytest.mark.parametrize(('model', 'speed', 'deceleration', 'miss'), [
    (KinematicSingleTrack(VEHICLE), 15.0, 2.0, 0.1), (DynamicBicycle(VEHICLE), 5.0, 2.0, 0.005),
    (DynamicBicycle(VEHICLE), 15.0, 2.0, 0.005), (DynamicBicycle(VEHICLE), 30.0, 4.0, 0.005),
    (DynamicBicycle(VEHICLE, acceleration_lag=0.6), 15.0, 2.0, 0.1)],
    ids=['ks', 'dynamic-5', 'dynamic-15', 'dynamic-30', 'twice the lag'])
def test_stops_of_plans_that_brake_at_once(model: VehicleModel, speed: float,
                                           deceleration: float, miss: float) -> None:
    """
    The plan brakes hard from its first state, but the vehicle's brakes need time.

    With the lag that the controller assumes, it stops within 5 mm of the planned place.
    """
    states = support.plan(speed, speed / deceleration + 3.0,
                          acceleration=lambda t: -deceleration)
    driven, _, _ = support.track(states, support.tracker(), model)
    assert driven[-1, 3] == 0.0
    assert driven[-1, 0] == pytest.approx(states[-1, 0], abs=miss)


def test_a_stop_and_a_start_again() -> None:
    """It stands during the pause, then drives on; the initial position error is corrected."""
    there = support.plan(8.0, 7.0, acceleration=lambda t: -2.0)
    on = support.plan(0.0, 12.0, acceleration=lambda t: 1.5 if t < 4.0 else 0.0,
                      start=tuple(there[-1, :3]))
    driven, errors, _ = support.track(np.vstack((there, on[1:])), support.tracker())
    pause = driven[500:700]
    assert (pause[:, 3] == 0.0).all()
    assert pause[:, 0] == pytest.approx(16.0, abs=0.02)
    assert abs(errors[-1, 1]) < 0.05
    assert driven[-1, 3] == pytest.approx(6.0, abs=0.03)


def test_noise_of_an_estimate_moves_no_standing_vehicle() -> None:
    """The estimated speed varies by 0.03 m/s, but the vehicle moves less than 1 mm in 5 s."""
    random = np.random.default_rng(5)

    def noisy(state: VehicleState) -> VehicleState:
        x, y, v = random.normal(0.0, (0.05, 0.05, 0.03)).tolist()
        return state._replace(x=state.x + x, y=state.y + y, speed=state.speed + v)

    states = support.plan(8.0, 12.0, acceleration=gentle(2.0, 1.0))  # type: ignore[arg-type]
    driven, _, _ = support.track(states, support.tracker(), pose=noisy)
    assert np.ptp(driven[700:, 0]) == 0.0
    assert driven[-1, 0] == pytest.approx(states[-1, 0], abs=0.3)


def controller(**settings: float) -> SpeedController:
    return SpeedController(VEHICLE, DT, replace(SETTINGS, **settings), 0.3)


def test_the_law_between_stops() -> None:
    """The first call gives a_ref + k_v (v_ref + k_s ds - v) + k_i integral, as documented."""
    reference = Reference(support.plan(10.0, 5.0, acceleration=lambda t: 1.0), DT_C)
    pose = VehicleState(9.8, 0.0, 0.0, 10.5)
    found = controller().command(pose, reference.at(1.0), 9.8)
    error = 11.0 + SETTINGS.position_gain * (10.5 - 9.8) - 10.5
    expected = 1.0 + SETTINGS.speed_gain * error + SETTINGS.integral_gain * error * DT
    assert found == pytest.approx(expected, abs=1e-9)


def test_the_planned_acceleration_is_taken_a_lag_ahead() -> None:
    reference = Reference(
        support.plan(10.0, 5.0, acceleration=lambda t: 1.0 if t > 2.0 else 0.0), DT_C)
    for time_s, expected in ((1.5, 0.0), (1.75, 1.0)):
        pose = VehicleState(10.0 * time_s, 0.0, 0.0, 10.0)
        assert controller().command(pose, reference.at(time_s), 10.0 * time_s) \
            == pytest.approx(expected, abs=1e-9)


def test_integral_removes_a_steady_error() -> None:
    """A vehicle that delivers 0.5 m/s^2 less than commanded still holds its speed."""
    law, reference = controller(position_gain=0.0), Reference(support.plan(10.0, 60.0), DT_C)
    speed, s, a = 10.0, 0.0, 0.0
    for n in range(5900):
        command = law.command(VehicleState(s, 0.0, 0.0, speed, 0.0, a), reference.at(n * DT), s)
        a += DT / 0.3 * (command - 0.5 - a)
        speed, s = speed + DT * a, s + DT * speed
    assert speed == pytest.approx(10.0, abs=0.01)
    assert command == pytest.approx(0.5, abs=0.01)


def test_integral_does_not_wind_up() -> None:
    """
    After a minute at 20 m/s too slow with full correction, no push is left at planned speed.

    The integral's bound would allow 1 m/s^2.
    """
    law, reference = controller(), Reference(support.plan(30.0, 80.0), DT_C)
    for n in range(6000):
        found = law.command(VehicleState(30.0 * n * DT, 0.0, 0.0, 10.0), reference.at(n * DT),
                            30.0 * n * DT)
        assert found == pytest.approx(SETTINGS.correction_limit)
    found = law.command(VehicleState(1800.0, 0.0, 0.0, 30.0), reference.at(60.0), 1800.0)
    assert found == pytest.approx(0.0, abs=1e-6)


def test_commands_stay_within_the_vehicles_limits() -> None:
    weak = replace(VEHICLE, max_acceleration=2.0)
    law = SpeedController(weak, DT, SETTINGS, 0.3)
    for slope in (3.0, -3.0):
        reference = Reference(
            support.plan(20.0, 5.0, acceleration=lambda t, a=slope: a), DT_C).at(0.5)
        pose = VehicleState(10.0, 0.0, 0.0, 20.0)
        assert law.command(pose, reference, 10.0) == math.copysign(2.0, slope)


def test_a_vehicle_beyond_the_stop_brakes() -> None:
    """0.5 m past it at 2 m/s it brakes by at least 4 m/s^2; rolling back, as much forwards."""
    reference = Reference(support.plan(2.0, 5.0, acceleration=lambda t: -1.0), DT_C).at(3.0)
    assert controller().command(VehicleState(2.5, 0.0, 0.0, 2.0), reference, 2.5) <= -4.0
    assert controller().command(VehicleState(2.5, 0.0, 0.0, -2.0), reference, 2.5) == 4.0


@pytest.mark.parametrize('name', ['lqr', 'pure-pursuit'])
def test_forwards_a_stop_and_backwards(name: str) -> None:
    """One plan holds the first two moves of a three-point turn, and both are driven."""
    there = support.plan(4.0, 6.0, lambda s: 0.05, lambda t: -1.0 if t < 3.999 else 0.0)
    back = support.plan(0.0, 8.0, lambda s: -0.05, lambda t: -1.0 if t < 3.0 else 1.0,
                        start=tuple(there[-1, :3]))
    states = np.vstack((there, back[1:]))
    driven, errors, _ = support.track(states, support.tracker(name))
    assert driven[-1, 3] == 0.0
    assert math.hypot(*(driven[-1, :2] - states[-1, :2])) < 0.1
    moving = np.flatnonzero(driven[:, 3])
    turn = np.flatnonzero(driven[:, 3] < 0.0)[0]
    assert (driven[moving[moving < turn], 3] > 0.0).all()
    assert (driven[moving[moving >= turn], 3] < 0.0).all()
    assert np.abs(errors[:, 0]).max() < 0.1
