# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which lanes are too tight for whom: found by driving along them."""

from itertools import product

import numpy as np
from numpy.typing import NDArray
import shapely

from crgame_ros.geometry.shape import Shape
from crgame_ros.scenario.objects import ObjectDescription, Role
from crgame_ros.traffic.agents import Agents
from crgame_ros.traffic.lane_graph import IntArray, LaneGraph
from crgame_ros.traffic.longitudinal import envelope_of
from crgame_ros.traffic.motion import move

# Beyond the road by so much is off it: in traffic it becomes a decimetre more [m].
SPARE = 0.05
# Lanes that are wider than the vehicle by this, and straighter, are not tried [m, 1/m].
EASY_WIDTH, EASY_BEND = 0.6, 0.02
# How far before a lane a trial begins, how far behind it ends, and how often one looks [m, s].
RUN_UP, RUN_OUT, STEP_S, SUBSTEPS = 20.0, 10.0, 0.1, 10
# Trials are driven at these speeds at most, or slower where the road bends, and at the slowest of
# them at least [m/s]: who is slow follows a bend's shift to the inside in full, who is fast late.
SPEEDS = (2.5, 8.0)


def tight_lanes(graph: LaneGraph, shape: Shape) -> NDArray[np.bool_]:
    """
    Tell which lanes (L) a vehicle leaves the road on, as agents drive.

    Each lane with a bend, a kink or little width is driven from every lane before it to every
    lane behind it.
    """
    ways = np.array([way for lane in np.flatnonzero(_suspicious(graph, shape))
                     for way in product(_or_none(graph.predecessors[lane]), [lane],
                                        _or_none(graph.successors[lane]))],
                    dtype=np.int64).reshape(-1, 3)
    result = np.zeros(len(graph), dtype=bool)
    if len(ways):
        area = shapely.buffer(graph.network.road_area(), SPARE)
        shapely.prepare(area)
        for speed in SPEEDS:
            way, x, y = _drive(graph, shape, ways, speed)
            result[ways[way[~shapely.contains_xy(area, x, y)], 1]] = True
    return result


def _suspicious(graph: LaneGraph, shape: Shape) -> NDArray[np.bool_]:
    wide = 0.5 * shape.width + 0.5 * EASY_WIDTH
    bad = (graph.half_width < wide) | (np.abs(graph.curvature) > EASY_BEND)
    return np.asarray(np.logical_or.reduceat(bad, graph.first))


def _or_none(lanes: IntArray) -> list[int]:
    return [int(i) for i in lanes if i >= 0] or [-1]


def _drive(graph: LaneGraph, shape: Shape, ways: IntArray,
           top: float) -> tuple[IntArray, NDArray[np.float64], NDArray[np.float64]]:
    """Drive ways (N, 3) of lanes; give way, x and y of all corners in and around the middle."""
    count, half = len(ways), 0.5 * shape.length
    agents = Agents([ObjectDescription('trial', 'truck', Role.TRAFFIC, shape)] * count)
    following = np.full((count, len(graph)), -1, dtype=np.int64)
    row = np.arange(count)
    has = ways[:, 0] >= 0
    following[row[has], ways[has, 0]] = ways[has, 1]
    following[row, ways[:, 1]] = ways[:, 2]
    first = np.where(has, ways[:, 0], ways[:, 1])
    start = np.where(has, np.maximum(graph.length[first] - RUN_UP, 0.0),
                     np.minimum(half, graph.length[first]))
    for i, pose in enumerate(graph.poses(first, start, np.zeros(count))):
        agents.put(i, int(first[i]), float(start[i]), 0.0,
                   (float(pose[0]), float(pose[1]), float(pose[2])), SPEEDS[0])
    agents.destination[:] = row
    reference = np.zeros(len(graph.x))
    # Nobody needs a road beyond the map's edge.
    end = np.where(ways[:, 2] >= 0, np.inf, graph.length[ways[:, 1]] - half)
    found: list[tuple[IntArray, NDArray[np.float64]]] = []
    slots, envelope = row, envelope_of(graph.table, graph.curve_speed)
    longest = float(graph.length[ways[:, 1]].max()) + RUN_UP
    for _ in range(int(longest / (SPEEDS[0] * STEP_S))):
        points = graph.rows(agents.lane[slots], agents.s[slots])
        agents.speed[slots] = np.clip(envelope[points], SPEEDS[0], top)
        move(graph.table, following, agents.table, slots, reference, SUBSTEPS, STEP_S / SUBSTEPS)
        lane, s = agents.lane[slots], agents.s[slots]
        near = slots[(lane != ways[slots, 0]) | (s > graph.length[lane] - shape.length)]
        found.append((np.repeat(near, 4), _corners(agents, near)))
        past = np.where(lane == ways[slots, 2], s > RUN_OUT,
                        (lane == ways[slots, 1]) & (s > end[slots]))
        slots = slots[~past]
        if not len(slots):
            break
    driven = np.concatenate([x for _, x in found])
    return np.concatenate([i for i, _ in found]), driven[:, 0], driven[:, 1]


def _corners(agents: Agents, slots: IntArray) -> NDArray[np.float64]:
    """Give the corners (4 N, 2) of agents (N), those of each together [m]."""
    x, y, yaw = agents.centers()[slots].T
    along = 0.5 * agents.length[slots, None] * np.array((1.0, 1.0, -1.0, -1.0))
    left = 0.5 * agents.width[slots, None] * np.array((1.0, -1.0, -1.0, 1.0))
    cos, sin = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    return np.stack((x[:, None] + along * cos - left * sin,
                     y[:, None] + along * sin + left * cos), axis=-1).reshape(-1, 2)
