# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lane tables against the road network's own geometry."""

from pathlib import Path

from commonroad.common.common_lanelet import LaneletType
from crgame_ros.errors import InputError
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.speed_limits import set_speed_limit
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.traffic.lanes.lane_cells import cell_of, LaneCells
from crgame_ros.traffic.lanes.lane_graph import LaneGraph
import numpy as np
import pytest
import traffic_support as support


def graph_of(path: Path) -> LaneGraph:
    return LaneGraph(RoadNetwork(load_scenario(path).scenario.lanelet_network))


def test_poses_lie_where_the_road_network_has_them(maps: Path) -> None:
    graph = graph_of(maps / 'ZAM_Roundabout-1_1_T-1.xml')
    for lane in range(len(graph)):
        s = np.linspace(0.0, graph.length[lane], 17)
        d = np.linspace(-1.5, 1.5, 17)
        poses = graph.poses(np.full(17, lane), s, d)
        for i in range(17):
            x, y, yaw = graph.network.pose_on(graph.ids[lane], float(s[i]), float(d[i]))
            # The tables cut a curve of 15 m radius by 0.5^2 / (8 * 15) = 2 mm; headings differ
            # by what they are averaged over.
            assert np.hypot(poses[i, 0] - x, poses[i, 1] - y) < 0.06
            assert abs(np.angle(np.exp(1j * (poses[i, 2] - yaw)))) < 0.05


def test_projection_inverts_poses(maps: Path) -> None:
    graph = graph_of(maps / 'ZAM_Roundabout-1_1_T-1.xml')
    lane = np.arange(len(graph))
    s, d = 0.4 * graph.length, np.linspace(-1.7, 1.7, len(graph))
    pose = graph.poses(lane, s, d)
    found = graph.project(lane, pose[:, 0], pose[:, 1], s + 3.0, 5)
    np.testing.assert_allclose(found[0], s, atol=0.02)
    np.testing.assert_allclose(found[1], d, atol=0.01)


def test_curvature_is_that_of_the_circle(maps: Path) -> None:
    graph = graph_of(maps / 'ZAM_Roundabout-1_1_T-1.xml')
    lane = graph.index[15]
    rows = slice(int(graph.first[lane]) + 8, int(graph.first[lane] + graph.count[lane]) - 8)
    x, y = graph.x[rows], graph.y[rows]
    # The circle is around the origin.
    np.testing.assert_allclose(1.0 / graph.curvature[rows], np.hypot(x, y), rtol=0.03)


@pytest.mark.parametrize(('types', 'kmh'), [
    ({LaneletType.INTERSTATE, LaneletType.ACCESS_RAMP}, 130.0), ({LaneletType.HIGHWAY}, 130.0),
    ({LaneletType.COUNTRY}, 100.0), ({LaneletType.URBAN}, 50.0), (set(), 50.0)])
def test_without_a_speed_limit_the_type_of_the_lane_counts(types: set[LaneletType],
                                                           kmh: float) -> None:
    scenario = support.roads(support.straight_lane(1, 0.0, 0.0, 100.0, lanelet_type=types),
                             support.straight_lane(2, 9.0, 0.0, 100.0, lanelet_type=types))
    set_speed_limit(scenario, 7.0, (2,))
    graph = LaneGraph(RoadNetwork(scenario.lanelet_network))
    assert graph.limit.tolist() == pytest.approx([kmh / 3.6, 7.0], abs=0.02)


def test_lanes_near_a_point_hold_every_lane_that_contains_it(maps: Path) -> None:
    graph = graph_of(maps / 'ZAM_Intersection-1_1_T-1.xml')
    cells, random = LaneCells(graph).table, np.random.default_rng(3)
    points = random.uniform(-25.0, 25.0, (400, 2))
    near = [(i, n) for i, (x, y) in enumerate(points) if (cell := cell_of(cells, x, y)) >= 0
            for n in range(cells.starts[cell], cells.starts[cell + 1])]
    row, place = np.array(near).T
    lane, guess = cells.lanes[place], cells.guesses[place]
    found = set(zip(row.tolist(), lane.tolist(), strict=True))
    lanelets = graph.network.lanelet_network.find_lanelet_by_position(list(points))
    expected = {(i, graph.index[j]) for i, ids in enumerate(lanelets) for j in ids}
    assert len(expected) > 200
    assert expected <= found
    # The guess is near enough for a projection to converge.
    s, _, _ = graph.project(lane, *points[row].T, guess, 3)
    for i in range(0, len(row), 7):
        exact, d = graph.network.locate(graph.ids[lane[i]], *points[row[i]])
        if 0.5 < exact < graph.length[lane[i]] - 0.5 and abs(d) < 5.0:
            assert abs(s[i] - exact) < 0.3


@pytest.mark.parametrize('length', [0.3, 2.0])
def test_a_tiny_lanelet_that_folds_back_is_passed_over(length: float) -> None:
    """The lane before it continues in the lane behind it; one that can be driven stays."""
    def successors(tiny: list[tuple[float, float]]) -> list[int]:
        graph = LaneGraph(RoadNetwork(support.roads(
            support.straight_lane(1, 0.0, 0.0, 100.0, successor=[2]),
            support.lane_strip(2, tiny, predecessor=[1], successor=[3]),
            support.straight_lane(3, 0.0, 100.0, 200.0, predecessor=[2])).lanelet_network))
        row = graph.successors[graph.index[1]]
        return [graph.ids[lane] for lane in row[row >= 0]]

    assert successors([(100.0, 0.0), (100.0 - length, 0.05)]) == [3]
    assert successors([(100.0, 0.0), (100.0 + 0.1 * length, 0.0)]) == [2]


def test_refuses_a_map_without_lanes_for_vehicles() -> None:
    from commonroad.common.common_lanelet import LaneletType
    path = support.straight_lane(1, 0.0, 0.0, 50.0, lanelet_type={LaneletType.PARKING})
    with pytest.raises(InputError, match='no lanelet is for cars or bicycles'):
        LaneGraph(RoadNetwork(support.roads(path).lanelet_network))
