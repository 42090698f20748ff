# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Desired speeds of agents, and their accelerations behind leaders and obstacles (FS M2)."""

import math

from crgame_ros.traffic.compiling.compiled import bare, compiled
from crgame_ros.traffic.fleet.agents import Agents, AgentTable, NONE
from crgame_ros.traffic.fleet.routes import Routes
from crgame_ros.traffic.following.encounters import FIRMEST, moderate
from crgame_ros.traffic.following.leaders import Corridors, Followers, Pairs, Ways
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.lane_table import LaneTable, nearest_row
from crgame_ros.traffic.lanes.placement import Entries
from crgame_ros.traffic.motion.lane_change import SHORTEST_CHANGE
from crgame_ros.vehicle.state import QUEUEING
import numpy as np
from numpy.typing import NDArray

# Deceleration for a curve or a lower limit ahead [m/s^2].
COASTING = 1.2
# Times ahead for which the allowed speeds are read, and in which agents reach them [s].
LOOKS = (0.3, 0.6, 1.0)
# Deceleration to halt at a line, and before the end of a lane that the agent could not leave: the
# latter is late, because gaps are found at speed [m/s^2].
AT_LINE, AT_END = 1.6, 3.0
# Agents halt at this gap before a line, and a standing agent this near to it stays [m].
LINE_GAP, NEAR = 0.5, 0.3
# An agent that has reached the place where it halts still takes this way [m]: the shorter one
# unless it would have to brake harder than `EMERGENCY` for that.
LINE_WAYS = 0.05, 0.2
# Room that an agent needs before a standing obstacle to get into the next lane [m], and the number
# of its lengths that it needs at least.
SWING_OUT, SWING_LENGTHS = 10.0, 2.0
# Share of a short lane that ends which is kept for a lane change.
REST_SHARE = 0.2
# Comfortable jerk [m/s^3]: of braking more, of braking less or accelerating; braking harder than
# `EMERGENCY` sets in at once [m/s^2].
JERK, RELEASE, EMERGENCY = 3.0, 4.0, 3.0
# An agent above the first share of the comfortable lateral acceleration approaches the comfortable
# speed within the second time [s].
ALMOST, STRAIGHTENING = 0.8, 0.5


@compiled
def envelope_of(lanes: LaneTable, speed: FloatArray) -> FloatArray:
    """Return the speeds from which agents slow down in time for lower ones ahead in the lane."""
    result = speed.copy()
    for lane in range(len(lanes.first)):
        first, gain = lanes.first[lane], 2.0 * COASTING * lanes.step[lane]
        for row in range(first + lanes.points[lane] - 2, first - 1, -1):
            result[row] = min(result[row], math.sqrt(result[row + 1]**2 + gain))
    return result


@bare
def _allowed(lanes: LaneTable, envelope: FloatArray, way: Ways, i: int, factor: float, top: float,
             ahead: float) -> float:
    """Return the speed that limits and curves allow an agent a distance ahead of its centre."""
    result = math.inf
    for step in range(way.depth[i]):
        lane, begins = way.lane[i, step], way.offset[i, step] - ahead
        wanted = min(lanes.limit[lane] * factor, top)
        if begins > 0.0 and step > 0:
            there = min(wanted, envelope[lanes.first[lane]])
            result = min(result, math.sqrt(there * there + 2.0 * COASTING * begins))
        elif begins + lanes.length[lane] > 0.0 or step == way.depth[i] - 1:
            result = min(wanted, envelope[nearest_row(lanes, lane, -begins)])
    return result


@compiled
def _speeds(lanes: LaneTable, envelope: FloatArray, lateral: float, way: Ways,
            agents: AgentTable, slots: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the allowed speeds (A), and the accelerations (A) that keep to those ahead."""
    desired, limit = np.empty(len(slots)), np.full(len(slots), math.inf)
    _fill_speeds(lanes, envelope, lateral, way, agents, slots, desired, limit)
    return desired, limit


@bare
def _fill_speeds(lanes: LaneTable, envelope: FloatArray, lateral: float, way: Ways,
                 agents: AgentTable, slots: IntArray, desired: FloatArray,
                 limit: FloatArray) -> None:
    for i, slot in enumerate(slots):
        factor, top, speed = agents.factor[slot], agents.top[slot], agents.speed[slot]
        desired[i] = _allowed(lanes, envelope, way, i, factor, top, 0.0)
        for look in LOOKS:
            there = _allowed(lanes, envelope, way, i, factor, top, speed * look)
            limit[i] = min(limit[i], (there - speed) / look)
        # An agent that leaves a bend speeds up only as its wheels straighten.
        bend = abs(math.tan(agents.steering[slot])) / agents.wheelbase[slot]
        if speed * speed * bend > ALMOST * lateral:
            steady = (math.sqrt(lateral / bend) - speed) / STRAIGHTENING
            limit[i] = min(limit[i], max(steady, -COASTING))
        # An agent that is much too fast, because a limit has changed, slows down gently.
        limit[i] = max(limit[i], -2.0 * COASTING)


@bare
def halt_before(speed: float, distance: float, braking: float) -> float:
    """
    Return the acceleration that halts an agent after a distance.

    The speed follows sqrt(2 b d), evaluated a moment ahead so that braking sets in smoothly. If
    harder braking is needed, it sets in at once.
    """
    if distance >= math.inf:
        return math.inf
    if speed < QUEUEING and distance < NEAR:
        return -1.0
    needed = speed * speed / (2.0 * max(distance, LINE_WAYS[1]))
    needed = max(needed, min(speed * speed / (2.0 * max(distance, LINE_WAYS[0])), EMERGENCY))
    if needed > braking:
        return -needed
    result = math.inf
    for look in LOOKS:
        allowed = math.sqrt(2.0 * braking * max(distance - speed * look, 0.0))
        result = min(result, (allowed - speed) / look)
    return max(result, -braking)


@compiled
def halt(lanes: LaneTable, drops: NDArray[np.bool_], way: Ways, agents: AgentTable,
         slots: IntArray, distance: FloatArray, blocked: FloatArray,
         swings: NDArray[np.bool_], wanted: FloatArray) -> None:
    """
    Lower accelerations so that agents (A) halt at lines, behind obstacles and at lane ends.

    Behind an obstacle that it can pass in the next lane an agent leaves room to get around it.

    :param drops: (L) lanes that end on the road.
    :param distance: (A) of the front from a line, or inf [m]
    :param blocked: (A) gap to an obstacle that stands in the lane, or inf [m]
    :param swings: whether agents change lanes, of all slots.
    :param wanted: (A) accelerations, which are lowered [m/s^2]
    """
    for i, slot in enumerate(slots):
        speed, lane = agents.speed[slot], agents.lane[slot]
        beside = lanes.left[lane] >= 0 or lanes.right[lane] >= 0
        before_obstacle = math.inf
        # An agent that is nearer already cannot leave this room any more.
        room = max(SWING_OUT, SWING_LENGTHS * agents.length[slot])
        if swings[slot] and beside and agents.source[slot] == NONE and blocked[i] > 0.5 * room:
            # One that is nearer already halts where it comfortably can.
            before_obstacle = max(blocked[i] - room, min(
                speed * speed / (2.0 * FIRMEST), blocked[i] - 0.5 * room))
        last = way.lane[i, way.depth[i] - 1]
        end = math.inf
        if drops[last]:
            # The agent halts with the room left that a lane change takes.
            end = (way.offset[i, way.depth[i] - 1] + lanes.length[last]
                   - 0.5 * agents.length[slot]
                   - min(SHORTEST_CHANGE, REST_SHARE * lanes.length[last]))
        wanted[i] = min(wanted[i], halt_before(
            speed, max(min(distance[i], before_obstacle), 0.0), AT_LINE))
        wanted[i] = min(wanted[i], halt_before(speed, max(end, 0.0), AT_END))


@compiled
def before_lines(speed: FloatArray, light: FloatArray) -> FloatArray:
    """
    Return the distances (A) at which to halt before lights, some way before the line.

    :param light: (A) distance of the front from the line [m]
    """
    result = np.empty(len(speed))
    for i in range(len(speed)):
        # The gap to the line gets smaller rather than that the agent brakes hard for it.
        easily = min(speed[i] * speed[i] / (2.0 * FIRMEST), light[i] - NEAR)
        result[i] = max(light[i] - LINE_GAP, easily)
    return result


@compiled
def smooth(agents: AgentTable, slots: IntArray, wanted: FloatArray, hardest: float,
           dt_s: float) -> None:
    """Limit accelerations (A) and, except in emergencies, their change in a step [m/s^2]."""
    for i, slot in enumerate(slots):
        speed, before = agents.speed[slot], agents.acceleration[slot]
        if speed <= 0.0:
            before = max(before, 0.0)
        low, high = before - JERK * dt_s, before + RELEASE * dt_s
        if wanted[i] < -EMERGENCY:
            low = wanted[i]
        if speed < 1.0:
            # An agent that has just begun to roll may stop again at once.
            low = min(low, -EMERGENCY)
        if before < -EMERGENCY or speed < 1.0:
            high = math.inf
        if speed > 0.0 or wanted[i] >= 0.0:
            wanted[i] = min(max(wanted[i], low), high)
        wanted[i] = max(wanted[i], -hardest)


class Longitudinal:
    """
    Speeds and accelerations of all agents.

    :param graph: the lanes.
    :param routes: where agents go.
    :param followers: their car-following models.
    """

    def __init__(self, graph: LaneGraph, routes: Routes, followers: Followers) -> None:
        self._graph = graph
        self._following = routes.next
        self._followers = followers
        self._envelope = envelope_of(graph.table, graph.curve_speed)
        self._lateral = graph.lateral_acceleration

    def slow_for(self, speed: FloatArray) -> None:
        """Set the speeds that swerves allow at each point of the lanes [m/s]."""
        self._envelope = envelope_of(self._graph.table, np.minimum(self._graph.curve_speed, speed))

    def speeds(self, way: Ways, agents: Agents,
               slots: IntArray) -> tuple[FloatArray, FloatArray]:
        """
        Return the speeds that limits and curves allow now (A), and the accelerations (A).

        :return: [m/s]; with the accelerations agents slow down in time for lower speeds ahead
            [m/s^2]
        """
        desired, limit = _speeds(self._graph.table, self._envelope, self._lateral, way,
                                 agents.table, slots)
        return desired, limit

    def allowed(self, lane: int, s: float, factor: float) -> float:
        """Return the speed that limit and curves allow somewhere [m/s]."""
        row = nearest_row(self._graph.table, lane, s)
        return float(min(self._graph.limit[lane] * factor, self._envelope[row]))

    def behind(self, agents: Agents, desired: FloatArray, pairs: Pairs, entries: Entries,
               corridor: Corridors) -> FloatArray:
        """
        Return the acceleration (A) behind all that is ahead; at most that of a free road.

        :param corridor: room that each agent takes.
        """
        slots = corridor.owner
        speed = agents.speed[slots]
        free = np.full(len(slots), np.inf)
        result = np.asarray(self._followers.for_agents(slots).acceleration(
            speed, desired, free, speed), dtype=float)
        if len(pairs.agent):
            row, entry = pairs.agent, pairs.entry
            wanted = self._followers.for_agents(slots[row]).acceleration(
                speed[row], desired[row], pairs.gap, entries.speed[entry],
                agents.relief[slots[row]],
                # A vehicle that changes lanes may brake for a leader in the lane that it leaves:
                # its acceleration says nothing about the new lane.
                np.where(entries.claims[entry], 0.0, entries.acceleration[entry]))
            moderate(self._graph.table, self._following, agents.table, entries, pairs, corridor,
                     np.asarray(wanted, dtype=float), result)
        return result
