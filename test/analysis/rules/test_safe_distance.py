# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The safe distance against braking in small steps, and cut-ins on a road of two lanes."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from commonroad.scenario.scenario import Scenario
from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.criticality.headways import Following, Headways
from crgame_ros.analysis.rules.vehicle_rules import safe_distance, unsafe_distance, UnsafeDistance
from crgame_ros.game.game import DrivabilitySpec
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.geometry.shape import Shape
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.simulation.observer import ObservedRun
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn
from made_roads import made, Piece
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
CAR = Shape('rectangle', 4.5, 1.8)
STEP_S = 0.1


def nearest_when_braking(gap: Array, speed: Array, leader_speed: Array) -> Array:
    """Brake with 10.5 m/s^2 and, 0.3 s later, with 10 m/s^2, in steps of 1 ms."""
    gap, speed, leader_speed, least = (np.array(each) for each in (
        gap, speed, leader_speed, gap))
    for step in range(6000):
        after = np.maximum(speed - 0.01 * (step >= 300), 0.0)
        leader_after = np.maximum(leader_speed - 0.0105, 0.0)
        gap = gap + 0.0005 * (leader_speed + leader_after - speed - after)
        speed, leader_speed, least = after, leader_after, np.minimum(least, gap)
    return least


def test_at_the_safe_distance_both_stop_without_contact() -> None:
    """A little nearer they touch, unless any distance is safe."""
    speed, leader_speed = np.random.default_rng(3).uniform(0.0, 50.0, (2, 2000))
    needed = safe_distance(speed, leader_speed)
    assert (nearest_when_braking(needed + 0.1, speed, leader_speed) > 0.0).all()
    tight = needed > 0.2
    assert 800 < tight.sum() < 1900
    nearest = nearest_when_braking(needed - 0.1, speed, leader_speed)
    assert (nearest[tight] < 0.0).all()
    assert safe_distance(np.array([20.0]), np.array([15.0])) == pytest.approx(
        6.0 + 20.0 - 225.0 / 21.0)
    # Backwards counts as standing, and so does a leader that comes towards the vehicle.
    assert safe_distance(np.array([-5.0, 20.0]), np.array([0.0, -8.0])).tolist() == [0.0, 26.0]


def following(gaps: Sequence[float | None], leader: int = 1) -> Headways:
    """Follow at 20 m/s a leader of 15 m/s, at 15.29 m of which it is safe."""
    headways = Headways()
    for gap in gaps:
        headways.add(None if gap is None else Following(
            gap, gap + 4.5, 20.0, leader, 15.0, 0.0), np.inf)
    return headways


def test_time_below_the_safe_distance() -> None:
    """17 m down to 14 m in steps of 0.5 m: three are too near; then one more and a pause."""
    gaps = [*np.arange(17.0, 13.9, -0.5).tolist(), None, 15.0, 15.5, 15.0]
    found = unsafe_distance(following(gaps), STEP_S)
    assert found == UnsafeDistance(pytest.approx(5 / 10), pytest.approx(0.3))
    assert unsafe_distance(following([15.3] * 5), STEP_S) == (0.0, 0.0)
    assert unsafe_distance(following([None, None]), STEP_S) is None


@pytest.fixture(scope='module')
def road(project_root: Path) -> LoadedScenario:
    """Make a road of two lanes along x, the left one around y = 3.5 m."""
    lanes = made({1: Piece((0.0, 0.0, 0.0), 1000.0, left=2),
                  2: Piece((0.0, 3.5, 0.0), 1000.0, right=1)})
    scenario = Scenario(STEP_S)
    scenario.replace_lanelet_network(lanes.lanelet_network)
    some = load_scenario(project_root / 'scenarios' / 'ZAM_CutIn-1_1_T-1.xml')
    return replace(some, scenario=scenario)


def measured(road: LoadedScenario, own: Array, *others: Array) -> UnsafeDistance | None:
    """Measure a car whose centre, and those of others, are at (K, 2) places."""
    ids = [f'o{i}' for i in range(len(others))]
    vehicles = (ObjectDescription('av0', 'car', Role.AUTONOMOUS, CAR),)
    criticality = Criticality(ObservedRun(
        vehicles, tuple(ObjectDescription(each, 'car', Role.RECORDED, CAR) for each in ids), road,
        ScenarioScheduler(100_000_000, 10), DrivabilitySpec(), None, (RigidTransform(),),
        np.zeros((1, STATE_WIDTH))))
    tracks = np.stack((own, *others), axis=1)
    moves = np.gradient(tracks, STEP_S, axis=0)
    for row, (places, rates) in enumerate(zip(tracks, moves, strict=True)):
        yaw = np.arctan2(rates[:, 1], rates[:, 0])
        state = np.zeros((1, STATE_WIDTH))
        state[0, [StateColumn.X, StateColumn.Y, StateColumn.YAW, StateColumn.SPEED]] = (
            *places[0], yaw[0], np.hypot(*rates[0]))
        flat = np.zeros(len(others))
        criticality.observe(10 * row, 0.0, state, ObjectStates(
            np.column_stack((places[1:], yaw[1:])), np.column_stack((rates[1:], flat))))
    headways = criticality.report()[0].headways
    return unsafe_distance(headways, STEP_S)


TIMES = np.arange(0.0, 10.0, STEP_S)


def straight(x: Array, y: float | Array) -> Array:
    return np.column_stack((x, np.broadcast_to(y, x.shape)))


def aside(begin: float, end: float, since_s: float) -> Array:
    """Move from one offset to another at 1 m/s."""
    way = np.clip(TIMES - since_s, 0.0, abs(end - begin))
    return begin + np.sign(end - begin) * way


@pytest.mark.parametrize(('restored_s', 'unsafe_s'), [(2.5, 0.0), (6.0, 3.0)])
def test_three_seconds_restore_the_distance_after_a_cut_in(
        road: LoadedScenario, restored_s: float, unsafe_s: float) -> None:
    """At 20 m/s 5 m behind one that comes from the left; safe is 6.95 m."""
    # It overlaps the corridor from 3.5 - 2.05 m on: 1.45 s after it began to move.
    since = 1.0 + 1.45
    gap = np.where(TIMES < since + restored_s, 5.0, 9.0)
    own = straight(20.0 * TIMES, 0.0)
    # Its speed is 20 m/s but at the one jump, far behind which it is driven on.
    other = straight(20.0 * TIMES + 4.5 + gap, aside(3.5, 0.0, 1.0))
    found = measured(road, own, other)
    assert found is not None
    assert found.longest_s == pytest.approx(unsafe_s, abs=0.25)


def test_an_own_lane_change_is_no_cut_in(road: LoadedScenario) -> None:
    """Who pulls in 5 m behind another has to keep the distance at once."""
    other = straight(20.0 * TIMES + 9.5, 0.0)
    found = measured(road, straight(20.0 * TIMES, aside(3.5, 0.0, 1.0)), other)
    assert found is not None and found.share == 1.0
    assert found.longest_s == pytest.approx(10.0 - 2.45, abs=0.25)


def test_a_leader_that_makes_way_is_no_cut_in(road: LoadedScenario) -> None:
    """The next one stands there: 26 m are needed, from 40 m on it is in reach after 0.7 s."""
    first = straight(20.0 * TIMES + 4.5 + 8.0, aside(0.0, 3.5, 0.0))
    stands = straight(np.full(len(TIMES), 200.0), 0.0)
    x = np.minimum(20.0 * TIMES, 180.0)
    found = measured(road, straight(x, 0.0), first, stands)
    assert found is not None
    # From 26 m before it until it stops at 15.5 m: 0.5 s, ended by the jump to standstill.
    assert found.longest_s == pytest.approx(0.5, abs=0.15)


def test_who_leads_from_the_start_did_not_cut_in(road: LoadedScenario) -> None:
    """Even if it is still moving across."""
    other = straight(20.0 * TIMES + 9.5, aside(1.0, 0.0, 0.0))
    found = measured(road, straight(20.0 * TIMES, 0.0), other)
    assert found == UnsafeDistance(1.0, pytest.approx(10.0))
