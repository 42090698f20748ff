# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where lanes cross and which has the right of way, on maps with signs and without."""

from pathlib import Path

from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.traffic.lanes.conflicts import Conflicts, roundabouts
from crgame_ros.traffic.lanes.lane_graph import LaneGraph
import numpy as np
import pytest
import shapely
import traffic_support as support


def built(path: Path) -> tuple[LaneGraph, Conflicts]:
    graph = LaneGraph(RoadNetwork(load_scenario(path).scenario.lanelet_network))
    return graph, Conflicts(graph)


def row_of(graph: LaneGraph, conflicts: Conflicts, here: int, there: int) -> int:
    rows = [i for i in range(len(conflicts)) if graph.ids[conflicts.lane[i]] == here
            and graph.ids[conflicts.lane[conflicts.other[i]]] == there]
    assert len(rows) == 1
    return rows[0]


# Lanelet 10 i + 2 + m leads from arm i to the m-th arm counter-clockwise after it; arms 1 and 3
# have priority, 2 and 4 yield (scripts/scenario_junctions.py).
@pytest.mark.parametrize(('first', 'second', 'why'), [
    (14, 24, 'priority road before the yielding one'),
    (14, 44, 'priority road before the yielding one'),
    (34, 25, 'priority road before the left turn of the yielding one'),
    (14, 35, 'straight on before the left turn that comes towards it'),
    (13, 35, 'right turn before the left turn that comes towards it'),
    (24, 45, 'the same between those who yield'),
], ids=lambda value: str(value)[:12])
def test_right_of_way_at_a_signed_intersection(maps: Path, first: int, second: int,
                                               why: str) -> None:
    graph, conflicts = built(maps / 'ZAM_Intersection-1_1_T-1.xml')
    assert conflicts.priority[row_of(graph, conflicts, first, second)] == 1, why
    assert conflicts.priority[row_of(graph, conflicts, second, first)] == -1, why


def test_vehicles_in_the_roundabout_go_first(maps: Path) -> None:
    graph, conflicts = built(maps / 'ZAM_Roundabout-1_1_T-1.xml')
    assert len(conflicts) == 8
    for arm in (10, 20, 30, 40):
        assert conflicts.priority[row_of(graph, conflicts, arm + 5, arm + 3)] == 2
        assert conflicts.priority[row_of(graph, conflicts, arm + 3, arm + 5)] == -2


@pytest.mark.parametrize(('name', 'ring'), [
    ('more/BRA_SantaRita-1', {29, 123, 10, 176, 73, 95, 43, 140}),
    ('more/ITA_CarpiCentro-9_6_T-1', {48082, 48452, 48075, 48434}),
    # A triangle of roads around an island, and a town with blocks to drive around.
    ('more/HRV_Pula-27_3_T-1', set()), ('more/DEU_Starnberg-1_1_T-1', set())])
def test_roundabouts_are_found_on_published_maps(shared_scenarios: Path, name: str,
                                                 ring: set[int]) -> None:
    graph = LaneGraph(RoadNetwork(load_scenario(
        shared_scenarios / f'{name}.xml').scenario.lanelet_network))
    assert {graph.ids[i] for i in np.flatnonzero(roundabouts(graph))} == ring


def test_room_behind_a_merge_begins_where_the_ways_are_one() -> None:
    slip = [(60.0, -20.0), (80.0, -6.0), (90.0, -2.0), (100.0, 0.0), (140.0, 0.0)]
    scenario = support.roads(
        support.straight_lane(1, 0.0, 60.0, 140.0, successor=[3]),
        support.lane_strip(2, shapely.get_coordinates(shapely.segmentize(
            shapely.LineString(slip), 1.0)).tolist(), successor=[3]),
        support.straight_lane(3, 0.0, 140.0, 200.0, predecessor=[1, 2]))
    graph = LaneGraph(RoadNetwork(scenario.lanelet_network))
    conflicts = Conflicts(graph)
    row = row_of(graph, conflicts, 1, 2)
    # The conflict lasts until both have left it; from x = 100 - 0.8 / 0.2 on one is behind
    # the other.
    assert conflicts.merges[row] and conflicts.end[row] == pytest.approx(80.0, abs=1.0)
    leave = conflicts.table.leave[:, graph.index[1]]
    assert leave == pytest.approx([36.0, 36.0], abs=1.0)


def test_without_signs_the_vehicle_from_the_right_goes_first() -> None:
    scenario = support.roads(
        support.straight_lane(1, 0.0, -100.0, 100.0),
        support.lane_strip(2, [(0.0, y) for y in np.linspace(-100.0, 100.0, 60)]))
    graph = LaneGraph(RoadNetwork(scenario.lanelet_network))
    conflicts = Conflicts(graph)
    # Lanelet 2 leads north. Its traffic comes from the right of vehicles that drive east.
    assert conflicts.priority[row_of(graph, conflicts, 2, 1)] == 1
    assert conflicts.priority[row_of(graph, conflicts, 1, 2)] == -1


def test_a_left_turn_in_pieces_is_one() -> None:
    # From the west to the north on a radius of 13.75 m, each piece turns by 0.39 rad.
    angles = np.linspace(0.0, 0.5 * np.pi, 33)
    turn = [(-12.0 + 13.75 * np.sin(a), 12.0 - 13.75 * np.cos(a)) for a in angles]
    scenario = support.roads(
        support.straight_lane(1, -1.75, -80.0, -12.0, successor=[10]),
        *(support.lane_strip(10 + i, turn[8 * i:8 * i + 9], predecessor=[9 + i if i else 1],
                             successor=[11 + i if i < 3 else 2]) for i in range(4)),
        support.lane_strip(2, [(1.75, y) for y in np.linspace(12.0, 80.0, 30)],
                           predecessor=[13]),
        support.lane_strip(3, [(x, 1.75) for x in np.linspace(80.0, -80.0, 60)]),
        support.lane_strip(4, [(-1.75, y) for y in np.linspace(80.0, -80.0, 60)]))
    graph = LaneGraph(RoadNetwork(scenario.lanelet_network))
    conflicts = Conflicts(graph)
    met = {(graph.ids[here], graph.ids[conflicts.lane[other]]): priority for here, other, priority
           in zip(conflicts.lane, conflicts.other, conflicts.priority, strict=True)}
    pieces = [pair for pair in met if pair[0] >= 10]
    assert {other for _, other in pieces} == {3, 4} and len(pieces) >= 4
    for pair in pieces:
        # It yields to oncoming vehicles; vehicles from the north are on its left.
        assert met[pair] == (-1 if pair[1] == 3 else 1), pair


def test_conflicts_hold_every_pair_whose_vehicles_touch(maps: Path) -> None:
    # Cars of 1.8 m width swept along the centre lines of lanelets that begin and end apart.
    graph, conflicts = built(maps / 'ZAM_Intersection-1_1_T-1.xml')
    inner = [i for i in graph.ids if i % 10 > 2]
    swept = {i: shapely.LineString(
        graph.network.line(i).points).buffer(0.9, cap_style='flat') for i in inner}
    known = {(graph.ids[conflicts.lane[i]], graph.ids[conflicts.lane[conflicts.other[i]]])
             for i in range(len(conflicts))}
    for i in inner:
        for j in inner:
            if i // 10 == j // 10:
                continue
            area = swept[i].intersection(swept[j])
            assert ((i, j) in known) == (area.area > 0.1), (i, j)
            if area.area > 0.1:
                row = row_of(graph, conflicts, i, j)
                ends = [graph.network.locate(i, *p)[0] for p in shapely.get_coordinates(area)]
                assert conflicts.start[row] <= min(ends) + 0.3
                assert conflicts.end[row] >= max(ends) - 0.3


def test_parallel_lanes_and_motorways_have_none(maps: Path) -> None:
    assert len(built(maps / 'ZAM_Traffic-1_1_T-1.xml')[1]) == 0
    assert len(built(maps / 'ZAM_ParkedCars-1_1_T-1.xml')[1]) == 0
