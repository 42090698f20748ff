# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States as joints and back: the messages keep all values of a planner."""

from dataclasses import replace
import math

from crgame_ros.errors import InputError
from crgame_ros.messages.joints import (
    JointSeries,
    object_joint_names,
    plan_from_joints,
    plan_to_joints,
    vehicle_joint_names,
    vehicle_to_joints,
    vehicles_from_joints,
)
from crgame_ros.messages.plan import Plan
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray
import pytest

STEP_NS = 100_000_000


def random_states(seed: int, count: int) -> NDArray[np.float64]:
    """Draw states, reverse driving and any heading included."""
    random = np.random.default_rng(seed)
    return np.column_stack((
        random.uniform(-2e3, 2e3, (count, 2)), random.uniform(-math.pi, math.pi, count),
        random.uniform(-10, 40, count), random.uniform(-0.9, 0.9, count),
        random.uniform(-8, 5, count), random.uniform(-1, 1, count),
        random.uniform(-0.4, 0.4, count)))


def test_plan_round_trip() -> None:
    """Plan, joints, plan: every column within 1e-12, signed speed and acceleration included."""
    for seed in range(20):
        plan = Plan(123 * STEP_NS, random_states(seed, 40))
        back = plan_from_joints(plan_to_joints(plan, 'av0', STEP_NS), 'av0', STEP_NS)
        assert back.stamp_ns == plan.stamp_ns
        np.testing.assert_allclose(back.states, plan.states, rtol=1e-12, atol=1e-12)


def test_vehicle_round_trip_agrees_with_the_plans() -> None:
    """The engine's own state goes the same way as a plan's row."""
    for row in random_states(91, 100):
        state = VehicleState(*row.tolist())
        joints = np.array(vehicle_to_joints(state))
        np.testing.assert_allclose(vehicles_from_joints(*joints), row, rtol=1e-12, atol=1e-12)
        series = plan_to_joints(Plan(0, row[None]), 'av0', STEP_NS)
        np.testing.assert_allclose(
            joints, [series.positions[0], series.velocities[0], series.accelerations[0]],
            rtol=1e-12, atol=1e-12)


def test_known_vehicle() -> None:
    """North at 5 m/s, turning left at 0.2 rad/s: centripetal 1 m/s^2 to the west."""
    positions, velocities, accelerations = vehicle_to_joints(
        VehicleState(1.0, 2.0, math.pi / 2, 5.0, 0.1, 3.0, 0.2, 0.05))
    assert positions == (1.0, 2.0, math.pi / 2, 0.1)
    assert velocities == pytest.approx((0.0, 5.0, 0.2, 0.05), abs=1e-15)
    assert accelerations[:2] == pytest.approx((-1.0, 3.0))
    assert all(math.isnan(value) for value in accelerations[2:])


def test_velocities_are_the_derivatives_of_the_positions() -> None:
    """On a circle of 50 m at 10 m/s, against central differences."""
    time = np.arange(201) * 1e-3
    yaw = 0.2 * time
    states = np.zeros((201, 8))
    states[:, 0], states[:, 1] = 50.0 * np.sin(yaw), 50.0 * (1.0 - np.cos(yaw))
    states[:, 2], states[:, 3], states[:, 6] = yaw, 10.0, 0.2
    series = plan_to_joints(Plan(0, states), 'av0', 1_000_000)
    for values, derivatives in ((series.positions[:, :3], series.velocities[:, :3]),
                                (series.velocities[:, :2], series.accelerations[:, :2])):
        np.testing.assert_allclose((values[2:] - values[:-2]) / 2e-3, derivatives[1:-1],
                                   atol=1e-4)


def test_reverse_keeps_its_sign() -> None:
    """Speed is signed along the heading."""
    states = np.zeros((2, 8))
    states[:, 2], states[:, 3], states[:, 5] = 2.0, -3.0, -1.5
    back = plan_from_joints(plan_to_joints(Plan(0, states), 'av0', STEP_NS), 'av0', STEP_NS)
    np.testing.assert_allclose(back.states[:, [3, 5]], [[-3.0, -1.5]] * 2)


def test_names() -> None:
    """The names are those of the contract."""
    assert vehicle_joint_names('hv1') == ('hv1/x', 'hv1/y', 'hv1/yaw', 'hv1/steering')
    assert object_joint_names('o12') == ('o12/x', 'o12/y', 'o12/yaw')


def good() -> JointSeries:
    """Make an acceptable plan."""
    return plan_to_joints(Plan(0, random_states(5, 4)), 'av0', STEP_NS)


def test_names_must_be_the_avs() -> None:
    """Another AV's names or another order are refused."""
    with pytest.raises(InputError, match='/av1/plan: joint_names are av0/x.*name av1/x'):
        plan_from_joints(good(), 'av1', STEP_NS)
    swapped = replace(good(), names=('av0/y', 'av0/x', 'av0/yaw', 'av0/steering'))
    with pytest.raises(InputError, match='/av0/plan: joint_names'):
        plan_from_joints(swapped, 'av0', STEP_NS)


@pytest.mark.parametrize('times', [
    [0, 200, 300, 400], [100, 200, 300, 400], [0, 100, 100, 300], [0, 100, 202, 300]])
def test_points_must_be_on_the_grid(times: list[int]) -> None:
    """Gaps, a late begin, repetition: more than 1 % of the step off."""
    series = replace(good(), times_ns=np.array(times, dtype=np.int64) * 1_000_000)
    with pytest.raises(InputError, match=r'off the grid; space the points 0\.1 s apart'):
        plan_from_joints(series, 'av0', STEP_NS)


def test_rounding_of_times_is_tolerated() -> None:
    """A planner that computes i * 0.1 in floats is a nanosecond off."""
    series = replace(good(), times_ns=np.array([0, 100_000_001, 199_999_999, 300_000_000]))
    assert len(plan_from_joints(series, 'av0', STEP_NS).states) == 4


def test_empty_plan_is_refused() -> None:
    """No points, no plan."""
    empty = np.empty((0, 4))
    series = JointSeries(0, vehicle_joint_names('av0'), np.empty(0, np.int64), empty, empty, empty)
    with pytest.raises(InputError, match='has no points'):
        plan_from_joints(series, 'av0', STEP_NS)


def test_accelerations_left_out_follow_from_the_speeds() -> None:
    """An external planner may leave accelerations out; of a uniform motion they are exact."""
    speeds = 10.0 - 2.0 * 0.1 * np.arange(4)
    series = replace(good(), accelerations=np.full((4, 4), np.nan))
    series.positions[:, 2] = 0.3
    series.velocities[:, 0], series.velocities[:, 1] = speeds * np.cos(0.3), speeds * np.sin(0.3)
    states = plan_from_joints(series, 'av0', STEP_NS).states
    assert states[:, StateColumn.ACCELERATION] == pytest.approx(-2.0, abs=1e-9)
    assert np.isfinite(states).all()
