# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Crossings: right of way, gaps, red lights, and no agent waits for ever."""

from pathlib import Path

from commonroad.scenario.lanelet import LineMarking, StopLine
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_light import (
    TrafficLight,
    TrafficLightCycle,
    TrafficLightCycleElement,
    TrafficLightState,
)
from commonroad.scenario.traffic_sign import TrafficSign, TrafficSignElement, TrafficSignIDGermany
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.traffic.fleet.adoption import Adopted
import numpy as np
import pytest
import traffic_support as support

NAME = 'ZAM_Intersection-1_1_T-1.xml'
MOUTH = 18.0


def network(maps: Path) -> RoadNetwork:
    return RoadNetwork(load_scenario(maps / NAME).scenario.lanelet_network)


def coming(roads: RoadNetwork, number: int, start: int, goal: int, away: float,
           speed: float) -> Adopted:
    """Make an agent that comes along a lanelet and is this far from its end."""
    s = roads.line(start).length - away
    return support.driving(number, [roads.pose_on(start, s), roads.pose_on(goal, 50.0)], speed)


def passes_origin(poses: np.ndarray) -> int:
    """Return the tick at which a vehicle is nearest to the middle of the junction."""
    return int(np.nanargmin(np.hypot(poses[:, 0], poses[:, 1])))


def test_the_yielding_road_waits_for_the_priority_road(maps: Path) -> None:
    roads = network(maps)
    # Both would be in the middle after 6 s.
    run = support.Run(maps / NAME, TrafficSpec(), 0, (), [
        coming(roads, 1, 11, 32, 65.0, 13.0), coming(roads, 2, 21, 42, 62.0, 12.0)]).ticks(300)
    (major, fast), (minor, slow) = run.series(0), run.series(1)
    assert run.overlaps() == []
    assert np.nanmin(fast[:60]) > 11.0, 'who has the right of way just drives'
    assert np.nanmin(slow[:120]) < 8.0
    assert passes_origin(major) < passes_origin(minor)


def test_it_goes_first_if_the_gap_is_long_enough(maps: Path) -> None:
    roads = network(maps)
    run = support.Run(maps / NAME, TrafficSpec(), 0, (), [
        coming(roads, 1, 11, 32, 250.0, 13.0), coming(roads, 2, 21, 42, 30.0, 8.0)]).ticks(200)
    major, minor = run.series(0)[0], run.series(1)[0]
    assert passes_origin(minor) < passes_origin(major)
    assert run.overlaps() == []
    assert np.nanmin(run.series(0)[1]) > 11.0


@pytest.mark.parametrize('room', [1.3, 1.0])
def test_who_stopped_a_little_too_late_waits_all_the_same(maps: Path, room: float) -> None:
    """Its front stands in the conflict, but the vehicle with the right of way can pass."""
    roads = network(maps)
    x, _, yaw = roads.pose_on(21, roads.line(21).length)
    # The other one drives along y = -1.75.
    y = -1.75 - 0.5 * support.CAR.width - room - 0.5 * support.CAR.length
    run = support.Run(maps / NAME, TrafficSpec(), 0, (), [
        coming(roads, 1, 11, 32, 25.0, 13.0),
        support.driving(2, [(x, y, yaw), roads.pose_on(42, 50.0)], 0.0)]).ticks(120)
    (major, fast), (minor, _) = run.series(0), run.series(1)
    passed = int(np.nanargmax(major[:, 0] > x + 4.0))
    assert np.nanmin(fast[:passed]) > 12.0
    assert np.hypot(*(minor[passed] - minor[0])[:2]) < 0.5
    assert minor[-1, 1] > minor[0, 1] + 5.0 and run.overlaps() == []


def test_agents_yield_to_a_human_on_the_priority_road(maps: Path) -> None:
    roads = network(maps)
    human = support.human(-90.0, -1.75, 0.0, 13.0)
    run = support.Run(maps / NAME, TrafficSpec(), 0, [human], [
        coming(roads, 2, 21, 42, 62.0, 12.0)]).ticks(250)
    poses, speeds = run.series(0)
    assert run.overlaps() == []
    # The human is in the middle after 7 s.
    assert passes_origin(poses) > 70
    assert np.nanmin(speeds[:100]) < 8.0


def test_agents_stop_for_a_human_that_ignores_the_right_of_way(maps: Path) -> None:
    roads = network(maps)
    human = support.human(1.75, -75.0, 0.5 * np.pi, 13.0)
    run = support.Run(maps / NAME, TrafficSpec(), 0, [human], [
        coming(roads, 1, 11, 32, 62.0, 13.0)]).ticks(150)
    assert run.overlaps() == []
    assert np.nanmin(run.series(0)[1][:90]) < 10.0


@pytest.mark.parametrize('goal', [12, 22])
def test_the_left_turn_waits_for_oncoming_traffic(maps: Path, goal: int) -> None:
    roads = network(maps)
    # Lanelet 15 turns left from arm 1 to arm 4, against 34 to arm 1 and 33 (left) to arm 2.
    run = support.Run(maps / NAME, TrafficSpec(), 0, (), [
        coming(roads, 1, 11, 42, 60.0, 11.0), coming(roads, 2, 31, goal, 62.0, 12.0)]).ticks(300)
    assert run.overlaps() == []
    left, straight = run.series(0)[0], run.series(1)[0]
    if goal == 12:
        assert passes_origin(straight) < passes_origin(left)


def test_four_agents_that_arrive_at_once_without_signs_all_get_through() -> None:
    lines = {i: [(-1.75 * np.sin(a) * 0.0 + np.cos(a) * r + 1.75 * np.sin(a),
                  np.sin(a) * r - 1.75 * np.cos(a)) for r in np.linspace(-120.0, 120.0, 97)]
             for i, a in enumerate(np.arange(4) * 0.5 * np.pi)}
    scenario = support.roads(*(support.lane_strip(i + 1, line) for i, line in lines.items()))
    agents = [support.driving(i, [(*line[20], i * 0.5 * np.pi), (*line[90], i * 0.5 * np.pi)],
                              8.0) for i, line in lines.items()]
    run = support.Run(scenario, TrafficSpec(), 0, (), agents).ticks(700)
    assert run.overlaps() == []
    assert np.isnan(run.poses[-1]).all(), 'all have left the map'


def lane_with_a_light(cycle: tuple[tuple[TrafficLightState, int], ...],
                      at: float = 100.0) -> Scenario:
    line = StopLine(np.array([at, 1.75]), np.array([at, -1.75]), LineMarking.SOLID, set(), {50})
    scenario = support.roads(
        support.straight_lane(1, 0.0, 0.0, at, successor=[2], stop_line=line),
        support.straight_lane(2, 0.0, at, 300.0, predecessor=[1]))
    light = TrafficLight(50, np.array([at, 3.0]), TrafficLightCycle(
        [TrafficLightCycleElement(*part) for part in cycle]))
    scenario.add_objects(light, {1})
    return scenario


def one(speed: float = 10.0) -> list[Adopted]:
    return [support.driving(1, [(20.0, 0.0, 0.0), (290.0, 0.0, 0.0)], speed)]


def test_a_red_light_holds_until_it_is_green() -> None:
    scenario = lane_with_a_light(((TrafficLightState.RED, 250), (TrafficLightState.GREEN, 1000)))
    run = support.Run(scenario, TrafficSpec(), 0, (), one()).ticks(400)
    poses, speeds = run.series(0)
    front = poses[249, 0] + 2.25
    assert speeds[249] == 0.0 and 98.0 < front <= 100.0
    assert np.isnan(poses[-1, 0]) or poses[-1, 0] > 150.0


@pytest.mark.parametrize('line', [118.2, 118.5])
@pytest.mark.parametrize('green', [8, 17])
def test_an_agent_at_a_red_light_close_to_a_crossing_lane_lets_others_pass(
        line: float, green: int) -> None:
    """Its front takes up the room between vehicles, but the crossing lane itself is free."""
    scenario = lane_with_a_light(((TrafficLightState.GREEN, green), (TrafficLightState.YELLOW, 3),
                                  (TrafficLightState.RED, 2000)), line)
    scenario.add_objects(support.lane_strip(
        3, [(line + 1.8, y) for y in np.linspace(-100.0, 100.0, 80)]))
    run = support.Run(scenario, TrafficSpec(), 0, (), [
        support.driving(1, [(line - 8.0, 0.0, 0.0), (290.0, 0.0, 0.0)], 0.0),
        support.driving(2, [(line + 1.8, -60.0, np.pi / 2), (line + 1.8, 90.0, np.pi / 2)],
                        8.0)]).ticks(400)
    assert line - 2.0 < run.series(0)[0][-1, 0] + 2.25 < line
    assert np.isnan(run.series(1)[0][-1]).all()
    assert run.overlaps() == []


def test_at_a_light_that_turns_yellow_an_agent_stops_unless_it_has_to_brake_hard() -> None:
    taken = set()
    for green in range(5, 60, 3):
        scenario = lane_with_a_light(((TrafficLightState.GREEN, green),
                                      (TrafficLightState.YELLOW, 3),
                                      (TrafficLightState.RED, 1000)))
        run = support.Run(scenario, TrafficSpec(), 0, (), [support.driving(
            1, [(88.0, 0.0, 0.0), (190.0, 0.0, 0.0)], 0.0)]).ticks(green + 60)
        poses, speeds = run.series(0)
        left = 100.0 - (poses[green, 0] + 2.25)
        stops = bool(poses[-1, 0] + 2.25 < 100.2)
        if left > 0.1 and speeds[green] ** 2 / (2.0 * left) < 2.8:
            assert stops, (green, speeds[green], left)
        taken.add(stops)
    assert taken == {False, True}


def test_an_agent_sets_off_a_moment_after_green() -> None:
    """Highway Capacity Manual: the first of a queue loses about 2 s."""
    scenario = lane_with_a_light(((TrafficLightState.RED, 250), (TrafficLightState.GREEN, 1000)))
    poses, speeds = support.Run(scenario, TrafficSpec(), 0, (), one()).ticks(300).series(0)
    assert not speeds[220:250 + 11].any()
    over = int(np.argmax(poses[:, 0] + 2.25 > 100.0))
    assert 250 + 14 <= over <= 250 + 22


def lit_crossing(green: int) -> Scenario:
    """Make a crossing: the lights of east and west are green first, those of the others red."""
    edge, lane = 12.0, 1.75
    turn = np.linspace(0.0, 0.5 * np.pi, 20)
    radius = edge + lane
    lines = {
        1: [(-120.0, -lane), (-edge, -lane)],
        2: list(zip(radius * np.sin(turn) - edge, edge - radius * np.cos(turn), strict=True)),
        4: [(lane, edge), (lane, 120.0)], 5: [(150.0, lane), (edge, lane)],
        6: [(edge, lane), (-edge, lane)], 7: [(-edge, lane), (-120.0, lane)],
        8: [(lane, -120.0), (lane, -edge)], 9: [(lane, -edge), (lane, edge)],
        10: [(-lane, 120.0), (-lane, edge)], 11: [(-lane, edge), (-lane, -edge)],
        12: [(-lane, -edge), (-lane, -120.0)]}
    links = [(1, 2), (2, 4), (5, 6), (6, 7), (8, 9), (9, 4), (10, 11), (11, 12)]
    scenario = support.roads(*(support.lane_strip(
        number, [line[0] + (np.array(line[1]) - line[0]) * share for share in
                 np.linspace(0.0, 1.0, 20)] if len(line) == 2 else line,
        successor=[after for before, after in links if before == number],
        predecessor=[before for before, after in links if after == number])
        for number, line in lines.items()))
    for lanelet, open_first in ((1, True), (5, True), (8, False), (10, False)):
        end = scenario.lanelet_network.find_lanelet_by_id(lanelet)
        end.stop_line = StopLine(end.left_vertices[-1], end.right_vertices[-1], LineMarking.SOLID,
                                 set(), {50 + lanelet})
        first, then = TrafficLightState.GREEN, TrafficLightState.RED
        phases = ((first, green), (TrafficLightState.YELLOW, 30), (then, 1000)) if open_first \
            else ((then, green + 60), (first, 1000))
        scenario.add_objects(TrafficLight(
            50 + lanelet, end.center_vertices[-1], TrafficLightCycle(
                [TrafficLightCycleElement(*phase) for phase in phases])), {lanelet})
    return scenario


def test_a_left_turn_waits_in_the_middle_and_leaves_with_the_change() -> None:
    """Against a stream without a gap, its front is beyond its line and the held cross traffic."""
    green = 300
    # Every 22 m; those that begin beyond the road come to its start later, with 1 m a tick.
    oncoming = [support.driving(number, [(min(away, 140.0), 1.75, np.pi), (-100.0, 1.75, np.pi)],
                                10.0, first_k=max(round(away - 140.0), 0))
                for number, away in enumerate(np.arange(20.0, 380.0, 22.0).tolist(), 2)]
    agent = support.driving(1, [(-80.0, -1.75, 0.0), (1.75, 100.0, 0.5 * np.pi)], 10.0,
                            first_k=10)
    held = support.driving(50, [(1.75, -40.0, 0.5 * np.pi), (1.75, 100.0, 0.5 * np.pi)], 8.0)
    run = support.Run(lit_crossing(green), TrafficSpec(), 0, (),
                      [agent, *oncoming, held]).ticks(500)
    assert run.overlaps() == []
    poses, speeds = run.series(0)
    stood = np.flatnonzero(speeds[:green] < 0.05)
    assert len(stood) > 50
    place = poses[stood[-1]]
    front = place[:2] + 2.25 * np.array((np.cos(place[2]), np.sin(place[2])))
    assert front[0] > -12.0 + 3.0 and front[1] < 0.0
    # It leaves as soon as the last oncoming vehicle stops, and the cross traffic lets it.
    assert np.nanmax(poses[:green + 110, 1]) > 12.0
    others = np.array(run.poses)[:, -1]
    assert others[green + 60, 1] < -12.0 and np.nanmax(others[:, 1]) > 20.0


def test_a_green_light_holds_no_agent() -> None:
    run = support.Run(lane_with_a_light(((TrafficLightState.GREEN, 1000),)), TrafficSpec(), 0,
                      (), one()).ticks(120)
    assert np.nanmin(run.series(0)[1]) > 9.5


def test_a_stop_sign_makes_everybody_stand_once() -> None:
    line = StopLine(np.array([98.0, 1.75]), np.array([98.0, -1.75]), LineMarking.SOLID, {60},
                    set())
    scenario = support.roads(
        support.straight_lane(1, 0.0, 0.0, 100.0, successor=[2], stop_line=line),
        support.straight_lane(2, 0.0, 100.0, 300.0, predecessor=[1]),
        support.lane_strip(3, [(150.0, y) for y in np.linspace(-100.0, 100.0, 80)]))
    sign = TrafficSign(60, [TrafficSignElement(TrafficSignIDGermany.STOP)], {1},
                       np.array([98.0, -3.0]))
    scenario.add_objects(sign, {1})
    run = support.Run(scenario, TrafficSpec(), 0, (), one()).ticks(500)
    poses, speeds = run.series(0)
    stood = np.flatnonzero(speeds < 0.05)
    assert len(stood) and (speeds < 0.3).sum() > 10
    assert 95.0 < poses[stood[0], 0] + 2.25 <= 98.2
    assert np.nanmax(poses[:, 0]) > 200.0


@pytest.mark.parametrize('where', ['no line', 'in the junction'])
def test_a_stop_sign_counts_without_a_line_and_on_the_junctions_own_lane(where: str) -> None:
    """It holds at the end of its lane, or at a line 2 m behind the beginning of the junction."""
    line = StopLine(np.array([102.0, 1.75]), np.array([102.0, -1.75]), LineMarking.SOLID, {60},
                    set())
    inside = where == 'in the junction'
    scenario = support.roads(
        support.straight_lane(1, 0.0, 0.0, 100.0, successor=[2]),
        support.straight_lane(2, 0.0, 100.0, 300.0, predecessor=[1],
                              stop_line=line if inside else None),
        support.lane_strip(3, [(110.0, y) for y in np.linspace(-100.0, 100.0, 80)]))
    sign = TrafficSign(60, [TrafficSignElement(TrafficSignIDGermany.STOP)], {2 if inside else 1},
                       np.array([98.0, -3.0]))
    scenario.add_objects(sign, {2 if inside else 1})
    run = support.Run(scenario, TrafficSpec(), 0, (), one()).ticks(500)
    poses, speeds = run.series(0)
    stood = np.flatnonzero(speeds < 0.05)
    at = 102.0 if inside else 100.0
    assert len(stood) and at - 3.0 < poses[stood[0], 0] + 2.25 <= at + 0.2
    assert np.nanmax(poses[:, 0]) > 200.0


def test_no_agent_blocks_a_junction_behind_which_there_is_no_room() -> None:
    scenario = support.roads(
        support.straight_lane(1, 0.0, 0.0, 200.0),
        support.lane_strip(2, [(120.0, y) for y in np.linspace(-100.0, 100.0, 80)]))
    human = support.human(128.0, 0.0, 0.0)
    run = support.Run(scenario, TrafficSpec(), 0, [human], [
        support.driving(1, [(20.0, 0.0, 0.0), (190.0, 0.0, 0.0)], 10.0)]).ticks(300)
    poses, speeds = run.series(0)
    # It would fit behind the human with its rear on the other lane.
    assert speeds[-1] == 0.0 and poses[-1, 0] + 2.25 < 118.25


def test_an_agent_that_was_let_in_waits_if_the_room_behind_the_junction_is_gone() -> None:
    """Somebody ahead drives on, and at once stands behind the junction; braking is easy yet."""
    scenario = support.roads(
        support.straight_lane(1, 0.0, 0.0, 200.0),
        support.lane_strip(2, [(120.0, y) for y in np.linspace(-100.0, 100.0, 80)]))
    drives = support.human(60.0, 0.0, 0.0, speed=9.0, until=75)
    stands = support.human(127.5, 0.0, 0.0, since=75)
    run = support.Run(scenario, TrafficSpec(), 0, [drives, stands], [
        support.driving(1, [(20.0, 0.0, 0.0), (190.0, 0.0, 0.0)], 10.0)]).ticks(300)
    poses, speeds = run.series(0)
    assert 80.0 < poses[75, 0] < 100.0 and speeds[75] > 8.0
    assert speeds[-1] == 0.0 and poses[-1, 0] + 2.25 < 118.25


def test_an_agent_before_a_full_way_turns_off_after_a_while() -> None:
    left = [(100.0, 0.0), (104.0, 0.6), (107.0, 3.0), (108.5, 7.0), (108.5, 60.0)]
    scenario = support.roads(
        support.straight_lane(1, 0.0, 0.0, 100.0, successor=[2, 3]),
        support.straight_lane(2, 0.0, 100.0, 200.0, predecessor=[1]),
        support.lane_strip(3, left, predecessor=[1]),
        support.lane_strip(4, [(104.0, y) for y in np.linspace(-60.0, 60.0, 80)]))
    run = support.Run(scenario, TrafficSpec(), 0, [support.human(113.8, 0.0, 0.0)], [
        support.driving(1, [(60.0, 0.0, 0.0), (190.0, 0.0, 0.0)], 8.0)]).ticks(500)
    poses, speeds = run.series(0)
    stood = np.flatnonzero(speeds < 0.05)
    # For 15 s, before the junction.
    assert 145 < len(stood) < 165 and poses[stood[-1], 0] + 2.25 < 101.0
    assert np.nanmax(poses[:, 1]) > 30.0
    assert run.overlaps() == []


@pytest.mark.exhaustive
@pytest.mark.parametrize('name', ['ZAM_Intersection-1_1_T-1.xml', 'ZAM_TJunction-1_1_T-1.xml'])
def test_a_busy_junction_never_locks_up(maps: Path, name: str) -> None:
    run = support.Run(maps / name, TrafficSpec(agents=20, flow=300.0), 0).ticks(1800)
    speeds = np.array(run.speeds)
    for begin in range(0, 1800, 300):
        assert np.nanmean(speeds[begin:begin + 300]) > 3.0


def test_no_agent_stops_on_a_crossing_behind_a_leader_that_will_stop() -> None:
    """The leader still drives at the check, but halts before a junction that is taken."""
    roads = support.roads(
        support.straight_lane(1, 0.0, 0.0, 112.0, successor=[4]),
        support.straight_lane(4, 0.0, 112.0, 200.0, predecessor=[1]),
        support.lane_strip(2, [(100.0, -60.0), (100.0, 60.0)]),
        support.lane_strip(3, [(125.0, -60.0), (125.0, 60.0)]))
    # This vehicle stands across the second crossing.
    human = support.human(125.0, 0.0, np.pi / 2.0)
    run = support.Run(roads, TrafficSpec(), 0, [human], [
        support.driving(i, [(15.0 + 16.0 * i, 0.0, 0.0), (190.0, 0.0, 0.0)], 8.0)
        for i in range(5)]).ticks(400)
    last = run.poses[-1]
    assert (run.speeds[-1][np.isfinite(last[:, 0])] < 0.05).all()
    # The agents that fit in between are there; the others wait before the first crossing.
    inside = np.abs(last[:, 0] - 100.0) < 0.5 * (4.5 + 1.8)
    assert not inside.any()
    assert (last[:, 0] > 104.0).any()


def test_an_agent_that_has_just_begun_to_roll_halts_before_the_line() -> None:
    """However soon after green the light changes, who has not passed the line stays before it."""
    for green in range(12, 24):
        scenario = lane_with_a_light(((TrafficLightState.RED, 200),
                                      (TrafficLightState.GREEN, green),
                                      (TrafficLightState.YELLOW, 3),
                                      (TrafficLightState.RED, 1000)))
        poses, _ = support.Run(scenario, TrafficSpec(), 0, (), one()).ticks(300).series(0)
        fronts = poses[:, 0] + 2.25
        red = 200 + green + 3
        assert fronts[red] > 100.0 or np.nanmax(fronts[red:]) <= 100.0, green


@pytest.mark.parametrize('away', [70.0, 85.0, 100.0, 115.0])
def test_who_follows_an_agent_that_turns_into_its_lane_slows_down_in_time(away: float) -> None:
    """It foresees that the other comes out of a bend, and needs no hard braking behind it."""
    turn = np.linspace(0.0, 0.5 * np.pi, 20)
    side = [*((-9.0, y) for y in np.linspace(-80.0, -9.5, 30)),
            *zip(-9.0 * np.cos(turn), -9.0 + 9.0 * np.sin(turn), strict=True)]
    roads = support.roads(
        support.straight_lane(1, 0.0, -200.0, 0.0, successor=[3]),
        support.lane_strip(2, side, successor=[3]),
        support.straight_lane(3, 0.0, 0.0, 300.0, predecessor=[1, 2]))
    run = support.Run(roads, TrafficSpec(), 0, (), [
        support.driving(1, [(-away, 0.0, 0.0), (290.0, 0.0, 0.0)], 13.0),
        support.driving(2, [(-9.0, -35.0, np.pi / 2.0), (290.0, 0.0, 0.0)], 7.0)]).ticks(150)
    speeds = run.series(0)[1]
    assert run.overlaps() == []
    assert np.nanmin(np.diff(speeds)) / 0.1 > -2.5
