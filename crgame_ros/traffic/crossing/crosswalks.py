# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Crossings for pedestrians: agents wait for people who walk there."""

from typing import NamedTuple

from commonroad.common.common_lanelet import LaneletType
from commonroad.scenario.lanelet import LaneletNetwork
from crgame_ros.traffic.compiling.compiled import compiled
from crgame_ros.traffic.fleet.agents import AgentTable
from crgame_ros.traffic.following.leaders import Ways
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.placement import Bodies, VEHICLE_TIME
import numpy as np
from numpy.typing import NDArray
import shapely

# A person who gets onto a crossing within this time counts as walking there [s].
STEPS_ON = 1.0
# A person who walks away is clear of a lane at this distance from its edge [m].
CLEAR = 0.5
# Agents halt this far before a crossing [m].
BEFORE = 0.7
# They wait for nobody for whom they would have to brake harder, or harder still once they brake
# with more than `BRAKES` [m/s^2].
TOO_LATE, STILL_TOO_LATE, BRAKES = 3.0, 5.0, 1.0


class _Rows(NamedTuple):
    """
    Crossings (C) on lanes, in rows (R) in the order of lanes (L).

    :param first: (L + 1) rows at which those of each lane begin.
    :param begin: (R) arc length at which the crossing begins [m]
    :param crossing: (R)
    :param x, y, left_x, left_y: (R) its middle in the lane, and the unit vector to the left [m]
    :param half_width: (R) of the lane there [m]
    """

    first: IntArray
    begin: FloatArray
    crossing: IntArray
    x: FloatArray
    y: FloatArray
    left_x: FloatArray
    left_y: FloatArray
    half_width: FloatArray


class Crosswalks:
    """
    The crossings for pedestrians of all lanes.

    :param graph: the lanes.
    :param roads: with the lanelets that are crossings.
    """

    def __init__(self, graph: LaneGraph, roads: LaneletNetwork) -> None:
        self._areas = np.array([x.polygon.shapely_object for x in roads.lanelets
                                if LaneletType.CROSSWALK in x.lanelet_type], dtype=object)
        shapely.prepare(self._areas)
        found = []
        for lane in range(len(graph)) if len(self._areas) else ():
            rows = graph.rows_of(lane)
            for crossing, area in enumerate(self._areas):
                on = np.flatnonzero(shapely.contains_xy(area, graph.x[rows], graph.y[rows]))
                if len(on):
                    middle = rows.start + int(on[len(on) // 2])
                    found.append((lane, float(on[0] * graph.step[lane]), crossing,
                                  graph.x[middle], graph.y[middle], -np.sin(graph.yaw[middle]),
                                  np.cos(graph.yaw[middle]), graph.half_width[middle]))
        columns = np.array(found, dtype=np.float64).reshape(-1, 8).T
        self._rows = _Rows(
            np.searchsorted(columns[0], np.arange(len(graph) + 1)), columns[1].copy(),
            columns[2].astype(np.int64), *(x.copy() for x in columns[3:]))

    def halt_before(self, bodies: Bodies, standing: NDArray[np.bool_], way: Ways,
                    agents: AgentTable, slots: IntArray, halts: FloatArray) -> None:
        """
        Lower the distances (A) to halt at of agents before crossings on which people walk.

        :param standing: which of the others (O) are likely to stand for good.
        :param halts: (A) of the fronts [m]
        """
        if not len(self._rows.begin) or not len(bodies.owner):
            return
        walkers = np.flatnonzero((bodies.time > VEHICLE_TIME) & ~standing[-1 - bodies.owner])
        if len(walkers):
            _halt_before(self._rows, self._walked_on(bodies, walkers), way, agents, slots, halts)

    def _walked_on(self, bodies: Bodies, walkers: IntArray) -> IntArray:
        """Return for whom agents wait at each row (R): as in `Bodies.owner`, 0 for nobody."""
        rows, areas = self._rows, self._areas[:, None]
        x, y = bodies.poses[walkers, :2].T
        u, v = bodies.velocities[walkers, :2].T
        on = shapely.contains_xy(areas, x, y) | shapely.contains_xy(
            areas, x + STEPS_ON * u, y + STEPS_ON * v)
        left_x, left_y = rows.left_x[:, None], rows.left_y[:, None]
        aside = left_x * (x - rows.x[:, None]) + left_y * (y - rows.y[:, None])
        gone = (np.abs(aside) > rows.half_width[:, None] + CLEAR) & (
            aside * (left_x * u + left_y * v) > 0.0)
        owner = np.where(on[rows.crossing] & ~gone, bodies.owner[walkers], 0)
        return np.asarray(owner.min(axis=1))


@compiled
def _halt_before(rows: _Rows, walker: IntArray, way: Ways, agents: AgentTable, slots: IntArray,
                 halts: FloatArray) -> None:
    """Lower the distances (A) to halt at of agents that can halt before their next crossings."""
    for i, slot in enumerate(slots):
        speed, front = agents.speed[slot], 0.5 * agents.length[slot]
        hardest = TOO_LATE if agents.acceleration[slot] > -BRAKES else STILL_TOO_LATE
        for step in range(way.depth[i]):
            lane = way.lane[i, step]
            for n in range(rows.first[lane], rows.first[lane + 1]):
                away = way.offset[i, step] + rows.begin[n] - front
                room = away - BEFORE
                if walker[n] < 0 <= away and room < halts[i] and (
                        speed * speed <= 2.0 * hardest * max(room, 0.05)):
                    halts[i] = room
                    agents.blocker[slot] = walker[n]
