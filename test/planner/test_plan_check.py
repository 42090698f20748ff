# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Each ground for refusing a plan, and that plans within the limits pass."""

import dataclasses
import math

from crgame_ros.messages.plan import Plan
from crgame_ros.planner.plan_check import check_plan, PlanTolerances
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
import planner_support as support
import pytest

STAMP = 500


def turning(speed: float, curvature: float, vehicle: VehicleParameters) -> Plan:
    """Drive on a circle, in its closed form."""
    s = speed * support.DT * np.arange(31)
    states = np.zeros((31, 8))
    if curvature:
        states[:, 0] = np.sin(curvature * s) / curvature
        states[:, 1] = (1.0 - np.cos(curvature * s)) / curvature
    else:
        states[:, 0] = s
    states[:, 2] = curvature * s
    states[:, 3] = speed
    states[:, 4] = math.atan(vehicle.wheelbase * curvature)
    states[:, 6] = speed * curvature
    return Plan(STAMP, states)


def verdict(plan: Plan, vehicle: VehicleParameters, **tolerances: float) -> str | None:
    ego = VehicleState(*turning(10.0, 0.02, vehicle).states[0])
    return check_plan(plan, ego, STAMP, vehicle, support.DT, PlanTolerances(**tolerances))


def test_a_circle_within_the_limits_passes(vehicle: VehicleParameters) -> None:
    assert verdict(turning(10.0, 0.02, vehicle), vehicle) is None


@pytest.mark.parametrize(('row', 'column', 'change', 'reason'), [
    (7, StateColumn.X, 1.0, 'jump'),
    (7, StateColumn.Y, -1.0, 'jump'),
    (0, StateColumn.Y, 0.6, 'm from the vehicle'),
    (0, StateColumn.YAW, 0.3, 'another heading'),
    (0, StateColumn.SPEED, 1.5, 'another speed'),
    (9, StateColumn.YAW, math.nan, 'yaw of state 9 is nan'),
    (9, StateColumn.ACCELERATION, math.inf, 'acceleration of state 9 is inf'),
    (9, StateColumn.YAW, 1.7e308, 'yaw of state 9 is 1.7e+308'),
    (9, StateColumn.YAW_RATE, -1e12, 'yaw_rate of state 9 is -1e+12'),
    (9, StateColumn.SPEED, 101.6, 'speed of'),
    (9, StateColumn.SPEED, -40.0, 'speed in reverse'),
    (9, StateColumn.SPEED, 2.0, 'acceleration of'),
    (9, StateColumn.ACCELERATION, 20.0, 'stated acceleration'),
    (9, StateColumn.STEERING_ANGLE, 1.2, 'steering angle'),
    (9, StateColumn.STEERING_ANGLE, 0.2, 'change of steering'),
])
def test_each_fault_is_refused(row: int, column: StateColumn, change: float, reason: str,
                               vehicle: VehicleParameters) -> None:
    plan = turning(10.0, 0.02, vehicle)
    plan.states[row, column] += change
    found = verdict(plan, vehicle)
    assert found is not None and reason in found


def test_no_jump_hides_behind_a_heading_beyond_all_measure(vehicle: VehicleParameters) -> None:
    """Differences of such headings are NaN, and no comparison with NaN reports an excess."""
    plan = turning(10.0, 0.02, vehicle)
    plan.states[5:, 0] += 500.0
    plan.states[4, 2], plan.states[5, 2] = 1.7e308, -1.7e308
    assert verdict(plan, vehicle) is not None


def test_a_plan_has_a_largest_length(vehicle: VehicleParameters) -> None:
    states = np.repeat(turning(10.0, 0.02, vehicle).states[:1], 3001, axis=0)
    assert 'at most 3000' in str(verdict(Plan(STAMP, states), vehicle))


def test_wrong_stamp_and_single_state_are_refused(vehicle: VehicleParameters) -> None:
    plan = turning(10.0, 0.02, vehicle)
    assert 'stamp 501' in str(verdict(dataclasses.replace(plan, stamp_ns=501), vehicle))
    assert 'at least 2' in str(verdict(Plan(STAMP, plan.states[:1]), vehicle))


def test_lateral_acceleration_and_tightest_turn_are_limits(vehicle: VehicleParameters) -> None:
    # friction * g = 10.3 m/s^2: 10 m/s on 1/0.1 m needs 10 (passes), on 1/0.13 m needs 13.
    for curvature, refused in ((0.1, False), (0.13, True)):
        plan = turning(10.0, curvature, vehicle)
        found = check_plan(plan, VehicleState(*plan.states[0]), STAMP, vehicle, support.DT)
        assert (found is not None and 'lateral acceleration' in found) is refused
    # The tightest turn of the car: tan(0.91) / 2.579 = 0.498 1/m; 1 m/s on 0.9 1/m is too much.
    plan = turning(1.0, 0.9, vehicle)
    plan.states[:, 4] = 0.9
    found = check_plan(plan, VehicleState(*plan.states[0]), STAMP, vehicle, support.DT)
    assert found is not None and 'change of heading' in found


def test_heading_may_wrap(vehicle: VehicleParameters) -> None:
    plan = turning(10.0, 0.02, vehicle)
    plan.states[:, :2] *= -1.0
    plan.states[:, 2] += math.pi
    plan.states[4:, 2] -= 2.0 * math.pi
    found = check_plan(plan, VehicleState(*plan.states[0]), STAMP, vehicle, support.DT)
    assert found is None


def test_tolerances_can_be_set(vehicle: VehicleParameters) -> None:
    plan = turning(10.0, 0.02, vehicle)
    plan.states[7, 0] += 1.0
    assert verdict(plan, vehicle, jump=1.5) is None
