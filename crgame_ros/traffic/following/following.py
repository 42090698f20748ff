# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How agents drive behind others and past them: speeds, leaders, obstacles, long vehicles."""

from typing import NamedTuple

from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.traffic.fleet.agents import Agents, BoolArray, NONE
from crgame_ros.traffic.fleet.routes import Routes
from crgame_ros.traffic.following.encounters import brush
from crgame_ros.traffic.following.leaders import (
    ahead,
    Corridors,
    corridors,
    Followers,
    nearest,
    own_corridors,
    own_ways,
    Pairs,
    Ways,
    ways,
)
from crgame_ros.traffic.following.longitudinal import halt, Longitudinal
from crgame_ros.traffic.following.swept_paths import SweptPaths
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.placement import Bodies, Entries
from crgame_ros.traffic.motion.swerving import Swerving
import numpy as np

# An agent that steers out from behind an obstacle gets nearer to it than s0 by this [m].
CLOSE = 1.3
NO_REFERENCE = np.empty(0)


class Ahead(NamedTuple):
    """
    What agents (A) have ahead of them.

    :param slots: (A) of the agents.
    :param way: the lanes that they will take.
    :param corridor: the room that they take there.
    :param pairs: of an agent and an entry in this room.
    :param desired: (A) speeds that limits and curves allow now [m/s]
    :param limit: (A) accelerations that keep to those ahead [m/s^2]
    :param gap: (A) to the leader, inf without one [m]
    :param leader: (A) as `AgentTable.leader`.
    """

    slots: IntArray
    way: Ways
    corridor: Corridors
    pairs: Pairs
    desired: FloatArray
    limit: FloatArray
    gap: FloatArray
    leader: IntArray


class Following:
    """
    The driving of agents along their lanes.

    :param graph: the lanes.
    :param routes: where agents go.
    :param spec: car-following model and lateral acceleration.
    :param count: number of agents.
    :param keeps_left: whether vehicles drive on the left.

    Attributes: `followers`, the car-following models; `speeds`, what lanes allow; `reference`,
    offset of the line that agents follow past obstacles, at each row of the lanes' tables [m]
    """

    def __init__(self, graph: LaneGraph, routes: Routes, spec: TrafficSpec, count: int,
                 keeps_left: bool) -> None:
        self._graph, self._routes = graph, routes
        self.followers = Followers(spec.model, spec.options, count)
        self.speeds = Longitudinal(graph, routes, self.followers)
        self._swept_paths = SweptPaths(graph, routes)
        self._swerving = Swerving(graph, routes, spec.lateral_acceleration, keeps_left=keeps_left)
        self._slowed = self._swerving.version
        self.reference: FloatArray = self._swerving.reference

    def swerve_around(self, standing: Entries) -> None:
        """Lead agents around entries that stand for good."""
        self._swerving.update(standing)
        if self._swerving.version != self._slowed:
            self._slowed = self._swerving.version
            self.speeds.slow_for(self._swerving.speed)

    def look(self, agents: Agents, slots: IntArray, entries: Entries) -> Ahead:
        """Find what agents have ahead of them."""
        lanes = self._graph.table
        way = own_ways(lanes, self._routes.next, agents.table, slots)
        corridor = own_corridors(lanes, agents.table, slots, self.reference)
        pairs = ahead(lanes, agents.table, entries, way, corridor, self.reference)
        gap, leader, _ = nearest(pairs, entries, len(slots))
        return Ahead(slots, way, corridor, pairs, *self.speeds.speeds(way, agents, slots), gap,
                     leader)

    def accelerations(self, agents: Agents, seen: Ahead, entries: Entries,
                      standing: BoolArray) -> FloatArray:
        """
        Decide how agents (A) accelerate behind all that is ahead [m/s^2].

        :param standing: (E) which entries stand for good.
        """
        result = np.minimum(seen.limit, self.speeds.behind(
            agents, seen.desired, seen.pairs, entries, seen.corridor))
        self._mind_left_lanes(agents, seen, entries, standing, result)
        return result

    def _mind_left_lanes(self, agents: Agents, seen: Ahead, entries: Entries,
                         standing: BoolArray, acceleration: FloatArray) -> None:
        """Make agents that change lanes also follow the leader in the lane that they leave."""
        lanes = self._graph.table
        source = agents.source[seen.slots]
        row = np.flatnonzero((source != NONE) & (source != agents.lane[seen.slots]))
        if not len(row):
            return
        slot = seen.slots[row]
        s, d = agents.in_left_lanes(self._graph, slot)
        corridor = corridors(agents.table, slot, d, d)
        way = ways(lanes, self._routes.next, agents.table, slot, source[row], s)
        pairs = ahead(lanes, agents.table, entries, way, corridor, NO_REFERENCE)
        pairs.gap[standing[pairs.entry]] += CLOSE
        acceleration[row] = np.minimum(acceleration[row], self.speeds.behind(
            agents, seen.desired[row], pairs, entries, corridor))

    def halt(self, agents: Agents, seen: Ahead, entries: Entries, bodies: Bodies,
             blocked: FloatArray, swings: BoolArray, halts: FloatArray,
             acceleration: FloatArray) -> None:
        """
        Lower accelerations (A) so that agents halt where they must and touch nobody beside them.

        :param bodies: of the others.
        :param blocked: (A) gap to an obstacle that stands in the lane, or inf [m]
        :param swings: whether agents change lanes, of all slots.
        :param halts: (A) of the fronts from where they must halt, which is lowered for long
            vehicles [m]
        """
        lanes, routes, slots = self._graph.table, self._routes, seen.slots
        self._swept_paths.halt_before(bodies, agents.table, slots, self.reference, halts)
        brush(lanes, routes.next, agents.table, slots, entries, seen.way, acceleration)
        halt(lanes, routes.drops, seen.way, agents.table, slots, halts, blocked, swings,
             acceleration)
