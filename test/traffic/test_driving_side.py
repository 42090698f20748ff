# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Left-hand traffic: agents drive a mirrored map as the mirror image, by the mirrored rules."""

from pathlib import Path

from commonroad.scenario.intersection import Intersection, IntersectionIncomingElement
from commonroad.scenario.lanelet import Lanelet, StopLine
from commonroad.scenario.scenario import Scenario
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.traffic.lanes.conflicts import Conflicts
from crgame_ros.traffic.lanes.lane_graph import (
    driving_side,
    LaneGraph,
    LEFT_HAND,
    PRIORITY_TO_THE_RIGHT,
)
import numpy as np
import pytest
import traffic_support as support

FLIP = np.array([1.0, -1.0])


def mirrored(scenario: Scenario, signs: bool = True) -> Scenario:
    """Mirror roads at the x axis, so that left is right; without signs and lines if asked."""
    result = Scenario(scenario.dt)
    for lane in scenario.lanelet_network.lanelets:
        line = lane.stop_line
        result.add_objects(Lanelet(
            lane.right_vertices[:, :2] * FLIP, lane.center_vertices[:, :2] * FLIP,
            lane.left_vertices[:, :2] * FLIP, lane.lanelet_id, lane.predecessor, lane.successor,
            lane.adj_right, lane.adj_right_same_direction, lane.adj_left,
            lane.adj_left_same_direction,
            stop_line=None if line is None or not signs else StopLine(
                line.start * FLIP, line.end * FLIP, line.line_marking, line.traffic_sign_ref,
                line.traffic_light_ref), lanelet_type=lane.lanelet_type))
    for sign in scenario.lanelet_network.traffic_signs if signs else ():
        result.add_objects(sign, {x.lanelet_id for x in scenario.lanelet_network.lanelets
                                  if sign.traffic_sign_id in x.traffic_signs})
    for crossing in scenario.lanelet_network.intersections:
        result.add_objects(Intersection(crossing.intersection_id, [IntersectionIncomingElement(
            x.incoming_id, x.incoming_lanelets, x.successors_left, x.successors_straight,
            x.successors_right) for x in crossing.incomings]))
    return result


def priorities(scenario: Scenario) -> dict[tuple[int, int], int]:
    graph = LaneGraph(RoadNetwork(scenario.lanelet_network))
    conflicts = Conflicts(graph, side=driving_side(scenario))
    return {(graph.ids[conflicts.lane[i]], graph.ids[conflicts.lane[conflicts.other[i]]]):
            int(conflicts.priority[i]) for i in range(len(conflicts))}


@pytest.mark.slow
@pytest.mark.parametrize('signs', [True, False])
@pytest.mark.parametrize('name', ['ZAM_Intersection-1_1_T-1.xml', 'ZAM_TJunction-1_1_T-1.xml'])
def test_a_mirrored_junction_has_the_same_priorities(maps: Path, name: str, signs: bool) -> None:
    original = load_scenario(maps / name).scenario
    right = priorities(mirrored(mirrored(original, signs)))
    image = mirrored(original, signs)
    assert not driving_side(original).keeps_left and driving_side(image).keeps_left
    left = priorities(image)
    assert left == right and {-1, 1} <= set(left.values())
    # With driving on the right some lanelets would have to yield that must not.
    graph = LaneGraph(RoadNetwork(image.lanelet_network))
    as_right = Conflicts(graph)
    wrong = sum(left[graph.ids[a], graph.ids[as_right.lane[b]]] != p for a, b, p in zip(
        as_right.lane, as_right.other, as_right.priority, strict=True))
    assert wrong >= 4


def crossing() -> Scenario:
    return support.roads(
        support.straight_lane(1, 0.0, -100.0, 100.0),
        support.lane_strip(2, [(0.0, y) for y in np.linspace(-100.0, 100.0, 60)]))


@pytest.mark.parametrize(('country', 'right_first'), [
    ('DEU', True), ('ZAM', True), ('GBR', False), ('JPN', False), ('ZAF', False), ('AUS', True),
    ('IND', True)])
def test_without_signs_and_neighbours_the_country_decides(country: str, right_first: bool) -> None:
    scenario = crossing()
    scenario.scenario_id.country_id = country
    side = driving_side(scenario)
    assert side.keeps_left is (country not in ('DEU', 'ZAM'))
    # Lanelet 2 leads north. Its traffic comes from the right of vehicles that drive east.
    assert priorities(scenario)[2, 1] == (1 if right_first else -1)


def test_the_lanes_go_before_the_country(maps: Path) -> None:
    scenario = load_scenario(maps / 'ZAM_Intersection-1_1_T-1.xml').scenario
    scenario.scenario_id.country_id = 'GBR'
    assert not driving_side(scenario).keeps_left
    image = mirrored(scenario)
    image.scenario_id.country_id = 'DEU'
    assert driving_side(image) == (True, True)


def test_the_countries_are_codes() -> None:
    assert all(len(code) == 3 and code.isupper() for code in LEFT_HAND)
    assert PRIORITY_TO_THE_RIGHT < LEFT_HAND
    assert not LEFT_HAND & {'ZAM', 'DEU', 'USA', 'CHN', 'FRA', 'GIB', 'SWE', 'MMR'}


def test_a_mirrored_scene_is_driven_as_the_mirror_image(maps: Path) -> None:
    """Three meet on unsigned roads: one turns across, one is oncoming, one is from the side."""
    original = load_scenario(maps / 'ZAM_Intersection-1_1_T-1.xml').scenario
    found = []
    for flip in (1.0, -1.0):
        scenario = mirrored(original, signs=False)
        scenario = scenario if flip < 0.0 else mirrored(scenario)
        roads = RoadNetwork(scenario.lanelet_network)
        agents = []
        for number, (start, goal, away) in enumerate(((11, 42, 60.0), (31, 12, 62.0),
                                                      (21, 42, 61.0))):
            poses = [roads.pose_on(start, roads.line(start).length - away),
                     roads.pose_on(goal, 50.0)]
            agents.append(support.driving(number, poses, 11.0))
        run = support.Run(scenario, TrafficSpec(), 0, (), agents).ticks(250)
        assert run.overlaps() == []
        poses = np.array(run.poses)
        found.append(np.stack((poses[..., 0], flip * poses[..., 1], np.cos(poses[..., 2]),
                               flip * np.sin(poses[..., 2])), axis=-1))
    assert np.nanmax(np.abs(found[0][..., 1])) > 50.0
    np.testing.assert_allclose(found[0], found[1], atol=1e-6)


@pytest.mark.parametrize('keeps_left', [False, True])
def test_between_equal_sides_a_swerve_takes_the_middle_of_the_road(keeps_left: bool) -> None:
    scenario = support.roads(support.straight_lane(1, 0.0, 0.0, 300.0, width=9.0))
    scenario.scenario_id.country_id = 'GBR' if keeps_left else 'DEU'
    post = support.human(150.0, 0.0, 0.0, kind='parkedVehicle', shape=Shape.rectangle(1.0, 1.0))
    run = support.Run(scenario, TrafficSpec(), 0, [post], [
        support.driving(1, [(20.0, 0.0, 0.0), (290.0, 0.0, 0.0)], 10.0)]).ticks(200)
    y = run.series(0)[0][:, 1]
    assert (np.nanmin(y) < -1.0, np.nanmax(y) > 1.0) == (keeps_left, not keeps_left)
