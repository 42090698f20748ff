# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Destinations and the lanes that lead there."""

from pathlib import Path

from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.route import find_route
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.traffic.fleet.routes import Routes
from crgame_ros.traffic.lanes.conflicts import Conflicts
from crgame_ros.traffic.lanes.lane_graph import LaneGraph
import numpy as np
import traffic_support as support


def network(path: Path) -> RoadNetwork:
    return RoadNetwork(load_scenario(path).scenario.lanelet_network)


def names(graph: LaneGraph, routes: Routes) -> list[list[int]]:
    return [[graph.ids[i] for i in group] for group in routes.groups]


def test_destinations_are_the_roads_that_leave_the_map(maps: Path) -> None:
    graph = LaneGraph(network(maps / 'ZAM_Intersection-1_1_T-1.xml'))
    assert names(graph, Routes(graph)) == [[12], [22], [32], [42]]
    graph = LaneGraph(network(maps / 'ZAM_Traffic-1_1_T-1.xml'))
    assert names(graph, Routes(graph)) == [[41, 42, 43]]


def test_the_tables_lead_where_the_planners_route_leads(maps: Path) -> None:
    roads = network(maps / 'ZAM_Roundabout-1_1_T-1.xml')
    graph = LaneGraph(roads)
    routes = Routes(graph)
    for start in (11, 21, 31, 41):
        for goal in (12, 22, 32, 42):
            expected = find_route(roads, start, 0.0, frozenset({goal}), 0.0)
            destination = names(graph, routes).index([goal])
            lane, chain = graph.index[start], [start]
            while graph.ids[lane] != goal:
                lane = int(routes.next[destination, lane])
                chain.append(graph.ids[lane])
            assert tuple(chain) == expected.legs[0][:len(chain)]


def test_a_lane_that_ends_beside_one_that_goes_on_has_to_be_left() -> None:
    graph = LaneGraph(RoadNetwork(support.roads(
        support.straight_lane(1, 0.0, 0.0, 200.0, successor=[3], adjacent_right=2,
                              adjacent_right_same_direction=True),
        support.straight_lane(2, -3.5, 0.0, 200.0, adjacent_left=1,
                              adjacent_left_same_direction=True),
        support.straight_lane(3, 0.0, 200.0, 400.0, predecessor=[1])).lanelet_network))
    routes = Routes(graph)
    assert names(graph, routes) == [[3]]
    assert routes.drops.tolist() == [False, True, False]
    assert routes.change.tolist() == [[0, 1, 0]]
    np.testing.assert_allclose(routes.remaining[0, 1], 200.0)


def test_a_lane_that_begins_beside_one_from_farther_back_is_no_entry() -> None:
    graph = LaneGraph(RoadNetwork(support.roads(
        support.straight_lane(1, 0.0, 0.0, 200.0, successor=[2]),
        support.straight_lane(2, 0.0, 200.0, 400.0, predecessor=[1], adjacent_right=3,
                              adjacent_right_same_direction=True),
        support.straight_lane(3, -3.5, 200.0, 400.0, adjacent_left=2,
                              adjacent_left_same_direction=True)).lanelet_network))
    assert Routes(graph).is_entry.tolist() == [True, False, False]


def test_a_loop_without_an_exit_has_destinations_too() -> None:
    circle = [(30.0 * np.cos(a), 30.0 * np.sin(a)) for a in np.linspace(0.0, 2 * np.pi, 81)]
    halves = [support.lane_strip(1, circle[:41], successor=[2], predecessor=[2]),
              support.lane_strip(2, circle[40:], successor=[1], predecessor=[1])]
    graph = LaneGraph(RoadNetwork(support.roads(*halves).lanelet_network))
    routes = Routes(graph)
    assert len(routes) > 0 and not routes.is_exit.any()
    assert np.isfinite(routes.cost).any(axis=0).all()


def test_destinations_of_a_net_without_exits_are_spread_over_it() -> None:
    def ring(radius: float, first: int, **links: int) -> list:
        corners = [(radius * np.cos(a), radius * np.sin(a))
                   for a in np.linspace(0.0, 2 * np.pi, 161)]
        return [support.lane_strip(
            first + i, corners[40 * i:40 * i + 41], successor=[first + (i + 1) % 4],
            predecessor=[first + (i - 1) % 4],
            **{name: number + i for name, number in links.items()},
            **{f'{name}_same_direction': True for name in links}) for i in range(4)]

    # Two lanes side by side, four quarters of 157 m each.
    lanes = [*ring(98.25, 1, adjacent_right=11), *ring(101.75, 11, adjacent_left=1)]
    graph = LaneGraph(RoadNetwork(support.roads(*lanes).lanelet_network))
    routes = Routes(graph)
    # Both lanes of a quarter; no quarter is farther from one than three are long.
    assert all(len(group) == 2 and group[1] - group[0] == 10 for group in names(graph, routes))
    assert len(routes) >= 2
    assert np.isfinite(routes.cost).all()
    assert routes.cost.min(axis=0).max() < 330.0


def test_merging_early_is_preferred_to_the_end_of_the_taper(maps: Path) -> None:
    graph = LaneGraph(network(maps / 'ZAM_Merge-1_1_T-1.xml'))
    conflicts = Conflicts(graph)
    assert [graph.ids[i] for i in np.flatnonzero(conflicts.tapers())] == [53]
    routes = Routes(graph, np.where(conflicts.tapers(), 250.0, 0.0))
    assert routes.change[0, graph.index[52]] == 1
    assert Routes(graph).change[0, graph.index[52]] == 0
