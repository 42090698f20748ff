# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Agents that have got off their lanes."""

from pathlib import Path

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.traffic.fleet.agents import Agents
from crgame_ros.traffic.lanes.lane_graph import LaneGraph
from crgame_ros.traffic.motion.motion import move
import numpy as np
import pytest
from traffic_drive import drive
from traffic_support import lane_strip, roads


@pytest.mark.parametrize('length', [4.5, 8.0, 12.4])
def test_an_agent_gets_back_onto_its_lane_from_anywhere(length: float) -> None:
    """50 agents up to 10 m beside or before a lane, in any heading, at 3 m/s for 80 s."""
    graph = LaneGraph(RoadNetwork(roads(lane_strip(
        1, [(0.0, 0.0), (250.0, 0.0), (500.0, 0.0)])).lanelet_network))
    rng, slots = np.random.default_rng(4), np.arange(50)
    agents = Agents([ObjectDescription(f't{i}', 'bus', Role.TRAFFIC, Shape.rectangle(length, 2.4))
                     for i in slots])
    for slot in slots.tolist():
        x, y = rng.uniform(-10.0, 40.0), rng.uniform(-10.0, 10.0)
        agents.put(slot, 0, x, y, (x, y, rng.uniform(-np.pi, np.pi)), 3.0)
    following, straight = np.full((1, 1), -1, dtype=np.int64), np.zeros(len(graph.x))
    for _ in range(80):
        move(graph.table, following, agents.table, slots, straight, 100, 0.01)
    assert np.abs(agents.d).max() < 0.1
    assert np.cos(agents.yaw).min() > 0.99 and agents.s.min() > 0.0


@pytest.mark.exhaustive
def test_a_bus_that_cannot_follow_a_hairpin_does_not_get_lost(shared_scenarios: Path) -> None:
    """Its only way turns back with R = 2 m; its own turning circle takes it far off the road."""
    driven = drive(shared_scenarios / 'cases' / 'BEL_Aarschot-3_1_T-1.xml', TrafficSpec(
        recorded='reactive'), 60.0, 3).history
    bus = driven.ids.index('o353')
    poses = driven.poses[np.isfinite(driven.poses[:, bus, 0]), bus]
    # It came from the north and has left the map there, in the other lane.
    assert abs(poses[0, 2] + 1.54) < 0.1 and abs(poses[-1, 2] - 1.6) < 0.1
    assert len(poses) < len(driven.poses)
    assert np.nanmax(driven.speed[:, bus]) < 16.0
