# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ground that long vehicles sweep over as they turn."""

import math

from crgame_ros.traffic.compiling.compiled import bare, compiled
from crgame_ros.traffic.fleet.agents import AgentTable, BoolArray, empty_table, write_centers
from crgame_ros.traffic.fleet.routes import Routes
from crgame_ros.traffic.following.encounters import overlap
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.lane_table import angle_between, LaneTable, point_on
from crgame_ros.traffic.lanes.placement import Bodies
from crgame_ros.traffic.lanes.pursuit import LONG_FRONT
from crgame_ros.traffic.motion.motion import move, onward
import numpy as np

# A long vehicle is rolled out over so many steps of one metre at this speed [m/s], if its way
# turns by more than this there [rad].
AHEAD, CRAWL, TURNS = 18, 2.5, 0.3
SUBSTEPS = 4
# Room beside and before the vehicles [m].
BESIDE, BEFORE = 0.15, 1.5
# Bodies that move are expected to go straight on for at most this time [s].
FORESEEN = 2.0


class SweptPaths:
    """
    The ground, beside their lanes as well, that long vehicles sweep over as they turn.

    :param graph: the lanes.
    :param routes: where agents go.
    """

    def __init__(self, graph: LaneGraph, routes: Routes) -> None:
        self._lanes, self._routes = graph.table, routes
        # A vehicle that is driven ahead to see where it gets.
        self._ghost = empty_table(1)

    def halt_before(self, bodies: Bodies, agents: AgentTable, slots: IntArray,
                    reference: FloatArray, halts: FloatArray) -> None:
        """
        Lower the distances (A) to halt at of long vehicles that would touch bodies as they turn.

        :param reference: offset of the reference at each row of the lanes' tables [m]
        :param halts: (A) of the fronts [m]
        """
        if not len(bodies.owner):
            return
        following = self._routes.next
        for i in np.flatnonzero(_turning(self._lanes, following, agents, slots)).tolist():
            slot = int(slots[i])
            self._ghost[0] = agents[slot]  # type: ignore[index]
            poses = _roll_out(self._lanes, following, self._ghost, reference)
            _halt_before(agents, slot, i, poses, bodies, halts)


@compiled
def _turning(lanes: LaneTable, following: IntArray, agents: AgentTable,
             slots: IntArray) -> BoolArray:
    """Return which agents (A) are long vehicles that turn now or soon."""
    result = np.zeros(len(slots), np.bool_)
    for i, slot in enumerate(slots):
        if agents.rear_to_center[slot] + 0.5 * agents.length[slot] < LONG_FRONT:
            continue
        for ahead in range(0, AHEAD + 1, 3):
            lane, s = onward(lanes, following, agents.destination[slot], agents.lane[slot],
                             agents.s[slot] + ahead)
            _, _, yaw = point_on(lanes, lane, s)
            if abs(angle_between(yaw, agents.yaw[slot])) > TURNS:
                result[i] = True
                break
    return result


@compiled
def _roll_out(lanes: LaneTable, following: IntArray, ghost: AgentTable,
              reference: FloatArray) -> FloatArray:
    """Return the poses (N, 3) of a vehicle's centre, a metre apart, as it drives on [m, rad]."""
    poses, velocities = np.empty((AHEAD + 1, 3)), np.empty((1, 3))
    slots = np.zeros(1, np.int64)
    ghost.speed[0], ghost.acceleration[0] = CRAWL, 0.0
    for n in range(AHEAD + 1):
        write_centers(ghost, slots, poses[n:n + 1], velocities)
        move(lanes, following, ghost, slots, reference, SUBSTEPS, 1.0 / (SUBSTEPS * CRAWL))
    return poses


@compiled
def _halt_before(agents: AgentTable, slot: int, i: int, poses: FloatArray, bodies: Bodies,
                 halts: FloatArray) -> None:
    """Lower the distance to halt at of the i-th agent to before where it touches a body."""
    speed, cos, sin = agents.speed[slot], math.cos(poses[0, 2]), math.sin(poses[0, 2])
    for n in range(len(bodies.owner)):
        east, north = bodies.poses[n, 0] - agents.x[slot], bodies.poses[n, 1] - agents.y[slot]
        far = agents.length[slot] + AHEAD + bodies.length[n] + FORESEEN * math.hypot(
            bodies.velocities[n, 0], bodies.velocities[n, 1])
        if east * cos + north * sin < 0.0 or (
                math.hypot(east, north) > far) or _touches(agents, slot, poses, 0, bodies, n, 0.0):
            continue
        for ahead in range(1, AHEAD + 1):
            time = min(ahead / max(speed, 1.0), FORESEEN)
            if _touches(agents, slot, poses, ahead, bodies, n, time):
                if ahead - BEFORE < halts[i]:
                    halts[i] = ahead - BEFORE
                    agents.blocker[slot] = bodies.owner[n]
                break


@bare
def _touches(agents: AgentTable, slot: int, poses: FloatArray, at: int, bodies: Bodies, n: int,
             time: float) -> bool:
    """Return whether a vehicle at a pose touches a body that moves straight on for a time."""
    beside = 0.0 if at == 0 else BESIDE
    return overlap(bodies.poses[n, 0] + bodies.velocities[n, 0] * time - poses[at, 0],
                   bodies.poses[n, 1] + bodies.velocities[n, 1] * time - poses[at, 1],
                   poses[at, 2], bodies.poses[n, 2] + bodies.velocities[n, 2] * time,
                   0.5 * agents.length[slot], 0.5 * agents.width[slot] + beside,
                   0.5 * bodies.length[n], 0.5 * bodies.width[n])
