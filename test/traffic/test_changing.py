# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lane changes for the route, past slow leaders and where a lane ends; courtesy; swerving."""

from dataclasses import replace
from pathlib import Path

from commonroad.scenario.scenario import Scenario
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.traffic.fleet.adoption import Adopted
import numpy as np
import pytest
import traffic_support as support

NARROW = Shape.rectangle(1.0, 1.0)


def two_lanes(end_of_right: float = 1200.0) -> Scenario:
    """Make lane 1 (y = 0) and, to its right, lane 2 (y = -3.5) that may end before."""
    beside = {'adjacent_right': 2, 'adjacent_right_same_direction': True}
    left = support.straight_lane(1, 0.0, 0.0, end_of_right, **beside,
                                 **({'successor': [3]} if end_of_right < 1200.0 else {}))
    right = support.straight_lane(2, -3.5, 0.0, end_of_right, adjacent_left=1,
                                  adjacent_left_same_direction=True)
    if end_of_right >= 1200.0:
        return support.roads(left, right)
    return support.roads(left, right, support.straight_lane(3, 0.0, end_of_right, 1200.0,
                                                            predecessor=[1]))


def agent(number: int, x: float, y: float, speed: float, fastest: float = 0.0) -> Adopted:
    made = support.driving(number, [(x, y, 0.0), (1100.0, y, 0.0)], speed)
    made.velocities[-1, 0] = max(speed, fastest)
    return made


def test_a_slow_leader_is_overtaken() -> None:
    human = support.human(120.0, -3.5, 0.0, 6.0)
    ways = []
    for changes in (True, False):
        run = support.Run(two_lanes(), TrafficSpec(lane_changes=changes), 0, [human],
                          [agent(1, 20.0, -3.5, 13.0)]).ticks(300)
        assert run.overlaps() == []
        ways.append(run.series(0))
    poses, _ = ways[0]
    assert np.nanmax(poses[:, 1]) > -0.3
    assert poses[-1, 0] > human.at(300, 0.1)[0][0] + 20.0
    # Without lane changes it stays behind.
    poses, speeds = ways[1]
    assert np.nanmax(poses[:, 1]) < -3.3
    assert abs(speeds[-1] - 6.0) < 0.3


def test_a_change_follows_a_quintic_without_haste() -> None:
    human = support.human(120.0, -3.5, 0.0, 6.0)
    run = support.Run(two_lanes(), TrafficSpec(), 0, [human],
                      [agent(1, 20.0, -3.5, 13.0)]).ticks(200)
    poses, speeds = run.series(0)
    inside = np.flatnonzero((poses[:, 1] > -3.4) & (poses[:, 1] < -0.1))
    took = (inside[-1] - inside[0]) * 0.1
    assert 2.0 < took < 6.0
    lateral = np.diff(poses[:, 1], 2) / 0.01
    # 10 / sqrt(3) W v^2 / L^2 with W = 3.5 m and L = 4 s v is 1.3 m/s^2.
    assert np.abs(lateral).max() < 2.0
    assert np.nanmax(poses[:, 1]) < 0.35, 'no overshoot to speak of'


def test_an_agent_on_a_lane_that_ends_merges() -> None:
    run = support.Run(two_lanes(400.0), TrafficSpec(), 0, (),
                      [agent(1, 20.0, -3.5, 13.0)]).ticks(400)
    poses, speeds = run.series(0)
    assert np.nanmax(poses[:, 0]) > 420.0
    assert np.nanmin(speeds[:200]) > 10.0
    run = support.Run(two_lanes(400.0), TrafficSpec(lane_changes=False), 0, (),
                      [agent(1, 20.0, -3.5, 13.0)]).ticks(600)
    poses, speeds = run.series(0)
    assert speeds[-1] == 0.0 and poses[-1, 0] < 400.0


def dense(cooperative: bool) -> support.Run:
    """Run an agent that merges from the end of a lane into a platoon with a time gap of 1.1 s."""
    platoon = [agent(i + 2, 200.0 - 17.0 * i, 0.0, 11.0) for i in range(11)]
    return support.Run(two_lanes(330.0), TrafficSpec(
        cooperative=cooperative, options={'time_gap': 1.1}), 0, (),
        [agent(1, 120.0, -3.5, 11.0), *platoon]).ticks(700)


def test_others_make_room_for_an_agent_that_has_to_merge() -> None:
    with_courtesy, without = dense(True), dense(False)
    assert with_courtesy.overlaps() == [] and without.overlaps() == []

    def merged_at(run: support.Run) -> float:
        inside = np.flatnonzero(run.series(0)[0][:, 1] > -1.0)
        return 0.1 * inside[0] if len(inside) else np.inf

    assert merged_at(with_courtesy) < merged_at(without) - 2.0
    # No shock wave: no agent in the platoon brakes hard (Hidas 2005), except one that leaves it
    # to pass others on the lane that ends.
    stays = np.nanmin(np.array(with_courtesy.poses)[:, 1:, 1], axis=0) > -1.0
    assert stays.sum() >= 9
    speeds = np.array(with_courtesy.speeds)[:, 1:][:, stays]
    assert np.nanmin(np.diff(speeds, axis=0)) / 0.1 > -2.1


def test_an_obstacle_that_blocks_the_lane_is_passed_in_the_next() -> None:
    wreck = support.human(250.0, -3.5, 0.3, kind='parkedVehicle')
    run = support.Run(two_lanes(), TrafficSpec(), 0, [wreck],
                      [agent(1, 20.0, -3.5, 13.0), agent(2, -0.0 + 4.0, -3.5, 11.0)]).ticks(500)
    assert run.overlaps() == []
    assert np.nanmax(run.series(0)[0][:, 0]) > 400.0
    assert np.nanmax(run.series(1)[0][:, 0]) > 400.0


def test_an_agent_that_stands_behind_an_obstacle_passes_it_when_the_next_lane_is_free() -> None:
    wreck = support.human(130.0, -3.5, 0.0, kind='parkedVehicle')
    beside = [agent(2 + i, 110.0 - 22.0 * i, 0.0, 11.0, 11.0) for i in range(4)]
    run = support.Run(two_lanes(), TrafficSpec(lane_changes=True), 0, [wreck],
                      [agent(1, 112.0, -3.5, 3.0, 11.0), *beside]).ticks(400)
    assert run.overlaps() == []
    poses, speeds = run.series(0)
    assert np.nanmin(speeds) < 0.1, 'it stood until the four beside had passed'
    assert np.nanmax(poses[:, 0]) > 200.0


@pytest.mark.parametrize('length', [4.5, 8.0])
def test_a_standing_vehicle_steers_out_from_behind_another(length: float) -> None:
    """A lane change that clears the leader's corner is not given up before it, by no length."""
    wreck = support.human(130.0, -3.5, 0.0, kind='parkedVehicle')
    waiting = agent(1, 130.0 - 2.25 - 2.0 * length - 0.5 * length, -3.5, 0.0, 11.0)
    shape = Shape.rectangle(length, 2.5)
    waiting = replace(waiting, description=replace(waiting.description, shape=shape))
    run = support.Run(two_lanes(), TrafficSpec(), 0, [wreck], [waiting]).ticks(250)
    assert run.overlaps() == []
    poses, _ = run.series(0)
    assert np.nanmax(poses[:, 0]) > 180.0
    # The outer edge is at 1.75 m, and the front swings out beyond the vehicle's middle.
    assert np.nanmax(poses[:, 1]) < 0.75


def test_no_change_into_a_lane_that_is_blocked_behind_a_queue() -> None:
    """Two cars stand behind an obstacle in the right lane; who is faster stays left of them."""
    wreck = support.human(160.0, -3.5, 0.0, kind='parkedVehicle')
    queue = [agent(2 + i, 148.0 - 7.0 * i, -3.5, 0.0, 0.0) for i in range(2)]
    slow = agent(4, 110.0, 0.0, 4.0, 4.0)
    run = support.Run(two_lanes(), TrafficSpec(), 0, [wreck],
                      [agent(1, 90.0, 0.0, 8.0, 14.0), slow, *queue]).ticks(150)
    assert run.overlaps() == []
    poses, _ = run.series(0)
    assert np.nanmin(poses[:, 1]) > -0.5


def test_an_obstacle_at_the_edge_of_the_lane_is_swerved_around() -> None:
    # Half a metre into the lane: 1.25 m to its middle, where a car's side is at 0.9 m.
    box = support.human(150.0, -1.75, 0.0, kind='parkedVehicle', shape=NARROW)
    lane = support.roads(support.straight_lane(1, 0.0, 0.0, 400.0))
    paths = {}
    for swerve in (True, False):
        run = support.Run(lane, TrafficSpec(swerve=swerve), 0, [box],
                          [agent(1, 20.0, 0.0, 11.0)]).ticks(250)
        assert run.overlaps() == []
        paths[swerve] = run.series(0)
    poses, speeds = paths[True]
    at = int(np.nanargmin(np.abs(poses[:, 0] - 150.0)))
    # The clearance between the sides is 0.5 m for a band made for cars of 2 m width.
    assert 0.2 < poses[at, 1] < 0.5
    assert poses[at, 1] - 0.9 + 1.25 > 0.5
    assert np.nanmax(poses[:, 0]) > 250.0
    assert np.nanmax(np.abs(paths[False][0][:, 1])) < 0.05


def test_swerves_are_shared_by_all_agents_of_a_lane(maps: Path) -> None:
    box = support.human(150.0, -1.75, 0.0, kind='parkedVehicle', shape=NARROW)
    lane = support.roads(support.straight_lane(1, 0.0, 0.0, 400.0))
    run = support.Run(lane, TrafficSpec(), 0, [box],
                      [agent(1, 60.0, 0.0, 11.0), agent(2, 20.0, 0.0, 11.0)]).ticks(300)
    first, second = run.series(0)[0], run.series(1)[0]
    x = np.linspace(120.0, 180.0, 61)
    one, two = (np.interp(x, p[np.isfinite(p[:, 0]), 0], p[np.isfinite(p[:, 0]), 1])
                for p in (first, second))
    assert one.max() > 0.2
    np.testing.assert_allclose(one, two, atol=0.03)


def stream(later: int, cooperative: bool) -> support.Run:
    """Run an agent that stands where the right lane ends, beside cars 45 m apart at 25 m/s."""
    begins = [(365.0 - 45.0 * i, 0) for i in range(9)] + [(5.0, 18 * i + 18) for i in range(later)]
    cars = [support.driving(10 + i, [(x, 0.0, 0.0), (1100.0, 0.0, 0.0)], 25.0, first_k=k)
            for i, (x, k) in enumerate(begins)]
    return support.Run(two_lanes(400.0), TrafficSpec(cooperative=cooperative), 0, (),
                       [agent(1, 390.0, -3.5, 0.0, 14.0), *cars])


@pytest.mark.exhaustive
def test_a_car_stops_for_an_agent_that_has_stood_at_the_end_of_a_lane() -> None:
    run = stream(25, cooperative=True).ticks(400)
    assert run.overlaps() == []
    let_in = np.flatnonzero(run.series(0)[0][:, 1] > -1.0)
    # Not before the patience of 3 s; the car that stops for it needs 13 s from 25 m/s.
    assert 30 < let_in[0] < 200
    # No car brakes harder for it than for a vehicle that cuts in.
    speeds = np.array(run.speeds)[:, 1:]
    assert np.nanmin(np.diff(speeds, axis=0)) / 0.1 > -4.1
    # Without courtesy no car stops: such gaps are too short to enter from a stand.
    poses, _ = stream(25, cooperative=False).ticks(400).series(0)
    assert np.nanmax(poses[:, 1]) < -3.0


def test_an_agent_that_has_stood_long_goes_when_the_lane_is_free() -> None:
    run = stream(0, cooperative=False).ticks(300)
    poses, speeds = run.series(0)
    last = run.series(9)[0][:, 0]
    passed = int(np.flatnonzero(last > 400.0)[0])
    # Its rear is 2.25 m behind that: room enough to begin.
    assert speeds[passed - 2] == 0.0 and poses[passed - 2, 1] < -3.0
    assert poses[passed + 60, 1] > -1.0


@pytest.mark.parametrize(('y', 'lane'), [(-0.4, 1), (-3.1, 2)])
def test_a_change_that_comes_to_nothing_ends_in_the_nearer_lane(y: float, lane: int) -> None:
    # An agent that got into the new lane and stood there for long was once treated as in the old
    # lane, and drove on beside a vehicle that had come into the new one.
    traffic = support.Run(two_lanes(), TrafficSpec(), 0, [], [agent(1, 50.0, y, 0.0)]).traffic
    agents, index = traffic._agents, traffic._graph.index
    agents.put(0, index[1], 50.0, y, (50.0, y, 0.0), 0.0)
    agents.source[0], agents.from_s[0], agents.span[0] = index[2], 35.0, 20.0
    agents.waits[0] = 10_000
    traffic._changes.finish(0, agents)
    assert traffic._graph.ids[agents.lane[0]] == lane
    assert agents.source[0] < 0
    assert abs(agents.d[0]) < 0.5


@pytest.mark.exhaustive
def test_no_change_begins_where_a_junction_is_near_behind_a_short_lanelet() -> None:
    """
    Lanes 1 and 2 end at x = 200; lanelets of 6 m lie between them and a junction.

    Agents overtake well before the junction, with at least 15 m left, or behind it.
    """
    pair = {'adjacent_left_same_direction': True, 'adjacent_right_same_direction': True}
    lanes = []
    for first, begin, end in ((1, 0.0, 200.0), (3, 200.0, 206.0), (5, 206.0, 230.0),
                              (7, 230.0, 600.0)):
        links = {key: first + to for key, to in (('predecessor', -2), ('successor', 2))
                 if 0 < first + to < 8}
        for lane, y, side in ((first, 0.0, 'right'), (first + 1, -3.5, 'left')):
            lanes.append(support.straight_lane(
                lane, y, begin, end, **{f'adjacent_{side}': 2 * first + 1 - lane,
                                        f'adjacent_{side}_same_direction':
                                        pair[f'adjacent_{side}_same_direction']},
                **{key: [value + lane - first] for key, value in links.items()}))
    across = support.lane_strip(9, [(218.0, y) for y in np.linspace(-60.0, 60.0, 30)])
    begins = []
    for since in range(0, 60, 3):
        # A slow vehicle comes out of a drive, 25 m ahead.
        run = support.Run(support.roads(*lanes, across), TrafficSpec(), 0,
                          [support.human(175.0 + 0.9 * since, -3.5, 0.0, 5.0, since)],
                          [agent(1, 150.0, -3.5, 9.0)]).ticks(250)
        poses, _ = run.series(0)
        begins.append(float(poses[np.argmax(poses[:, 1] > -3.4), 0]))
    assert all(150.0 < x < 206.0 - 15.0 or x > 230.0 for x in begins), begins


def test_no_change_for_speed_into_a_lane_with_a_merge_within_the_braking_distance() -> None:
    """A ramp merges into the right lane behind x = 400; the braking is 2 m/s^2."""
    lanes = []
    for first, begin, end in ((1, 0.0, 400.0), (3, 400.0, 460.0), (5, 460.0, 1100.0)):
        for lane, y, side in ((first, 0.0, 'right'), (first + 1, -3.5, 'left')):
            links = {'predecessor': [lane - 2] + [7] * (lane == 6)} if first > 1 else {}
            links |= {'successor': [lane + 2]} if first < 5 else {}
            lanes.append(support.straight_lane(
                lane, y, begin, end, **links, **{
                    f'adjacent_{side}': 2 * first + 1 - lane,
                    f'adjacent_{side}_same_direction': True}))
    ramp = support.lane_strip(7, [(x, -3.5 - 0.1 * (460.0 - x)) for x in np.linspace(
        200.0, 460.0, 60)], successor=[6])
    begins = []
    for start in range(10, 330, 20):
        # A slow vehicle ahead in the left lane.
        run = support.Run(support.roads(*lanes, ramp), TrafficSpec(), 0,
                          [support.human(start + 60.0, 0.0, 0.0, 15.0)],
                          [agent(1, float(start), 0.0, 27.0)]).ticks(150)
        poses, speeds = run.series(0)
        at = int(np.argmax(poses[:, 1] < -0.1))
        begins.append((float(400.0 - poses[at, 0]), float(speeds[at])**2 / 4.0))
    assert any(rest > braking for rest, braking in begins), begins
    assert all(rest > braking or rest < -50.0 for rest, braking in begins), begins
