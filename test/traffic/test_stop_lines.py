# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""No agent drives over a stop line at red, whatever the movement and the light."""

from pathlib import Path
from typing import NamedTuple

from commonroad.scenario.intersection import Intersection, IntersectionIncomingElement
from commonroad.scenario.lanelet import LineMarking, StopLine
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_light import (
    TrafficLight,
    TrafficLightCycle,
    TrafficLightCycleElement,
    TrafficLightDirection,
    TrafficLightState,
)
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.traffic.crossing.stop_lines import StopLines
from crgame_ros.traffic.following.leaders import Ways
from crgame_ros.traffic.lanes.lane_graph import LaneGraph
from crgame_ros.traffic.lanes.movements import Movements
import numpy as np
import pytest
import shapely
import traffic_support as support

SHARED = Path(__file__).resolve().parents[3] / 'shared' / 'scenarios'
RED = (TrafficLightState.RED, TrafficLightState.RED_YELLOW)


class Crossing(NamedTuple):
    """A front that crosses a stop line; for how many steps a light of its way has been red."""

    movement: str
    k: int
    red: int


def crossings(scenario: Scenario, run: support.Run) -> list[Crossing]:
    """
    Find the agents that crossed stop lines, and their movements, by the file and shapely alone.

    The movement is that of the file's successor whose area the front gets into next.
    """
    roads = scenario.lanelet_network
    named = {lanelet: [(movement, i) for movement in ('left', 'straight', 'right')
                       for i in getattr(incoming, f'successors_{movement}')]
             for intersection in roads.intersections for incoming in intersection.incomings
             for lanelet in incoming.incoming_lanelets}
    poses = np.array(run.poses)
    half = 0.5 * np.array([x.shape.length for x in run.descriptions])
    front = poses[:, :, :2] + half[:, None] * np.stack(
        (np.cos(poses[:, :, 2]), np.sin(poses[:, :, 2])), axis=-1)
    found = []
    for lanelet, ways in named.items():
        line = roads.find_lanelet_by_id(lanelet).stop_line
        segment = shapely.LineString([line.start, line.end])
        areas = [(movement, roads.find_lanelet_by_id(i).polygon.shapely_object)
                 for movement, i in ways]
        lights = [roads.find_traffic_light_by_id(i) for i in sorted(line.traffic_light_ref)]
        for k, slot in zip(*np.nonzero(np.isfinite(front[1:, :, 0])
                                       & np.isfinite(front[:-1, :, 0])), strict=True):
            if not shapely.LineString(front[k:k + 2, slot]).intersects(segment):
                continue
            later = front[k + 1:k + 41, slot]
            if np.isfinite(later[:, 0]).sum() < 2:
                continue
            later = shapely.LineString(later[np.isfinite(later[:, 0])])
            movement = max(areas, key=lambda x: x[1].intersection(later).length)[0]
            governing = [x for x in lights if x.direction is TrafficLightDirection.ALL
                         or movement in x.direction.value.lower()]
            red = max((_red_since(x, int(k)) for x in governing), default=0)
            found.append(Crossing(movement, int(k), red))
    return found


def _red_since(light: TrafficLight, k: int) -> int:
    since = 0
    while light.get_state_at_time_step(k - since) in RED and since < 1000:
        since += 1
    return since


@pytest.mark.exhaustive
def test_no_agent_crosses_on_red_where_left_turns_begin_straight() -> None:
    path = SHARED / 'USA_Lanker-1_3_T-1.xml'
    scenario = load_scenario(path).scenario
    run = support.Run(path, TrafficSpec(agents=50, flow=400.0), 0).ticks(1200)
    # Agents too near to halt for a red light when the run begins don't count.
    found = [x for x in crossings(scenario, run) if x.k > 20]
    by_movement = {m: sum(x.movement == m for x in found) for m in ('left', 'straight', 'right')}
    # In two minutes the lights of left turns are green for 17 + 12 s, twice those of most others.
    assert min(by_movement.values()) >= 8, by_movement
    assert [x for x in found if x.red] == []


def arc(angle: float) -> list[tuple[float, float]]:
    """Make a quarter turn from (112, 0) on, to the left for a positive angle."""
    sign = np.sign(angle)
    return [(112.0 + 12.0 * np.sin(a), sign * 12.0 * (1.0 - np.cos(a)))
            for a in np.linspace(0.0, abs(angle), 20)]


def fork(*lights: TrafficLight, on: int = 1, names: dict[str, set[int]] | None = None,
         line: bool = False) -> tuple[LaneGraph, Scenario]:
    """
    Make a road 1, 2 that is shared up to x = 112 and then goes on straight 3, left 4 or right 5.

    :param on: lanelet with the lights.
    :param names: successors of an intersection element for incoming lanelet 1.
    :param line: whether that lanelet has a stop line that alone refers to the lights.
    """
    ids = {light.traffic_light_id for light in lights}
    stop = StopLine(np.array([90.0, 1.75]), np.array([90.0, -1.75]), LineMarking.SOLID, set(), ids)
    lanes = [support.straight_lane(1, 0.0, 0.0, 100.0, successor=[2],
                                   **({'stop_line': stop} if line else {})),
             support.straight_lane(2, 0.0, 100.0, 112.0, predecessor=[1], successor=[3, 4, 5]),
             support.straight_lane(3, 0.0, 112.0, 130.0, predecessor=[2], successor=[6]),
             support.lane_strip(4, arc(0.5 * np.pi), predecessor=[2], successor=[7]),
             support.lane_strip(5, arc(-0.5 * np.pi), predecessor=[2], successor=[8]),
             support.straight_lane(6, 0.0, 130.0, 230.0, predecessor=[3]),
             support.lane_strip(7, [(124.0, y) for y in np.linspace(12.0, 112.0, 30)],
                                predecessor=[4]),
             support.lane_strip(8, [(124.0, -y) for y in np.linspace(12.0, 112.0, 30)],
                                predecessor=[5])]
    scenario = support.roads(*lanes)
    for light in lights:
        scenario.add_objects(light, set() if line else {on})
    if names is not None:
        scenario.add_objects(Intersection(900, [IntersectionIncomingElement(
            901, {1}, **{f'successors_{key}': value for key, value in names.items()})]))
    return LaneGraph(RoadNetwork(scenario.lanelet_network)), scenario


def light(number: int, direction: TrafficLightDirection | None = None) -> TrafficLight:
    return TrafficLight(number, np.array([100.0, 3.0]), TrafficLightCycle(
        [TrafficLightCycleElement(TrafficLightState.RED, 10)]), direction=direction)


def halt(graph: LaneGraph, scenario: Scenario, shown: dict[int, str], ids: list[int],
         speed: float = 8.0, stops: bool = False) -> float:
    """Return where an agent of 4 m, with its centre at x = 50 on lanelets by id, has to halt."""
    lines = StopLines(graph, scenario.lanelet_network, Movements(graph), 0.1)
    lines.show(0, shown)
    lanes = np.array([[graph.index[i] for i in ids]])
    offset = np.cumsum(np.concatenate(([[-50.0]], graph.length[lanes[:, :-1]]), axis=1), axis=1)
    way = Ways(lanes, offset, (lanes >= 0).sum(axis=1), np.array([200.0]))
    found = lines.halts(way, np.array([speed]), np.array([4.0]), np.array([stops]))
    return round(float(found[0]), 2)


SHARED_FIRST = {'straight': {2}, 'left': {2}, 'right': {2}}


@pytest.mark.parametrize('names', [None, SHARED_FIRST, {'straight': {2}}, {}], ids=str)
def test_the_way_decides_where_movements_share_their_first_lanelet(
        names: dict[str, set[int]] | None) -> None:
    graph, scenario = fork(light(50, TrafficLightDirection.LEFT),
                           light(51, TrafficLightDirection.STRAIGHT_RIGHT), names=names)
    red_left, red_others = {50: 'red', 51: 'green'}, {50: 'green', 51: 'red'}
    # The light is at the end of lanelet 1, 48 m before a front at x = 52.
    for ids, left, others in (([1, 2, 4, 7], 48.0, np.inf), ([1, 2, 3, 6], np.inf, 48.0),
                              ([1, 2, 5, 8], np.inf, 48.0)):
        assert halt(graph, scenario, red_left, ids) == left, ids
        assert halt(graph, scenario, red_others, ids) == others, ids
    # An agent that doesn't see that far yet halts for either.
    assert halt(graph, scenario, red_left, [1, 2]) == halt(graph, scenario, red_others, [1, 2])


def test_the_names_of_the_file_go_before_the_geometry() -> None:
    # A "straight on" that bends by 90 degrees is what its arrow is for, at T-junctions.
    graph, scenario = fork(light(50, TrafficLightDirection.STRAIGHT),
                           light(51, TrafficLightDirection.RIGHT), on=2)
    scenario.add_objects(Intersection(900, [IntersectionIncomingElement(
        901, {2}, successors_straight={4}, successors_right={5}, successors_left={3})]))
    for ids, movement in (([1, 2, 4, 7], 50), ([1, 2, 5, 8], 51)):
        assert halt(graph, scenario, {50: 'green', 51: 'green', movement: 'red'}, ids) == 60.0
        assert halt(graph, scenario, {50: 'red', 51: 'red', movement: 'green'}, ids) == np.inf


@pytest.mark.parametrize(('own', 'waits'), [
    # The light for all movements is red from 30 to 100. An arrow that is green or inactive
    # meanwhile frees no agent, except one that could otherwise never go.
    (((TrafficLightState.GREEN, 60), (TrafficLightState.INACTIVE, 40)), True),
    (((TrafficLightState.RED, 20), (TrafficLightState.GREEN, 80)), True),
    (((TrafficLightState.RED, 40), (TrafficLightState.GREEN, 60)), False)], ids=str)
def test_a_green_arrow_frees_only_agents_that_would_wait_for_ever(
        own: tuple[tuple[TrafficLightState, int], ...], waits: bool) -> None:
    everybody, arrow = light(50), light(51, TrafficLightDirection.LEFT)
    everybody.traffic_light_cycle = TrafficLightCycle([
        TrafficLightCycleElement(TrafficLightState.GREEN, 30),
        TrafficLightCycleElement(TrafficLightState.RED, 70)], time_offset=100)
    arrow.traffic_light_cycle = TrafficLightCycle([TrafficLightCycleElement(*x) for x in own])
    graph, scenario = fork(everybody, arrow, names=SHARED_FIRST)
    assert halt(graph, scenario, {50: 'red', 51: 'green'}, [1, 2, 4, 7]) == (
        48.0 if waits else np.inf)
    assert halt(graph, scenario, {50: 'green', 51: 'red'}, [1, 2, 4, 7]) == 48.0
    assert halt(graph, scenario, {50: 'red', 51: 'green'}, [1, 2, 3, 6]) == 48.0


@pytest.mark.parametrize(('shown', 'speed', 'stops', 'halts'), [
    ('red', 8.0, False, True), ('redYellow', 8.0, False, True), ('yellow', 8.0, False, True),
    ('green', 8.0, False, False), ('inactive', 8.0, False, False),
    # v^2 / (2 d) over 48 m: 3.3 m/s^2 is hard for yellow unless it stops already, 6.5 for red.
    ('yellow', 18.0, False, False), ('yellow', 18.0, True, True), ('yellow', 20.0, True, False),
    ('red', 19.5, False, True), ('red', 20.5, False, False), ('red', 20.5, True, True),
    ('red', 27.0, True, False),
])
def test_a_light_without_arrows_is_for_everybody(shown: str, speed: float, stops: bool,
                                                 halts: bool) -> None:
    for direction in (None, TrafficLightDirection.ALL):
        graph, scenario = fork(light(50, direction))
        for ids in ([1, 2, 3, 6], [1, 2, 4, 7], [1, 2, 5, 8], [1, 2]):
            assert halt(graph, scenario, {50: shown}, ids, speed, stops) == (
                48.0 if halts else np.inf)


def test_lights_count_where_their_lanelet_or_stop_line_has_them() -> None:
    red, way = {50: 'red'}, [1, 2, 3, 6]
    assert halt(*fork(light(50), line=True), red, way) == 38.0, 'at the stop line, x = 90'
    assert halt(*fork(light(50), on=2), red, way) == 60.0, 'at the end of lanelet 2, x = 112'
    # With the light on a junction's first lanelet agents halt before it, not at its far side.
    first = fork(light(50), on=3, names={'straight': {3}})
    first[1].lanelet_network.intersections[0].incomings[0].incoming_lanelets = {2}
    assert halt(LaneGraph(RoadNetwork(first[1].lanelet_network)), first[1], red, way) == 60.0


def test_a_light_far_before_a_junction_is_not_of_it() -> None:
    graph, scenario = fork(light(50, TrafficLightDirection.LEFT), names=SHARED_FIRST)
    roads = scenario.lanelet_network
    # Lanelet 9 ends 100 m before the one that the intersection has as its incoming.
    scenario.add_objects(support.straight_lane(9, 0.0, -50.0, 0.0, successor=[1]))
    roads.find_lanelet_by_id(1).predecessor = [9]
    scenario.add_objects(light(51, TrafficLightDirection.LEFT), {9})
    graph = LaneGraph(RoadNetwork(roads))
    lines = StopLines(graph, roads, Movements(graph), 0.1)
    decided = lines.movement[lines.number[[graph.index[9], graph.index[1]]]]
    assert not decided[0].any()
    assert sorted(decided[1].tolist()) == [0, 0, 0, 1, 1, 2, 2, 3, 3]
