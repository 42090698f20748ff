# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pure pursuit against its closed forms."""

import math

import control_support as support
from control_support import VEHICLE
from crgame_ros.control.pure_pursuit import PurePursuitTracker, steering_angle_to
from crgame_ros.control.tracker import Reference
from crgame_ros.vehicle.dynamic_bicycle import DynamicBicycle
from crgame_ros.vehicle.models import KinematicSingleTrack
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest


def made(**options: object) -> PurePursuitTracker:
    tracker = support.tracker('pure-pursuit', **options)
    assert isinstance(tracker, PurePursuitTracker)
    return tracker


@pytest.mark.parametrize('alpha', [-1.2, -0.3, 0.0, 0.05, 0.7, 2.5])
def test_the_formula(alpha: float) -> None:
    """The angle is atan(2 L sin(alpha) / l_d) for a point at the angle alpha and 8 m."""
    pose = VehicleState(3.0, -1.0, 0.4, 5.0)
    x, y = 3.0 + 8.0 * math.cos(0.4 + alpha), -1.0 + 8.0 * math.sin(0.4 + alpha)
    assert steering_angle_to(pose, x, y, 2.6) == pytest.approx(
        math.atan(2.0 * 2.6 * math.sin(alpha) / 8.0), abs=1e-12)


def test_the_angle_leads_through_the_point() -> None:
    """With this angle the kinematic model reaches the point, forwards and in reverse."""
    for sign in (1.0, -1.0):
        angle = steering_angle_to(VehicleState(0.0, 0.0, 0.0, 0.0), sign * 8.0, 3.0,
                                  VEHICLE.wheelbase)
        model = KinematicSingleTrack(VEHICLE)
        state = VehicleState(0.0, 0.0, 0.0, sign * 2.0, angle)
        nearest = 9.0
        for _ in range(600):
            state = model.step(state, angle, 0.0, 0.01)
            nearest = min(nearest, math.hypot(state.x - sign * 8.0, state.y - 3.0))
        assert nearest < 0.011


def test_a_vehicle_on_the_arc_steers_its_curvature() -> None:
    """The angle is atan(L kappa) for any look-ahead distance."""
    states = support.plan(10.0, 6.0, support.circle(40.0))
    reference = Reference(states, support.DT_C)
    pose = VehicleState(*states[10].tolist())
    for time in (0.4, 0.8, 1.5):
        angle, _ = made(look_ahead_time=time).control(pose, reference.at(1.0))
        assert angle == pytest.approx(math.atan(VEHICLE.wheelbase / 40.0), rel=2e-3)


@pytest.mark.parametrize('slip', [1.0, 0.9])
def test_steady_state_on_a_circle(slip: float) -> None:
    """The radius settles at sqrt(R^2 + l_d^2 (1 / G_s - 1)): 50 m, or 50.08 m with G_s 0.9."""
    states = support.plan(10.0, 20.0, support.circle(50.0))
    model = DynamicBicycle(VEHICLE, slip=slip)
    driven, _, _ = support.track(states, made(look_ahead_time=0.85), model)
    radius = np.hypot(driven[1500:1800, 0], driven[1500:1800, 1] - 50.0)
    look_ahead = 0.85 * driven[1500:1800, 3].mean()
    assert radius == pytest.approx(math.sqrt(2500.0 + look_ahead ** 2 * (1.0 / slip - 1.0)),
                                   abs=0.01)
    if slip == 1.0:
        assert driven[1600, 4] == pytest.approx(math.atan(VEHICLE.wheelbase / 50.0), rel=2e-3)


def test_look_ahead_grows_with_speed_between_its_bounds() -> None:
    tracker = made(look_ahead_time=0.5, shortest_look_ahead=4.0, longest_look_ahead=10.0)
    assert [tracker.look_ahead(v) for v in (0.0, 6.0, 16.0, -16.0, 40.0)] == [
        4.0, 4.0, 8.0, 8.0, 10.0]


@pytest.mark.parametrize('speed', [5.0, 15.0, 30.0])
def test_lateral_error_with_the_dynamic_bicycle(speed: float) -> None:
    """It is bounded in an S-curve of 2 m/s^2, 0 on a straight; 0.5 m is corrected within 3 s."""
    _, _, straight = support.track(support.plan(speed, 12.0), made())
    _, _, winding = support.track(support.plan(speed, 12.0, support.s_curve(speed)), made())
    _, errors, _ = support.track(support.plan(speed, 12.0), made(),
                                 start=VehicleState(0.0, 0.5, 0.0, speed))
    assert straight.worst.lateral < 1e-9
    assert 0.01 < winding.worst.lateral < 0.05
    assert np.abs(errors[300:, 0]).max() < 0.05


@pytest.mark.matrix('2.0-15.0', '-8.0-3.0')
@pytest.mark.slow
@pytest.mark.parametrize('speed', [2.0, 3.0, 5.0, 15.0, 30.0])
@pytest.mark.parametrize('offset', [2.0, -8.0])
def test_a_large_offset_is_taken_back(speed: float, offset: float) -> None:
    """Offsets even beyond the look-ahead distance end with under 10 % overshoot and 25 degrees."""
    driven, errors, _ = support.track(
        support.plan(speed, 30.0), made(), start=VehicleState(0.0, offset, 0.0, speed))
    assert np.abs(errors[2500:, 0]).max() < 0.05
    assert (errors[:, 0] * -np.sign(offset)).max() < 0.1 * abs(offset)
    assert np.abs(driven[:, 2]).max() < 0.44


def test_in_reverse() -> None:
    states = support.plan(-3.0, 8.0, lambda s: 0.1 * math.sin(s / 3.0))
    _, errors, _ = support.track(states, made(), start=VehicleState(0.0, 0.3, 0.0, -3.0))
    assert np.abs(errors[400:, 0]).max() < 0.1
