# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Gains of the LQR against independent computations, and closed loops with FS 2."""

from collections.abc import Callable
import math

import control_support as support
from control_support import DT, VEHICLE
from crgame_ros.control.lqr import error_model, gain_table, LqrTracker, TABLE_SPEEDS, weights
from crgame_ros.control.tracker import Reference
from crgame_ros.errors import InputError
from crgame_ros.vehicle.control_settings import control_settings
from crgame_ros.vehicle.dynamic_bicycle import DynamicBicycle
from crgame_ros.vehicle.models import KinematicSingleTrack
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray
import pytest
from scipy.linalg import solve_continuous_are

Array = NDArray[np.float64]
LENGTH = VEHICLE.wheelbase
SETTINGS = control_settings()
LQR, DYNAMICS = SETTINGS.lqr, SETTINGS.dynamic_bicycle
SPEEDS = [0.5, 5.0, 15.0, 30.0, 60.0]


def continuous(speed: float) -> tuple[Array, Array]:
    """Return the error model, independently: e, psi, d of FS 2 with G_s 0.95, T_delta 0.15."""
    return (np.array(((0.0, speed, 0.0), (0.0, 0.0, 0.95 * speed / LENGTH),
                      (0.0, 0.0, -1.0 / 0.15))), np.array(((0.0,), (0.0,), (1.0 / 0.15,))))


def gains(dt_s: float, speed: float) -> Array:
    return np.array(gain_table(LENGTH, dt_s, LQR, DYNAMICS)[TABLE_SPEEDS.index(speed)])


@pytest.mark.parametrize('speed', SPEEDS)
def test_error_model_is_the_exact_discretisation(speed: float) -> None:
    """The series of e^(A t) and of its integral, summed to the 20th term."""
    a, b = continuous(speed)
    state, held, term = np.zeros((3, 3)), np.zeros((3, 1)), np.eye(3)
    for k in range(1, 21):
        state, held = state + term, held + DT / k * term @ b
        term = DT / k * a @ term
    found = error_model(speed, LENGTH, DT, DYNAMICS)
    assert found[0] == pytest.approx(state, abs=1e-12)
    assert found[1] == pytest.approx(held, abs=1e-12)


def test_error_model_is_the_linearised_vehicle() -> None:
    """It equals the differences of FS 2 around straight travel, at one simulation step."""
    model = DynamicBicycle(VEHICLE)
    a, b = error_model(15.0, LENGTH, DT, DYNAMICS)
    small = 1e-6
    columns = []
    for e, psi, angle, command in np.eye(4) * small:
        end = model.step(VehicleState(0.0, e, psi, 15.0, angle), command, 0.0, DT)
        columns.append(np.array((end.y, end.yaw, end.steering_angle)) / small)
    assert np.column_stack((a, b)) == pytest.approx(np.array(columns).T, abs=1e-6)


@pytest.mark.parametrize('speed', SPEEDS)
def test_gains_satisfy_the_riccati_recursion(speed: float) -> None:
    """Dynamic programming backwards over a minute ends at the same gain as the table's."""
    a, b = error_model(speed, LENGTH, DT, DYNAMICS)
    q, r = weights(speed, LENGTH, LQR)
    p = q.copy()
    for _ in range(6000):
        k = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)
        p = q + a.T @ p @ (a - b @ k)
    assert gains(DT, speed) == pytest.approx(k[0], rel=1e-6)


@pytest.mark.parametrize('speed', SPEEDS)
def test_gains_approach_those_of_continuous_time(speed: float) -> None:
    """With a step of 0.1 ms K is within 0.2 % of R^-1 B' P of the continuous equation."""
    a, b = continuous(speed)
    q, r = weights(speed, LENGTH, LQR)
    k = np.linalg.solve(r, b.T @ solve_continuous_are(a, b, q, r))[0]
    assert gains(1e-4, speed) == pytest.approx(k, rel=2e-3)


def test_weights_are_brysons() -> None:
    """2 m/s^2 at 15 m/s is atan(2 L / 225) = 0.0229 rad; at 2 m/s the bound of 0.3 rad holds."""
    q, r = weights(15.0, 2.579, LQR)
    assert np.diag(q) == pytest.approx((1.0 / 0.3 ** 2, 1.0 / 0.15 ** 2, 0.0))
    assert r[0, 0] ** -0.5 == pytest.approx(0.0229, abs=5e-5)
    assert weights(2.0, 2.579, LQR)[1][0, 0] ** -0.5 == pytest.approx(0.3)


@pytest.mark.parametrize('speed', [*TABLE_SPEEDS, 0.7, 11.0, 22.0, 55.0])
@pytest.mark.parametrize('factor', [0.7, 1.0, 1.5])
def test_closed_loop_is_stable(speed: float, factor: float) -> None:
    """Eigenvalues are below 1 at and between the table's speeds, also with wrong lags."""
    tracker = support.tracker()
    assert isinstance(tracker, LqrTracker)
    dynamics = type(DYNAMICS)(0.95, 0.15 * factor, 0.3)
    a, b = error_model(speed, LENGTH, DT, dynamics)
    radius = np.abs(np.linalg.eigvals(a - b @ np.array((tracker.gain(speed),)))).max()
    assert radius < 1.0
    # Time constants: below 1 s at 5 m/s and above, below 7 s when walking.
    assert radius < math.exp(-DT / (1.0 if speed >= 5.0 else 7.0))


def test_closed_loop_without_a_lag_is_stable() -> None:
    """The kinematic vehicle reaches the angle at once, so d of the next step is u."""
    tracker = support.tracker()
    assert isinstance(tracker, LqrTracker)
    for speed in TABLE_SPEEDS:
        a, b = error_model(speed, LENGTH, DT, type(DYNAMICS)(1.0, 0.001, 0.3))
        k = np.array((tracker.gain(speed),))
        assert np.abs(np.linalg.eigvals(a - b @ k)).max() < 1.0


def test_gains_beyond_the_table_are_held() -> None:
    tracker = support.tracker()
    assert isinstance(tracker, LqrTracker)
    assert tracker.gain(0.0) == tracker.gain(0.5)
    assert tracker.gain(100.0) == tracker.gain(60.0)
    assert tracker.gain(-7.0) == pytest.approx(np.mean((tracker.gain(6.0), tracker.gain(8.0)), 0))


@pytest.mark.matrix('straight-30', 's-curve-15', 'circle-15')
@pytest.mark.slow
@pytest.mark.parametrize(('speed', 'curvature', 'bound', 'settled'), [
    (5.0, lambda s: 0.0, 1e-9, 1e-9), (15.0, lambda s: 0.0, 1e-9, 1e-9),
    (30.0, lambda s: 0.0, 1e-9, 1e-9),
    (5.0, support.s_curve(5.0), 0.01, 0.01), (15.0, support.s_curve(15.0), 0.01, 0.01),
    (30.0, support.s_curve(30.0), 0.01, 0.01),
    (5.0, support.circle(12.5), 0.4, 0.002), (15.0, support.circle(112.5), 0.08, 0.002),
    (30.0, support.circle(450.0), 0.08, 0.002)],
    ids=[f'{what}-{v}' for what in ('straight', 's-curve', 'circle') for v in (5, 15, 30)])
def test_lateral_error_with_the_dynamic_bicycle(
        speed: float, curvature: Callable[[float], float], bound: float, settled: float) -> None:
    """
    Drive with 2 m/s^2 laterally; the circle begins at once, but the wheels need time to turn.

    At 5 m/s they need 0.21 rad: 0.52 s at 0.4 rad/s and the lag of 0.15 s, in which the plan
    leaves the vehicle by up to 0.5 * 0.08 * (5 * 0.6)^2 = 0.36 m.
    """
    _, errors, execution = support.track(
        support.plan(speed, 12.0, curvature), support.tracker('lqr'))
    assert execution.worst.lateral < bound
    assert np.abs(errors[-200:, 0]).max() < settled


def test_without_feed_forward_the_circle_is_left() -> None:
    """
    The steady offset has a closed form: u = d = delta needs K_e e = -(1 + K_d) delta.

    psi is 0 on a steady circle, whose angle is atan(L kappa / G_s).
    """
    states = support.plan(15.0, 14.0, support.circle(112.5))
    found = {}
    for option in (True, False):
        tracker = support.tracker('lqr', feed_forward=option)
        _, errors, _ = support.track(states, tracker)
        found[option] = errors[-1, 0]
    assert isinstance(tracker, LqrTracker)
    offset_gain, _, steering_gain = tracker.gain(15.0)
    # The driven circle is wider than the plan's by the offset.
    angle = math.atan(LENGTH / 0.95 / (112.5 - found[False]))
    assert found[False] == pytest.approx(-(1.0 + steering_gain) * angle / offset_gain, rel=0.01)
    assert abs(found[False]) > 0.3
    assert abs(found[True]) < 0.001


def test_a_controller_that_knows_no_slip_leaves_the_circle_too() -> None:
    states = support.plan(15.0, 14.0, support.circle(112.5))
    _, errors, _ = support.track(states, support.tracker('lqr', slip=1.0))
    assert -0.03 < errors[-1, 0] < -0.005


@pytest.mark.matrix('2.0-15.0', '-4.0-3.0')
@pytest.mark.parametrize('speed', [2.0, 3.0, 5.0, 15.0, 30.0])
@pytest.mark.parametrize('offset', [0.5, 2.0, -4.0])
def test_an_offset_is_taken_back(speed: float, offset: float) -> None:
    """
    Large errors exhaust the steering rate of 0.4 rad/s, but cause no limit cycle.

    The overshoot is at most 12 % (of 2 m at 5 m/s), the heading error at most 0.5 rad, and the
    offset does not come back.
    """
    driven, errors, _ = support.track(
        support.plan(speed, 16.0), support.tracker('lqr'),
        start=VehicleState(0.0, offset, 0.0, speed))
    # An approach at 0.3 rad, 2 s for turning in and out, and an exponential end.
    within = round((2.0 + abs(offset) / (0.3 * min(speed, 5.0)) + 6.0 / speed) / DT)
    assert np.abs(errors[within:, 0]).max() < 0.05
    assert (errors[:, 0] * -np.sign(offset)).max() < 0.13 * abs(offset)
    assert np.abs(driven[:, 2]).max() < 0.5


@pytest.mark.matrix('0.5-15.0')
@pytest.mark.parametrize('speed', [2.0, 3.0, 5.0, 8.0, 15.0])
@pytest.mark.parametrize('yaw', [0.5, -0.8])
def test_a_heading_error_is_taken_back(speed: float, yaw: float) -> None:
    """The vehicle settles without oscillation despite the limited steering rate."""
    _, errors, _ = support.track(
        support.plan(speed, 27.0), support.tracker('lqr'),
        start=VehicleState(0.0, 0.0, yaw, speed))
    # The overshoot to the other side is at most a quarter of a metre.
    assert (errors[:, 0] * -np.sign(yaw)).max() < 0.25
    assert np.abs(errors[2600:, 0]).max() < 0.1


def test_kinematic_vehicle_is_tracked_too() -> None:
    """The controller assumes a lag and slip that this vehicle does not have."""
    for speed in (5.0, 15.0, 30.0):
        _, _, execution = support.track(
            support.plan(speed, 12.0, support.s_curve(speed)), support.tracker('lqr'),
            KinematicSingleTrack(VEHICLE))
        assert execution.worst.lateral < 0.07


def test_in_reverse() -> None:
    """The vehicle follows a winding path in reverse, starting 0.3 m beside it."""
    states = support.plan(-3.0, 8.0, lambda s: 0.1 * math.sin(s / 3.0))
    _, errors, execution = support.track(
        states, support.tracker('lqr'), start=VehicleState(0.0, 0.3, 0.0, -3.0))
    assert execution.worst.lateral < 0.31
    assert np.abs(errors[400:, 0]).max() < 0.02


def test_wheels_stay_where_they_are_after_the_last_stop() -> None:
    states = support.plan(0.0, 3.0)
    state = VehicleState(0.0, 0.3, 0.1, 0.0, 0.2)
    control = support.tracker('lqr').control(state, Reference(states, 0.1))
    assert control == (0.2, 0.0)


def test_wrong_options_are_refused() -> None:
    with pytest.raises(InputError, match='options of tracker lqr: "lateral_error" is 0.0; give'):
        support.tracker('lqr', lateral_error=0.0)
