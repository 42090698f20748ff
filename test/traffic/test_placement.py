# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which body is in which lane: leaving out far bodies early makes no difference."""

from pathlib import Path

from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.traffic.lanes.lane_cells import LaneCells
from crgame_ros.traffic.lanes.lane_graph import LaneGraph
from crgame_ros.traffic.lanes.placement import Bodies, place
import numpy as np
import pytest

MAPS = ('DEU_Flensburg-10_1_T-1', 'DEU_Guetersloh-36_1_T-1', 'USA_Lanker-1_3_T-1',
        'USA_US101-4_1_T-1', 'FRA_Anglet-1_1_T-1', 'more/DEU_Starnberg-1_1_T-1')


def scattered(graph: LaneGraph, count: int) -> Bodies:
    """Make bodies of all sizes and headings beside lanes, from inside them to 7 m away."""
    rng = np.random.default_rng(3)
    lane = rng.integers(len(graph), size=count)
    poses = graph.poses(lane, rng.uniform(-3.0, 1.0, count) + graph.length[lane] * rng.random(
        count), rng.uniform(-7.0, 7.0, count))
    poses[:, 2] += np.where(rng.random(count) < 0.7, rng.normal(0.0, 0.1, count),
                            rng.uniform(-4.0, 4.0, count))
    speed = rng.uniform(0.0, 20.0, count)
    velocities = np.stack((speed * np.cos(poses[:, 2]), speed * np.sin(poses[:, 2]),
                           np.zeros(count)), axis=-1)
    return Bodies(poses, velocities, np.zeros(count), rng.uniform(0.3, 18.0, count),
                  rng.uniform(0.3, 2.6, count), np.arange(count),
                  rng.choice([0.0, 0.7, 4.0], count), np.where(rng.random(count) < 0.1, lane, -1))


@pytest.mark.matrix('USA_Lanker-1_3_T-1', 'more/DEU_Starnberg-1_1_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('name', MAPS)
def test_bodies_left_out_beside_straight_lanes_are_not_in_them(name: str,
                                                               shared_scenarios: Path,
                                                               ) -> None:
    """If the angle by which lanes turn is unknown, every body is checked closely."""
    graph = LaneGraph(RoadNetwork(load_scenario(
        shared_scenarios / f'{name}.xml').scenario.lanelet_network))
    cells = LaneCells(graph).table
    bodies = scattered(graph, 4000)
    quick = place(graph.table, cells, bodies)
    close = place(graph.table, cells._replace(turning=np.full(len(graph), np.inf)), bodies)
    assert len(quick.lane) > 4000
    for column, expected in zip(quick, close, strict=True):
        np.testing.assert_array_equal(column, expected)
