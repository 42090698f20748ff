# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How agents come onto the road and leave it."""

from pathlib import Path

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.traffic.fleet.adoption import adoptable, Adopted
import numpy as np
import pytest
import traffic_support as support

LANE = 300.0


def one_lane() -> support.Scenario:
    return support.roads(support.straight_lane(1, 0.0, 0.0, LANE))


def test_agents_are_placed_in_lanes_with_gaps_away_from_others(maps: Path) -> None:
    actor = support.human(0.0, 0.0, 0.0)
    run = support.Run(maps / 'ZAM_Traffic-1_1_T-1.xml', TrafficSpec(agents=40), 5, [actor])
    poses = run.poses[0]
    here = np.isfinite(poses[:, 0])
    assert here.sum() >= 38
    assert run.overlaps() == []
    lanes = run.network.lanelets_at(poses[here])
    assert (lanes >= 0).all()
    away = np.hypot(*(poses[here, :2]).T)
    assert away[np.abs(poses[here, 1]) < 1.0].min() > 8.0
    for lane in np.unique(lanes):
        same = np.flatnonzero(here)[lanes == lane]
        order = same[np.argsort([run.network.locate(run.network.lanelet_ids[lane],
                                                    *poses[i, :2])[0] for i in same])]
        for behind, ahead in zip(order[:-1], order[1:], strict=True):
            gap = np.hypot(*(poses[ahead, :2] - poses[behind, :2])) - 0.5 * sum(
                run.descriptions[i].shape.length for i in (behind, ahead))
            assert gap > 3.0 + 1.2 * run.speeds[0][behind] - 0.2


@pytest.mark.exhaustive
def test_the_seed_decides(maps: Path) -> None:
    path = maps / 'ZAM_Intersection-1_1_T-1.xml'
    first, again, other = (support.Run(path, TrafficSpec(agents=10), seed)
                           for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.poses[0], again.poses[0])
    assert not np.array_equal(first.poses[0], other.poses[0])
    own = support.Run(path, TrafficSpec(agents=10, seed=1), 99)
    np.testing.assert_array_equal(first.poses[0], own.poses[0])


@pytest.mark.slow
def test_arrivals_come_at_the_given_flow() -> None:
    run = support.Run(one_lane(), TrafficSpec(flow=900.0, truck_share=0.0), 3).ticks(1200)
    present = np.isfinite(np.array(run.poses)[:, :, 0])
    arrived = (present[1:] & ~present[:-1]).sum()
    # Poisson: 30 in 120 s, with a standard deviation of 5.5; some may still wait for room.
    assert 15 <= arrived <= 45
    assert run.overlaps() == []


@pytest.mark.slow
def test_a_lane_carries_what_the_manual_says() -> None:
    """Highway Capacity Manual: 1,900 cars an hour and lane and more where all wait to come."""
    lane = support.roads(support.straight_lane(1, 0.0, 0.0, 600.0))
    run = support.Run(lane, TrafficSpec(flow=3600.0, truck_share=0.0), 3).ticks(2400)
    present = np.isfinite(np.array(run.poses)[:, :, 0])
    left = (present[600:-1] & ~present[601:]).sum()
    assert 1800.0 <= left * 20.0 <= 2400.0
    assert run.overlaps() == []


def test_a_fast_arrival_can_still_halt_before_a_junction_far_ahead() -> None:
    """Two fast roads cross behind 200 m. Who comes in can halt there, with 1.5 m/s^2 at most."""
    across = support.lane_strip(3, [(220.0, y) for y in np.linspace(-220.0, 200.0, 80)])
    run = support.Run(support.roads(
        support.straight_lane(1, 0.0, 0.0, 200.0, successor=[2]),
        support.straight_lane(2, 0.0, 200.0, 500.0, predecessor=[1]), across),
        TrafficSpec(flow=400.0, truck_share=0.0, speed_factor=3.0), 1).ticks(1500)
    poses, speeds = np.array(run.poses), np.array(run.speeds)
    came = ~np.isnan(poses[1:, :, 0]) & np.isnan(poses[:-1, :, 0])
    at, entered = poses[1:][came], speeds[1:][came]
    rest = 218.0 - np.where(at[:, 0] < 219.0, at[:, 0], 218.0 + at[:, 1] + 2.0)
    assert len(rest) > 15
    assert (entered**2 < 2.0 * 1.5 * rest).all()
    assert entered.max() > 20.0


def test_an_agent_at_the_end_of_the_map_is_absent_for_a_tick_at_least() -> None:
    run = support.Run(one_lane(), TrafficSpec(flow=1800.0, capacity=6, truck_share=0.0),
                      1).ticks(700)
    poses = np.array(run.poses)
    present = np.isfinite(poses[:, :, 0])
    assert poses[present][:, 0].max() <= LANE + 2.25 + 1.5
    jumps = np.abs(np.diff(poses[:, :, 0], axis=0))
    # No agent jumps back to the start: its slot is absent in between.
    assert np.nanmax(jumps) < 3.0
    assert (present[1:] & ~present[:-1]).sum() > 6


def test_an_adopted_recording_goes_on_from_its_first_pose_and_speed(maps: Path) -> None:
    way = [(-100.0 + 1.2 * i, -1.75, 0.0) for i in range(40)]
    found = support.driving(7, way, 12.0, first_k=5)
    run = support.Run(maps / 'ZAM_Intersection-1_1_T-1.xml', TrafficSpec(recorded='reactive'),
                      adopted=[found]).ticks(20)
    assert run.descriptions[0].id == 'o7' and run.descriptions[0].role is Role.TRAFFIC
    poses, speeds = run.series(0)
    assert np.isnan(poses[:5]).all()
    np.testing.assert_allclose(poses[5], way[0], atol=1e-9)
    assert speeds[5] == pytest.approx(12.0)
    assert poses[-1, 0] > poses[5, 0] + 14.0


def test_an_adopted_recording_turns_where_it_turned(maps: Path) -> None:
    roads = RoadNetwork(load_scenario(maps / 'ZAM_Intersection-1_1_T-1.xml')
                        .scenario.lanelet_network)
    for goal in (22, 32, 42):
        way = [roads.pose_on(11, 280.0), roads.pose_on(goal, 30.0)]
        run = support.Run(maps / 'ZAM_Intersection-1_1_T-1.xml', TrafficSpec(),
                          adopted=[support.driving(1, way, 8.0)]).ticks(250)
        poses, _ = run.series(0)
        last = poses[np.isfinite(poses[:, 0])][-1]
        assert roads.lanelet_at(*last) == goal


def test_an_adopted_recording_waits_until_its_place_is_free(maps: Path) -> None:
    actor = support.human(-100.0, -1.75, 0.0, until=30)
    found = support.driving(7, [(-100.0, -1.75, 0.0)] * 60 + [(60.0, -1.75, 0.0)], 0.0)
    run = support.Run(maps / 'ZAM_Intersection-1_1_T-1.xml', TrafficSpec(), 0, [actor],
                      [found]).ticks(50)
    present = np.isfinite(run.series(0)[0][:, 0])
    assert not present[:30].any() and present[-1]
    assert run.overlaps() == []


def test_which_recordings_can_become_agents(maps: Path) -> None:
    roads = RoadNetwork(load_scenario(maps / 'ZAM_Intersection-1_1_T-1.xml')
                        .scenario.lanelet_network)
    drive = np.array([(-100.0 + i, -1.75, 0.0) for i in range(50)])
    stand = np.repeat(drive[:1], 50, axis=0)
    beside = drive + (0.0, -30.0, 0.0)

    def can(kind: str, poses: np.ndarray, role: Role = Role.RECORDED) -> bool:
        return adoptable(ObjectDescription('o1', kind, role, Shape.rectangle(4.5, 1.8)), poses,
                         roads)

    for kind in ('car', 'truck', 'bus', 'motorcycle', 'bicycle'):
        assert can(kind, drive)
    assert not can('pedestrian', drive)
    assert not can('parkedVehicle', drive)
    assert not can('car', drive, Role.STATIC)
    assert not can('car', stand)
    assert not can('car', beside)
    assert not can('car', drive + (0.0, 0.0, np.pi))
    assert not can('car', np.full((5, 3), np.nan))


def test_recorded_traffic_of_a_real_motorway_can_be_adopted(shared_scenarios: Path) -> None:
    loaded = load_scenario(shared_scenarios / 'USA_US101-4_1_T-1.xml')
    obstacles, roads = ScenarioObstacles(loaded), RoadNetwork(loaded.scenario.lanelet_network)
    adopted = []
    for column, description in enumerate(obstacles.descriptions):
        poses, velocities = obstacles.track(column)
        if adoptable(description, poses, roads):
            first = int(np.flatnonzero(np.isfinite(obstacles.poses[:, column, 0]))[0])
            adopted.append(Adopted(description, first + obstacles.first_k, poses, velocities))
    assert len(adopted) >= 20
    run = support.Run(loaded.scenario, TrafficSpec(recorded='reactive'), adopted=adopted)
    assert np.isfinite(run.poses[0][:, 0]).sum() >= 15
    run.ticks(100)
    assert run.overlaps() == []


def test_a_restart_goes_on_from_what_was_seen(maps: Path) -> None:
    spec = TrafficSpec(agents=12, flow=400.0)
    run = support.Run(maps / 'ZAM_Intersection-1_1_T-1.xml', spec, 2).ticks(100)
    fresh = support.Run(maps / 'ZAM_Intersection-1_1_T-1.xml', spec, 2)
    seen = run.traffic.states
    fresh.traffic.resume(100, seen)
    np.testing.assert_allclose(fresh.traffic.states.poses, seen.poses, atol=1e-9)
    np.testing.assert_allclose(fresh.traffic.states.velocities[:, :2], seen.velocities[:, :2],
                               atol=0.6)
    fresh.k = 100
    fresh.poses.clear()
    fresh.note()
    fresh.ticks(100)
    assert fresh.overlaps() == []
    steps = np.hypot(*np.diff(np.array(fresh.poses), axis=0)[:, :, :2].transpose(2, 0, 1))
    assert np.nanmax(steps) < 3.0


def test_recorded_vehicles_of_skipped_ticks_appear_unless_they_may_have_left() -> None:
    """After a stall from k = 3 to k = 20 the same agents go on, or new ones take over."""
    found = support.driving(7, [(20.0 + i, 0.0, 0.0) for i in range(100)], 10.0, first_k=5)
    run = support.Run(one_lane(), TrafficSpec(recorded='reactive'), adopted=[found]).ticks(3)
    nobody = run.traffic.states
    for is_new in (False, True):
        run.traffic.resume(20, nobody, is_new)
        run.k = 20
        assert np.isfinite(run.ticks(1).poses[-1][0]).all() != is_new


def test_agents_that_were_published_appear_only_once() -> None:
    """The agent of a recording may have left where it was when the ticks were skipped."""
    found = support.driving(7, [(20.0 + i, 0.0, 0.0) for i in range(100)], 10.0)
    run = support.Run(one_lane(), TrafficSpec(recorded='reactive'), adopted=[found]).ticks(3)
    seen = run.traffic.states
    for is_new in (False, True):
        run.traffic.resume(20, seen, is_new)
        np.testing.assert_allclose(run.traffic.states.poses, seen.poses, atol=1e-9)


@pytest.mark.exhaustive
def test_no_agent_arrives_into_a_jam() -> None:
    """Behind a wreck at the road's end the queue doesn't reach back to the road's beginning."""
    wreck = support.human(LANE - 10.0, 0.0, 0.0, kind='parkedVehicle')
    run = support.Run(one_lane(), TrafficSpec(flow=1800.0, truck_share=0.0), 3, [wreck])
    poses = run.ticks(2400).poses[-1]
    here = poses[np.isfinite(poses[:, 0]), 0]
    assert len(here) > 5
    assert here.min() > 60.0
