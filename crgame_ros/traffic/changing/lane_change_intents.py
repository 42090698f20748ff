# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Intents of agents to change lanes, and to which side."""

import math
from typing import NamedTuple

from crgame_ros.traffic.compiling.compiled import bare, compiled, inlined
from crgame_ros.traffic.fleet.agents import AgentTable, NONE
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray
from crgame_ros.traffic.lanes.lane_table import LaneTable
from crgame_ros.traffic.motion.lane_change import urgency
import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]

# Least time of a change where a lane ends: it takes 2.5 m/s^2 to the side [s].
SWERVE_TIME = 2.8
# Up to this number agents consider changes for speed at the same tick; more agents are spread over
# the ticks.
AT_ONCE = 50
# No change for speed into a lane that the route leaves again within this distance [m].
COMMITTED = 400.0
SLOWEST = 3.0
# The route's change begins this far before the last point where it is possible [m].
PREPARE = 400.0
# No change begins this near before a junction, or in it [m].
NO_CHANGE = 15.0
# An agent that changes lanes before a junction can halt before it with this [m/s^2].
BEFORE_JUNCTION = 2.0
# No change begins this near to an obstacle: the front would hit it [m].
TOO_NEAR = 5.0
# Below `SLOWEST` no change begins with a smaller gap to the leader than this [m].
OUT_OF_QUEUE = 7.0


class Destinations(NamedTuple):
    """
    The tables of `Routes` over lanes (L) and destinations (D), and the lanes in junctions.

    :param next, change, remaining, cost: (D, L)
    :param drops: (L)
    :param inside: (2, L) for narrow and for wide vehicles.
    :param narrow: width of the widest narrow vehicle [m]
    """

    next: IntArray  # noqa: A003
    change: IntArray
    remaining: FloatArray
    cost: FloatArray
    drops: BoolArray
    inside: BoolArray
    narrow: float


class Situations(NamedTuple):
    """
    The situation of agents (A) in their own lanes.

    :param gap: to the vehicle or obstacle ahead, or inf [m]
    :param blocked: gap to an obstacle that stands there, or inf [m]
    :param halt: distance of the front from where it halts, or inf [m]
    """

    gap: FloatArray
    blocked: FloatArray
    halt: FloatArray


class LaneChangeIntents(NamedTuple):
    """
    Agents (N) that intend to change lanes, those to the left first.

    :param slots: of the agents.
    :param side: 1 to the left, -1 to the right.
    :param lane: beside.
    :param urgency: 0 to 1; -1 for speed alone.
    :param room: before an obstacle in the own lane, or inf [m]
    """

    slots: IntArray
    side: IntArray
    lane: IntArray
    urgency: FloatArray
    room: FloatArray


@compiled
def lane_change_intents(
        k: int, lanes: LaneTable, to: Destinations, agents: AgentTable, slots: IntArray,
        at: Situations, allowed: BoolArray, thoughts: int) -> LaneChangeIntents:
    """
    Return the agents that may intend to change lanes, and to which side.

    :param allowed: whether agents change lanes, of all slots.
    :param thoughts: ticks after which an agent considers changes for speed again.
    """
    free = np.empty(len(slots), np.bool_)
    room = 2 * len(slots)
    found = LaneChangeIntents(
        np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room, np.int64),
        np.empty(room), np.empty(room))
    for i, slot in enumerate(slots):
        free[i] = allowed[slot] and _is_free(k, lanes, to, agents, slot, at, i)
    left = _list(k, lanes, to, agents, slots, at, thoughts, free, 1, found, 0)
    count = _list(k, lanes, to, agents, slots, at, thoughts, free, -1, found, left)
    return LaneChangeIntents(found.slots[:count], found.side[:count], found.lane[:count],
                             found.urgency[:count], found.room[:count])


@inlined
def _no_change(speed: float) -> float:
    """Return the distance before a junction or a line within which no change begins [m]."""
    return NO_CHANGE + speed**2 / (2.0 * BEFORE_JUNCTION)


@inlined
def _is_inside(to: Destinations, agents: AgentTable, slot: int, lane: int) -> bool:
    """Return whether a lane is in a junction, for a vehicle as wide as an agent."""
    return bool(to.inside[1 if agents.width[slot] > to.narrow else 0, lane])


@bare
def _is_free(k: int, lanes: LaneTable, to: Destinations, agents: AgentTable, slot: int,
             at: Situations, i: int) -> bool:
    """Return whether an agent may change lanes at all, here and now."""
    if agents.source[slot] != NONE or agents.calm_until[slot] > k or (
            at.blocked[i] <= TOO_NEAR):
        return False
    speed, lane = agents.speed[slot], agents.lane[slot]
    if speed <= SLOWEST and at.gap[i] <= OUT_OF_QUEUE and not math.isfinite(at.blocked[i]):
        return False
    rest = lanes.length[lane] - agents.s[slot]
    if to.drops[lane]:
        # Where a lane ends there is no other place to change. An agent too fast for the rest
        # brakes instead, so that it does not leave the road.
        return bool(rest > SWERVE_TIME * speed)
    return bool(at.halt[i] >= _no_change(speed)
                and not _nears_junction(lanes, to, agents, slot, lane, agents.s[slot]))


@bare
def _nears_junction(lanes: LaneTable, to: Destinations, agents: AgentTable, slot: int, lane: int,
                    s: float) -> bool:
    """Return whether a junction is near for an agent on a lane, at an arc length of it [m]."""
    # Short lanelets may lie between a lane and its junction.
    onto, offset, no_change = lane, -s, _no_change(agents.speed[slot])
    while onto >= 0 and offset <= no_change:
        if _is_inside(to, agents, slot, onto):
            return True
        offset += lanes.length[onto]
        onto = to.next[agents.destination[slot], onto]
    return False


@bare
def _list(k: int, lanes: LaneTable, to: Destinations, agents: AgentTable, slots: IntArray,
          at: Situations, thoughts: int, free: BoolArray, side: int, found: LaneChangeIntents,
          used: int) -> int:
    """Write the intents to change to one side from row `used` on; return the next free row."""
    for i, slot in enumerate(slots):
        lane, destination = agents.lane[slot], agents.destination[slot]
        beside = lanes.left[lane] if side > 0 else lanes.right[lane]
        if not free[i] or beside < 0 or not math.isfinite(to.cost[destination, beside]):
            continue
        speed, s = agents.speed[slot], agents.s[slot]
        needs, remaining = to.change[destination, lane], to.remaining[destination, lane] - s
        if at.blocked[i] < PREPARE or (needs == side and remaining < PREPARE):
            found.urgency[used] = urgency(min(remaining, at.blocked[i]), speed)
        elif needs == 0 and agents.content_until[slot] <= k and speed > SLOWEST and (
                ((slot if len(slots) > AT_ONCE else 0) + k) % thoughts == 0) and (
                to.change[destination, beside] == 0
                or to.remaining[destination, beside] - s > COMMITTED):
            found.urgency[used] = -1.0
        else:
            continue
        # An agent that enters a junction by a lane change was not let in.
        if not to.drops[lane] and _nears_junction(
                lanes, to, agents, slot, beside, s * lanes.length[beside] / lanes.length[lane]):
            continue
        found.slots[used], found.side[used], found.lane[used] = slot, side, beside
        found.room[used] = at.blocked[i]
        used += 1
    return used
