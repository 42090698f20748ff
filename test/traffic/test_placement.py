# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which body is in which lane: leaving out far bodies early makes no difference."""

from pathlib import Path

from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.traffic.lanes.lane_cells import cell_of, CellTable, LaneCells
from crgame_ros.traffic.lanes.lane_graph import LaneGraph
from crgame_ros.traffic.lanes.lane_table import MOST_ROUNDS, project_all
from crgame_ros.traffic.lanes.placement import (
    BESIDE,
    Bodies,
    FARTHEST,
    place,
    VEHICLE_SHIFT,
    VEHICLE_TIME,
    WALKER_SHIFT,
)
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


def found_closely(graph: LaneGraph, cells: CellTable, bodies: Bodies) -> set[tuple[int, int]]:
    """List the lanes and bodies of which at least a part is in the lane: all corners of all."""
    cell = np.array([cell_of(cells, x, y) for x, y in bodies.poses[:, :2].tolist()])
    body = np.repeat(np.arange(len(cell)), np.where(
        cell >= 0, cells.starts[cell + 1] - cells.starts[cell], 0))
    row = np.concatenate([np.arange(cells.starts[i], cells.starts[i + 1])
                          for i in cell.tolist() if i >= 0])
    lane, table = cells.lanes[row], graph.table
    (x, y, yaw), size = bodies.poses[body].T, (0.5 * bodies.length[body], 0.5 * bodies.width[body])
    guess, about, _ = project_all(table, lane, x, y, cells.guesses[row], 1)
    s, d, heading = project_all(table, lane, x, y, guess, MOST_ROUNDS)
    near = (s > -size[0] - size[1]) & (s < graph.length[lane] + size[0] + size[1]) & (
        np.abs(d) < 20.0) & (np.abs(about) < size[0] + size[1] + FARTHEST)
    along, aside = np.zeros((2, 4, len(x)))
    for corner, (ahead, left) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        u, v = ahead * size[0], left * size[1]
        along[corner], aside[corner], _ = project_all(
            table, lane, x + u * np.cos(yaw) - v * np.sin(yaw),
            y + u * np.sin(yaw) + v * np.cos(yaw), s + u * np.cos(yaw - heading), MOST_ROUNDS)
    velocity, time = bodies.velocities[body], bodies.time[body]
    most = np.where(time > VEHICLE_TIME, WALKER_SHIFT, VEHICLE_SHIFT)
    drift = np.clip((velocity[:, 1] * np.cos(heading) - velocity[:, 0] * np.sin(heading)) * time,
                    -most, most)
    low, high = (aside.min(axis=0) + np.minimum(drift, 0.0),
                 aside.max(axis=0) + np.maximum(drift, 0.0))
    claims = bodies.claim[body] == lane
    low, high = (np.where(claims, np.minimum(low, -size[1]), low),
                 np.where(claims, np.maximum(high, size[1]), high))
    half = BESIDE + graph.half_width[graph.first[lane] + np.clip(np.rint(
        s / graph.step[lane]).astype(int), 0, graph.count[lane] - 1)]
    there = near & (low < half) & (high > -half) & (along.max(axis=0) > 0.0) & (
        along.min(axis=0) < graph.length[lane])
    return set(zip(lane[there].tolist(), body[there].tolist(), strict=True))


@pytest.mark.matrix('USA_Lanker-1_3_T-1', 'more/DEU_Starnberg-1_1_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('name', MAPS)
def test_bodies_left_out_early_are_not_in_lanes(name: str, shared_scenarios: Path) -> None:
    graph = LaneGraph(RoadNetwork(load_scenario(
        shared_scenarios / f'{name}.xml').scenario.lanelet_network))
    cells = LaneCells(graph).table
    bodies = scattered(graph, 4000)
    entries = place(graph.table, cells, bodies, np.ones(len(graph), dtype=bool))
    assert len(entries.lane) > 4000
    assert set(zip(entries.lane.tolist(), entries.body.tolist(), strict=True)) == found_closely(
        graph, cells, bodies)


def test_lanes_that_are_not_wanted_have_no_entries(shared_scenarios: Path) -> None:
    graph = LaneGraph(RoadNetwork(load_scenario(
        shared_scenarios / f'{MAPS[0]}.xml').scenario.lanelet_network))
    cells, bodies = LaneCells(graph).table, scattered(graph, 300)
    wanted = np.arange(len(graph)) % 3 == 0
    entries = place(graph.table, cells, bodies, np.ones(len(graph), dtype=bool))
    some = place(graph.table, cells, bodies, wanted)
    assert 0 < len(some.lane) < len(entries.lane)
    expected = entries.select(np.flatnonzero(wanted[entries.lane]))
    for column, other in zip(some[1:], expected[1:], strict=True):
        np.testing.assert_array_equal(column, other)
