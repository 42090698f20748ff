# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which lanes are too tight for which vehicles; the judge's own area says what is on the road."""

from pathlib import Path

from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.traffic.following.tight_lanes import find_tight_lanes
from crgame_ros.traffic.lanes.lane_graph import LaneGraph
from crgame_ros.traffic.spawning import CAR, LARGE_CAR, trial_shapes, TRUCK
from judge.motion import off_road
from judge.roads import JudgedRoads
from judge.verdict import judge
import numpy as np
import pytest
from traffic_drive import drive
import traffic_support as support


def bend(radius: float, width: float) -> LaneGraph:
    """Make a straight lane, a bend of 90 degrees to the left and a straight lane behind it."""
    angle = np.linspace(0.0, np.pi / 2.0, 30)
    curve = [(40.0 + radius * np.sin(a), radius * (1.0 - np.cos(a))) for a in angle]
    end = curve[-1]
    return LaneGraph(RoadNetwork(support.roads(
        support.lane_strip(1, [(0.0, 0.0), (40.0, 0.0)], width, successor=[2]),
        support.lane_strip(2, curve, width, predecessor=[1], successor=[3]),
        support.lane_strip(3, [end, (end[0], end[1] + 40.0)], width,
                           predecessor=[2])).lanelet_network))


@pytest.mark.parametrize(('radius', 'width', 'truck', 'car'), [
    (3.0, 2.6, True, True), (3.0, 3.5, True, False), (9.0, 3.5, True, False),
    (25.0, 3.5, False, False)])
def test_a_bend_is_too_tight_where_the_swept_width_is_more_than_the_lane(
        radius: float, width: float, truck: bool, car: bool) -> None:
    # f^2 / (2 R) wider than the vehicle, f from rear axle to front: at 9 m a truck of 8 m takes
    # 4.5 m of a lane of 3.5 m, at 25 m 3.2 m; a car of 4.5 m takes 2.5 m at 9 m. It turns with
    # R = 3.2 m at most and takes 3.1 m then.
    graph = bend(radius, width)
    for_cars, for_trucks = find_tight_lanes(graph, [CAR], TRUCK)
    assert for_trucks[1] == truck
    assert for_cars[1] == car
    assert not for_cars[0]


def test_a_corner_at_the_end_of_a_long_narrow_lane_is_found() -> None:
    angle = np.linspace(0.0, np.pi / 2.0, 30)
    corner = [(400.0 + 3.0 * np.sin(a), 3.0 - 3.0 * np.cos(a)) for a in angle]
    graph = LaneGraph(RoadNetwork(support.roads(support.lane_strip(
        1, [*((x, 0.0) for x in np.arange(0.0, 400.0, 10.0)), *corner, (403.0, 40.0)], 2.35,
    )).lanelet_network))
    for_cars, _ = find_tight_lanes(graph, [CAR], TRUCK)
    assert for_cars.tolist() == [True]


def test_recorded_vehicles_of_any_shape_are_tried_as_boxes() -> None:
    shapes = [Shape.circle(3.5), Shape.rectangle(12.0, 2.5), Shape.rectangle(9.0, 2.5),
              Shape.rectangle(300.0, 2.5), Shape.rectangle(4.5, 1.8)]
    _, _, recorded = trial_shapes('car', [support.driving(
        i, [(10.0, 0.0, 0.0), (30.0, 0.0, 0.0)], 5.0, kind='bus', shape=shape)
        for i, shape in enumerate(shapes)])
    # The shortest and the longest, but what is longer than any vehicle.
    assert recorded == [Shape.rectangle(7.0, 7.0), Shape.rectangle(12.0, 2.5)]


def test_a_straight_lane_that_only_large_cars_are_tried_in_is_wide_enough() -> None:
    # 2.45 m: less room beside a car of 1.9 m than asked for without a trial, more beside 1.8 m.
    graph = LaneGraph(RoadNetwork(support.roads(support.lane_strip(
        1, [(0.0, 0.0), (80.0, 0.0)], width=2.45)).lanelet_network))
    for_cars, _ = find_tight_lanes(graph, [CAR, LARGE_CAR], TRUCK)
    assert not for_cars.any()


@pytest.mark.exhaustive
@pytest.mark.parametrize('seed', [3, 4])
def test_cars_stay_on_a_crossing_of_narrow_roads(seed: int, shared_scenarios: Path) -> None:
    """Lanes of 3 m whose right turns have an inner edge of 2 m: no two cars touch there either."""
    driven = drive(shared_scenarios / 'cases' / 'USA_Test4WayStopIntersection-1_1_T.1.xml',
                   TrafficSpec(agents=50, flow=600.0), 120.0, seed, False)
    roads = JudgedRoads(driven.scenario.scenario.lanelet_network)
    found = judge(driven.history, roads, driven.recording)
    assert [x for x in found.events if x.what in ('off road', 'overlap')] == []
    assert found.left > 30


@pytest.mark.exhaustive
@pytest.mark.parametrize('name', ['more/DEU_Moelln-10_2_T-1', 'more/BEL_Putte-8_2_T-1',
                                  'OSC_PedestrianCollision-1_1_T-1'])
def test_trucks_stay_on_published_roads(name: str, shared_scenarios: Path) -> None:
    driven = drive(shared_scenarios / f'{name}.xml', TrafficSpec(
        agents=25, flow=300.0, truck_share=0.5), 40.0, 3, False)
    roads = JudgedRoads(driven.scenario.scenario.lanelet_network)
    trucks = [i for i, kind in enumerate(driven.history.kinds) if kind == 'truck']
    assert len(trucks) >= 2
    events, away = off_road(driven.history, roads)
    assert [x for x in events if x.what == 'off road'] == []
    assert away[:, trucks].max() < 0.25


def test_a_recorded_truck_swings_out_where_its_way_is_too_tight(shared_scenarios: Path) -> None:
    driven = drive(shared_scenarios / 'more' / 'DEU_Moelln-10_2_T-1.xml', TrafficSpec(
        recorded='reactive'), 9.0, 0)
    roads = JudgedRoads(driven.scenario.scenario.lanelet_network)
    events, away = off_road(driven.history, roads)
    assert [x.ids for x in events if x.what == 'off road'] == []
    # Without a swing it would be 0.6 m off.
    assert away[:, driven.history.ids.index('o30')].max() < 0.1
