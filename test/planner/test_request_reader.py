# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A planner's view of a request: the objects' positions, as centres."""

from dataclasses import replace
import math

from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.geometry.shape import Shape
from crgame_ros.messages.joints import (
    JointSeries,
    object_joint_names,
    vehicle_joint_names,
    vehicle_to_joints,
)
from crgame_ros.planner.request_reader import RequestReader
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest

REACH = 1.4227
BODY = Shape.rectangle(4.5, 1.6)
OBJECTS = {
    'hv0': ObjectDescription('hv0', 'car', Role.HUMAN, BODY, REACH),
    'av0': ObjectDescription('av0', 'car', Role.AUTONOMOUS, BODY, REACH),
    'o3': ObjectDescription('o3', 'truck', Role.RECORDED, BODY),
    'o4': ObjectDescription('o4', 'car', Role.RECORDED, BODY)}
SCHEDULER = ScenarioScheduler.from_rate(0.1, 100.0, k0=5, clock_offset_ns=2_000_000_000)
EGO = VehicleState(1.0, -2.0, 0.5, 12.0, 0.05, -1.0, 0.2, 0.01)
HUMAN = VehicleState(30.0, 4.0, math.pi / 2, 8.0, 0.1, 0.5, 0.3, 0.0)


def request() -> JointSeries:
    """Build two points: the AV, a human, o3 at its place, o4 absent."""
    names = (*vehicle_joint_names('av0'), *vehicle_joint_names('hv0'),
             *object_joint_names('o3'), *object_joint_names('o4'))
    values = np.full((3, 2, len(names)), np.nan)
    for place, state in ((0, EGO), (4, HUMAN)):
        values[:, 0, place:place + 4] = vehicle_to_joints(state)
    values[0, 1, 4:8] = (30.0, 4.8, math.pi / 2 + 0.03, 0.1)
    values[1, 1, 4:8] = (-0.24, 8.0, 0.3, 0.0)
    values[0, :, 8:11] = (50.0, 0.0, 0.2)
    values[1, :, 8:11] = (9.8, 1.9, 0.0)
    return JointSeries(2_300_000_000, names, np.array([0, 100_000_000]), *values)


def reader() -> RequestReader:
    return RequestReader('av0', OBJECTS, SCHEDULER)


def test_ego_and_time() -> None:
    """The ego stays a rear-axle state; k is k0 + 3 at 0.3 s after the clock's offset."""
    read = reader().read(request())
    assert read.ego == pytest.approx(EGO, abs=1e-12)
    assert (read.stamp_ns, read.k, read.time_step_s) == (2_300_000_000, 8, 0.1)
    assert read.obstacle_ids == ('hv0', 'o3', 'o4')
    assert read.obstacle_poses.shape == read.obstacle_velocities.shape == (2, 3, 3)


def test_driven_vehicles_arrive_as_centres() -> None:
    """
    The centre is l_r ahead of the rear axle and moves by v + yaw rate x l_r.

    The human drives north: its centre is 1.4227 m further north and swings to the west.
    """
    read = reader().read(request())
    assert read.obstacle_poses[0, 0] == pytest.approx((30.0, 4.0 + REACH, math.pi / 2))
    assert read.obstacle_velocities[0, 0] == pytest.approx((-0.3 * REACH, 8.0, 0.3))
    yaw = math.pi / 2 + 0.03
    assert read.obstacle_poses[1, 0] == pytest.approx(
        (30.0 + REACH * math.cos(yaw), 4.8 + REACH * math.sin(yaw), yaw))


def test_other_objects_are_centres_already() -> None:
    """Recorded vehicles stay where they are."""
    read = reader().read(request())
    assert read.obstacle_poses[:, 1].tolist() == [[50.0, 0.0, 0.2]] * 2
    assert read.obstacle_velocities[:, 1].tolist() == [[9.8, 1.9, 0.0]] * 2


def test_absent_object_is_nan() -> None:
    """In all its components; no other object is NaN."""
    read = reader().read(request())
    assert np.isnan(read.obstacle_poses[:, 2]).all()
    assert np.isnan(read.obstacle_velocities[:, 2]).all()
    assert np.isfinite(read.obstacle_poses[:, :2]).all()


def test_request_is_not_changed() -> None:
    """The same arrays are recorded and sent."""
    series = request()
    before = series.positions.copy(), series.velocities.copy()
    reader().read(series)
    np.testing.assert_array_equal(series.positions, before[0])
    np.testing.assert_array_equal(series.velocities, before[1])


def test_other_joints_are_learnt_anew() -> None:
    """After a reset other objects may appear."""
    kept = reader()
    assert kept.read(request()).obstacle_ids == ('hv0', 'o3', 'o4')
    series = request()
    fewer = replace(series, names=series.names[:8], positions=series.positions[:, :8],
                    velocities=series.velocities[:, :8], accelerations=series.accelerations[:, :8])
    assert kept.read(fewer).obstacle_ids == ('hv0',)
    assert kept.read(request()).obstacle_ids == ('hv0', 'o3', 'o4')


def test_ego_alone() -> None:
    """No other object in the scenario: empty arrays of the right shape."""
    series = request()
    alone = replace(series, names=series.names[:4], positions=series.positions[:, :4],
                    velocities=series.velocities[:, :4], accelerations=series.accelerations[:, :4])
    read = reader().read(alone)
    assert read.obstacle_ids == ()
    assert read.obstacle_poses.shape == (2, 0, 3)


@pytest.mark.parametrize(('change', 'named'), [
    ({'stamp_ns': 2_350_000_000}, 'is no scenario tick'),
    ({'stamp_ns': 1_000_000_000}, 'is no scenario tick'),
    ({'names': ('hv0/x', *request().names[1:])}, 'does not begin with av0/x'),
    ({'names': (*request().names[:11], 'o9/x', 'o9/y', 'o9/yaw')}, '"o9" is not described'),
    ({'names': (*request().names[:11], 'o4/x', 'o4/y', 'o4/z')}, '"o4" lacks a joint'),
    ({'names': (), 'positions': np.empty((2, 0))}, 'does not begin with')])
def test_other_requests_are_refused(change: dict[str, object], named: str) -> None:
    """It raises one error that names the topic."""
    with pytest.raises(InputError, match=f'/av0/plan_request: .*{named}'):
        reader().read(replace(request(), **change))


def test_request_without_points_is_refused() -> None:
    """Any publisher may send an empty message."""
    empty = np.empty((0, 14))
    series = replace(request(), times_ns=np.empty(0, np.int64), positions=empty,
                     velocities=empty, accelerations=empty)
    with pytest.raises(InputError, match='has no points'):
        reader().read(series)
