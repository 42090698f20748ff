# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Execution by tracking as a whole: errors, bias, expired plans, replanning, real plans."""

import math
from pathlib import Path

import control_support as support
from control_support import DT, DT_C, VEHICLE
from crgame_ros.control.tracked_execution import TrackedExecution
from crgame_ros.control.tracker import Control, Reference, Tracker
from crgame_ros.game.game import load_game
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.dynamic_bicycle import DynamicBicycle
from crgame_ros.vehicle.models import KinematicSingleTrack
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest

NAMES = ['lqr', 'pure-pursuit']
PLAN = Reference(support.plan(10.0, 1.0), DT_C)


class Fixed(Tracker):
    """Returns a constant command."""

    def reset(self) -> None:
        pass

    def control(self, pose: VehicleState, reference: Reference) -> Control:
        return Control(0.0, 0.0)


def execution(name: str = 'lqr') -> TrackedExecution:
    return TrackedExecution(VEHICLE, support.tracker(name), DynamicBicycle(VEHICLE), DT)


def test_errors_are_those_of_the_time_after_the_step() -> None:
    """At 9 m/s and 0.2 m to the left of a plan of 10 m/s, the error grows by -0.01 m a step."""
    made = TrackedExecution(VEHICLE, Fixed(VEHICLE, DT), KinematicSingleTrack(VEHICLE), DT)
    yaw = math.pi / 3.0
    state = VehicleState(-0.2 * math.sin(yaw), 0.2 * math.cos(yaw), yaw, 9.0)
    made.reset(state)
    assert made.errors is None
    reference = Reference(support.plan(10.0, 3.0, start=(0.0, 0.0, yaw)), DT_C)
    for n in range(1, 101):
        state = made.step(state, reference.at((n - 1) * DT))
        assert made.errors == pytest.approx((0.2, -0.01 * n, 0.0, -1.0), abs=1e-9)
    assert made.worst == pytest.approx((0.2, 1.0, 0.0, 1.0), abs=1e-9)
    made.reset(state)
    assert made.errors is None
    assert made.worst == pytest.approx((0.2, 1.0, 0.0, 1.0), abs=1e-9)


@pytest.mark.parametrize('name', NAMES)
def test_a_biased_estimate_shifts_the_vehicle_by_the_bias(name: str) -> None:
    """An estimate 0.5 m left of and 1 m ahead of the truth shifts the vehicle the other way."""
    states = support.plan(10.0, 20.0, start=(0.0, 0.0, 0.7))
    c, s = math.cos(0.7), math.sin(0.7)

    def biased(state: VehicleState) -> VehicleState:
        return state._replace(x=state.x + c - 0.5 * s, y=state.y + s + 0.5 * c)

    _, errors, made = support.track(states, support.tracker(name), pose=biased)
    assert errors[-1] == pytest.approx((-0.5, -1.0, 0.0, 0.0), abs=0.02)
    _, errors, _ = support.track(states, support.tracker(name))
    assert errors[-1] == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize('reference', [None, PLAN.at(1.0), PLAN.at(7.0)],
                         ids=['none', 'at its end', 'long used up'])
@pytest.mark.parametrize('speed', [10.0, -10.0])
def test_without_a_plan_it_brakes_along_its_steering_angle(reference: Reference | None,
                                                           speed: float) -> None:
    """It brakes by 4 m/s^2 after the lag, over v^2 / 8 + 0.3 v on its circle; then it stands."""
    made = execution()
    state = VehicleState(0.0, 0.0, 0.0, speed, 0.1)
    made.reset(state)
    way, accelerations = 0.0, []
    for _ in range(400):
        before, state = state, made.step(state, reference)
        way += math.hypot(state.x - before.x, state.y - before.y)
        accelerations.append(abs(state.acceleration))
        assert state.steering_angle == pytest.approx(0.1)
        assert made.errors is None
    assert state.speed == 0.0
    # Distance by FS 2: v t - 2 t^2 + 4 T (t - T), stopped at t = v / 4 + T.
    t = 2.5 + 0.3
    assert way == pytest.approx(10.0 * t - 2.0 * t * t + 1.2 * (t - 0.3), abs=0.01)
    assert max(accelerations) == pytest.approx(4.0, abs=0.01)
    radius = VEHICLE.wheelbase / (0.95 * math.tan(0.1))
    assert math.hypot(state.x, state.y - radius) == pytest.approx(radius, abs=1e-3)
    assert made.step(state, reference) == state


@pytest.mark.parametrize('name', NAMES)
def test_a_used_up_plan_brakes_after_it(name: str) -> None:
    """After a plan of 2 s at 10 m/s it brakes by 4 m/s^2 and stops 20 + 12.5 + 3 m away."""
    driven, errors, _ = support.track(support.plan(10.0, 2.0), support.tracker(name),
                                      duration_s=6.0)
    assert driven[200, 3] == pytest.approx(10.0)
    assert driven[-1, 3] == 0.0
    assert driven[-1, 0] == pytest.approx(35.3, abs=0.3)
    assert np.isnan(errors[200:]).all()
    assert not np.isnan(errors[:199]).any()


@pytest.mark.parametrize('name', NAMES)
def test_equal_runs_are_equal_to_the_last_bit(name: str) -> None:
    states = support.plan(12.0, 8.0, support.s_curve(12.0), lambda t: math.sin(t))
    runs = [support.track(states, support.tracker(name))[0] for _ in range(2)]
    assert runs[0].tobytes() == runs[1].tobytes()
    # A reset also clears the state of an earlier run.
    made = execution(name)
    for _ in range(2):
        state = VehicleState(*states[0].tolist())
        made.reset(state)
        reference = Reference(states, DT_C)
        for n in range(800):
            state = made.step(state, reference.at(n * DT))
        assert state == tuple(runs[0][-1])


@pytest.mark.parametrize('name', NAMES)
def test_a_plan_from_where_the_vehicle_is_every_tick(name: str) -> None:
    """Replanned at 10 Hz from its own state onto a circle, the vehicle turns with the plans."""
    made = execution(name)
    state = VehicleState(0.0, 0.0, 0.0, 10.0)
    made.reset(state)
    for n in range(800):
        if n % 10 == 0:
            reference = Reference(support.plan(
                state.speed, 1.5, support.circle(40.0), start=state[:3]), DT_C)
        state = made.step(state, reference.at(n % 10 * DT))
    assert state.yaw_rate == pytest.approx(10.0 / 40.0, rel=0.05)
    assert state.speed == pytest.approx(10.0, abs=0.05)
    # A plan made a second ago has the curvature at once. T_delta = 0.15 s late, the heading lags
    # by v / R T = 0.04 rad, which makes 0.38 m in a second.
    assert 0.1 < made.worst.lateral < 0.38


def test_errors_are_against_a_plan_that_is_a_second_old() -> None:
    """
    The vehicle, replanned at 10 Hz from its own state onto a circle, nevertheless drives straight.

    Its error to the newest plan is at most 1.2 cm, but to the circle of the plan made a second
    ago R (1 - cos(1 s v / R)) = 1.24 m.
    """
    made = TrackedExecution(VEHICLE, Fixed(VEHICLE, DT), KinematicSingleTrack(VEHICLE), DT)
    state = VehicleState(0.0, 0.0, 0.0, 10.0)
    made.reset(state)
    for n in range(500):
        if n % 10 == 0:
            reference = Reference(support.plan(
                10.0, 4.0, support.circle(40.0), start=state[:3]), DT_C)
        state = made.step(state, reference.at(n % 10 * DT))
        if n % 10 == 9 and n > 100:
            # Made a second ago, when the vehicle was 10 m behind.
            assert made.errors is not None
            c, s = math.cos(0.25), math.sin(0.25)
            dx, dy = 10.0 - 40.0 * s, -40.0 * (1.0 - c)
            expected = (dy * c - dx * s, dx * c + dy * s, -0.25, 0.0)
            assert made.errors == pytest.approx(expected, abs=1e-3)
    # The previous plan is used until the next one is old enough: for 1.09 s.
    assert made.worst.lateral == pytest.approx(1.458, abs=0.001)


def test_short_plans_are_compared_as_long_as_they_last() -> None:
    """Plans of 0.5 s end within a second, so the error is against the oldest valid one."""
    made = TrackedExecution(VEHICLE, Fixed(VEHICLE, DT), KinematicSingleTrack(VEHICLE), DT)
    state = VehicleState(0.0, 0.0, 0.0, 10.0)
    made.reset(state)
    for n in range(300):
        if n % 10 == 0:
            reference = Reference(support.plan(
                10.0, 0.5, support.circle(40.0), start=state[:3]), DT_C)
        state = made.step(state, reference.at(n % 10 * DT))
    # 40 m (1 - cos(0.5 s v / R)) = 0.31 m.
    assert made.worst.lateral == pytest.approx(0.31, abs=0.01)


@pytest.mark.matrix('roundabout')
@pytest.mark.slow
@pytest.mark.parametrize('game', ['cut_in', 'roundabout', 'parked_cars'])
def test_the_motion_that_a_planner_chose(project_root: Path, game: str) -> None:
    """
    Track 20 s as the AV of a game planned them.

    Lateral errors are at most 8 mm with LQR and 4.3 cm with pure pursuit (in the roundabout).
    """
    setup = build_setup(load_game(project_root / 'scenarios' / f'{game}.yaml'))
    planned = run_offline(setup, check_drivability=False).states_of('av0')
    assert np.hypot(*(planned[-1, :2] - planned[0, :2])) > 50.0
    for name, lateral in (('lqr', 0.01), ('pure-pursuit', 0.05)):
        _, _, made = support.track(planned[::10].copy(), support.tracker(name))
        assert made.worst.lateral < lateral
        assert made.worst.along < 0.15
        assert made.worst.speed < 0.2
