# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The effect of actions: as plans, and as pedals."""

import math

from crgame_ros.errors import PlanningError
from crgame_ros.messages.plan import Plan
from crgame_ros.planner.plan_check import check_plan
from crgame_ros.policy.actions import (
    checked_action,
    PedalInverse,
    planned_states,
    wanted_motion,
    WantedMotion,
)
from crgame_ros.vehicle.human_vehicle import HumanVehicle
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
import pytest

CAR = load_vehicle_parameters()


def test_full_braking_stops_a_car_where_kinematics_say() -> None:
    states = planned_states('acceleration', np.array((-1.0, 0.0)),
                            VehicleState(0.0, 0.0, 0.0, 3.0), CAR, 0.1, 10)
    # From 3 m/s with 8 m/s^2: 3^2 / (2 * 8) m, then it stands, brakes or not.
    assert states[-1, StateColumn.X] == pytest.approx(9.0 / 16.0)
    assert states[-1, StateColumn.SPEED] == 0.0
    assert np.diff(states[:, StateColumn.X]).min() >= 0.0


def test_curvature_is_a_share_of_what_the_speed_allows() -> None:
    # At 20 m/s a lateral acceleration of 5 m/s^2 is a radius of 80 m.
    assert wanted_motion(np.array((0.5, 1.0)), 20.0, CAR) == WantedMotion(
        2.0, pytest.approx(1.0 / 80.0))
    # At a walk full lock is tighter: the bicycle's tan(delta) / L.
    assert wanted_motion(np.array((-0.5, -1.0)), 1.0, CAR) == WantedMotion(
        -4.0, pytest.approx(-math.tan(CAR.max_steering_angle) / CAR.wheelbase))


@pytest.mark.parametrize('speed', [0.0, 4.0, 25.0])
@pytest.mark.parametrize('action', [(1.0, 1.0), (-1.0, -1.0), (0.3, -0.2), (0.0, 1.0)])
@pytest.mark.parametrize('kind', ['acceleration', 'pedals'])
def test_every_action_is_a_plan_that_the_engine_accepts(kind: str, action: tuple[float, float],
                                                        speed: float) -> None:
    ego = VehicleState(10.0, -3.0, 2.0, speed, 0.01)
    states = planned_states(kind, np.array(action), ego, CAR, 0.1, 10)  # type: ignore[arg-type]
    assert check_plan(Plan(7, states), ego, 7, CAR, 0.1) is None


def test_a_stated_plan_is_completed_by_its_steering() -> None:
    ego = VehicleState(5.0, 5.0, 0.5, 10.0)
    # Straight on at 10 m/s, then on a circle of 50 m as the chord says.
    plan = np.zeros((10, 4))
    plan[:, 0], plan[:, 3] = np.arange(1, 11), 10.0
    straight = planned_states('plan', plan, ego, CAR, 0.1, 10)
    assert check_plan(Plan(7, straight), ego, 7, CAR, 0.1) is None
    assert np.hypot(*(straight[-1, :2] - (5.0, 5.0))) == pytest.approx(10.0)
    assert straight[-1, StateColumn.YAW] == pytest.approx(0.5)
    angle = np.arange(1, 11) / 50.0
    plan[:, 0], plan[:, 1], plan[:, 2] = 50.0 * np.sin(angle), 50.0 * (1 - np.cos(angle)), angle
    bent = planned_states('plan', plan, ego, CAR, 0.1, 10)
    assert bent[-1, StateColumn.STEERING_ANGLE] == pytest.approx(
        math.atan(CAR.wheelbase / 50.0), rel=1e-6)
    assert bent[-1, StateColumn.YAW_RATE] == pytest.approx(10.0 / 50.0)


@pytest.mark.parametrize('action', [np.zeros(3), np.array((np.nan, 0.0)), 'full speed'])
def test_what_is_no_action_is_refused(action: object) -> None:
    with pytest.raises((PlanningError, ValueError)):
        checked_action('pedals', action)


@pytest.mark.parametrize(('speed', 'acceleration', 'curvature'), [
    (15.0, 1.5, 0.01), (20.0, -3.0, -0.005), (8.0, -6.0, 0.04), (5.0, 2.0, 0.0),
    (25.0, 0.0, 0.002)])
def test_pedals_bring_about_the_wanted_motion(speed: float, acceleration: float,
                                              curvature: float) -> None:
    inverse, driven = PedalInverse(CAR), HumanVehicle(CAR, VehicleState(0.0, 0.0, 0.0, speed))
    for _ in range(100):
        driven.step(inverse.command(WantedMotion(acceleration, curvature), driven.state.speed),
                    0.01)
        if driven.state.speed < 1.0:
            break
    # The powertrain lags by a first order; after 0.5 s and more it has settled.
    assert driven.state.acceleration == pytest.approx(acceleration, abs=0.02)
    assert math.tan(driven.state.steering_angle) / CAR.wheelbase == pytest.approx(
        curvature, abs=1e-5)


def test_pedals_hold_a_car_that_shall_not_move() -> None:
    inverse, driven = PedalInverse(CAR), HumanVehicle(CAR, VehicleState(0.0, 0.0, 0.0, 0.0))
    for acceleration in (-3.0, 0.0):
        for _ in range(20):
            driven.step(inverse.command(WantedMotion(acceleration, 0.0), driven.state.speed), 0.01)
        assert driven.state.speed == 0.0
    for _ in range(100):
        driven.step(inverse.command(WantedMotion(1.0, 0.0), driven.state.speed), 0.01)
    # The lag of CRG 25 delays the motion by its time constant, and no more.
    assert driven.state.speed == pytest.approx(1.0 - CAR.longitudinal_lag, abs=0.1)
