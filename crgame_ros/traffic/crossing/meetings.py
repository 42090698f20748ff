# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Meetings of vehicles at conflicts, and whether both pass at different times anyway."""

import math
from typing import NamedTuple

from crgame_ros.traffic.compiling.compiled import bare, compiled, inlined
from crgame_ros.traffic.crossing.junctions import (
    Arrivals,
    BEFORE,
    FIRM,
    Passages,
    time_to,
    waits_inside,
)
from crgame_ros.traffic.fleet.agents import AgentTable
from crgame_ros.traffic.following.leaders import Ways
from crgame_ros.traffic.following.longitudinal import AT_LINE
from crgame_ros.traffic.lanes.conflicts import ConflictTable, extent, spare_room, touch
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray
from crgame_ros.vehicle.state import QUEUEING
import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]

# Acceleration of a fast agent towards a conflict, and of a slow one out of it [m/s^2].
HURRY, TIMID = 1.8, 0.7
# A vehicle lets another go first that waits, if it can halt with this braking [m/s^2] after this
# time [s].
GENTLE, REACTION = 1.5, 1.5
# An agent halts this far behind another that joins its lane [m].
BEHIND = 2.0
# In a roundabout, an agent above this share of the speed that the road allows drives freely.
FREELY = 0.85


class CrossingRules(NamedTuple):
    """
    How agents pass junctions.

    :param gap_after: time between another leaving a conflict and the agent getting there [s];
        own choice.
    :param gap_before: time between the agent leaving it and another getting there [s]
    :param merging: the same where a turn joins the lane of another agent, from when the agent's
        rear is past the start of the conflict [s]; benchmarks/capacity.py compares what minor
        roads carry with the Highway Capacity Manual.
    :param ring: the same where an agent enters a roundabout and the other drives freely in it [s]
    :param patience: standing time after which, among standing agents, the one that has stood
        longest goes first, whatever the right of way [s]; own choice.
    :param acceleration: with which agents expect to cross [m/s^2]
    :param gentle: braking that an agent with the right of way is expected to use, at most, behind
        one that merges before it [m/s^2]
    :param deceleration: hardest braking that others are expected to use to stop for the agent
        [m/s^2]
    :param withdrawal: hardest braking that agents use when they give up a grant [m/s^2]
    :param zipper: standing time at the end of a lane after which agents on the road let one merge,
        if they can slow down gently [s]; own choice.
    :param mercy: the same for an agent that turns or crosses [s]; own choice.
    :param room: behind the junction, besides the agent's own length [m]
    :param late: braking needed to halt before the junction at which a late driver notices that it
        has to yield; more than twice the comfortable one, little more than half of the hardest;
        own choice [m/s^2]
    """

    gap_after: float = 0.7
    gap_before: float = 2.0
    merging: float = 0.8
    ring: float = 1.0
    patience: float = 3.0
    acceleration: float = 1.3
    gentle: float = 2.0
    deceleration: float = 3.0
    withdrawal: float = 2.2
    zipper: float = 6.0
    mercy: float = 20.0
    room: float = 1.5
    late: float = 4.5


class Situation(NamedTuple):
    """
    The situation of agents (A) before their next junction.

    :param slots: (A) of the agents.
    :param desired: (A) desired speeds [m/s]
    :param rear_stop: (A) distance to where the leader's rear will be if it stops [m]
    :param light: (A) distance of the front from a line with a red light, or inf [m]
    :param stop_sign: (A) whether a stop sign stands before the junction.
    :param queued: (A) gap to the nearest vehicle that waits ahead and was not let in, or inf [m]
    """

    slots: IntArray
    desired: FloatArray
    rear_stop: FloatArray
    light: FloatArray
    stop_sign: BoolArray
    queued: FloatArray


class Meetings(NamedTuple):
    """
    Pairs (M) of an agent and another that comes to the same conflict, in the order of agents.

    :param begin: (A + 1) rows of each agent.
    :param other: (M) row of the other agent, or -1 - n for the n-th of the others.
    :param step: (M) of the agent's way.
    :param theirs: (M) step of the other's way.
    :param into: (M) distance of the agent's front from the conflict [m]
    :param priority: (M) of the agent, as in `ConflictTable`.
    :param apart: (M) whether both pass at different times anyway.
    :param inside: (M) whether the other is in the conflict.
    :param committed: (M) whether the other can no longer stop before it.
    :param courteous: (M) whether the other can let the agent go by slowing down gently.
    :param gentle: (M) whether the agent can let the other go in this way.
    :param tapers: (M) as in `ConflictTable`.
    :param behind: (M) distance of the agent's front from where it halts behind the other if that
        joins the agent's lane ahead of it and then halts gently, or inf [m]
    """

    begin: IntArray
    other: IntArray
    step: IntArray
    theirs: IntArray
    into: FloatArray
    priority: IntArray
    apart: BoolArray
    inside: BoolArray
    committed: BoolArray
    courteous: BoolArray
    gentle: BoolArray
    tapers: BoolArray
    behind: FloatArray


@compiled
def meet(conflicts: ConflictTable, rules: CrossingRules, agents: AgentTable, way: Ways,
         passage: Passages, arrivals: Arrivals, at: Situation, stays: BoolArray,
         first: BoolArray, next_in: BoolArray) -> Meetings:
    """
    Pair agents with all others that come to the same conflicts, and compare their times.

    :param stays: (A) whether an agent waits before a red light or a full junction: like one that
        waits inside, it comes to no conflict, and others pass if its front is in their spare room
        alone.
    :param first: (A) whether it is the first before a full junction: in a roundabout, agents that
        enter still yield to it.
    :param next_in: (A) whether the next free room behind a full junction is its own: no other
        agent takes it.
    """
    begin, row = _rows_of(arrivals, len(at.slots))
    room = 64 + 2 * len(arrivals.owner)
    while True:
        found = _empty(len(at.slots), room)
        room = _pair(conflicts, rules, agents, way, passage, arrivals, at, stays, first, next_in,
                     begin, row, found)
        if room <= len(found.other):
            return found


@bare
def _pair(conflicts: ConflictTable, rules: CrossingRules, agents: AgentTable, way: Ways,
          passage: Passages, arrivals: Arrivals, at: Situation, stays: BoolArray,
          first: BoolArray, next_in: BoolArray, begin: IntArray, row: IntArray,
          found: Meetings) -> int:
    """Write the meetings for which there is room; return how many there are."""
    used = 0
    for i, slot in enumerate(at.slots):
        for n in range(begin[i], begin[i + 1]):
            mine = row[n]
            if arrivals.step[mine] > max(passage.last[i], passage.granted[i]):
                continue
            conflict = arrivals.conflict[mine]
            counterpart = conflicts.other[conflict]
            for theirs in range(arrivals.begin[counterpart], arrivals.begin[counterpart + 1]):
                owner = arrivals.owner[theirs]
                if owner == i or not touch(
                        conflicts, conflict, agents.width[slot], arrivals.width[theirs]):
                    continue
                # Others may drive beside the middle of their lane.
                pair = extent(agents.width[slot], arrivals.width[theirs]) if owner >= 0 else 1
                if _has_entered(arrivals, mine, theirs, _into(conflicts, arrivals, mine, pair)):
                    continue
                if owner >= 0 and (stays[owner] or waits_inside(passage, owner)) \
                        and _into(conflicts, arrivals, theirs, pair) > -spare_room(
                            agents.width[slot], arrivals.width[theirs]) \
                        and not is_let_in(agents, at.slots[owner], passage, owner,
                                          arrivals.step[theirs]) \
                        and not (conflicts.merges[conflict] and (next_in[owner] or (
                            first[owner] and conflicts.priority[conflict] < -1))):
                    continue
                if used < len(found.other):
                    _compare(conflicts, rules, agents, arrivals, mine, theirs, pair, at, found,
                             used)
                used += 1
        found.begin[i + 1] = used
    return used


@bare
def is_let_in(agents: AgentTable, slot: int, passage: Passages, i: int, step: int) -> bool:
    """Return whether an agent was let into the junction at a step of its way."""
    return bool(agents.grant[slot] >= 0 and step <= passage.granted[i])


@compiled
def _rows_of(arrivals: Arrivals, count: int) -> tuple[IntArray, IntArray]:
    """Return where the arrivals of each agent (count + 1) begin, and the rows of arrivals."""
    begin = np.zeros(count + 1, np.int64)
    for owner in arrivals.owner:
        if owner >= 0:
            begin[owner + 1] += 1
    for i in range(count):
        begin[i + 1] += begin[i]
    fill, row = begin.copy(), np.empty(begin[count], np.int64)
    for n, owner in enumerate(arrivals.owner):
        if owner >= 0:
            row[fill[owner]] = n
            fill[owner] += 1
    return begin, row


@compiled
def _empty(agents: int, room: int) -> Meetings:
    return Meetings(
        np.zeros(agents + 1, np.int64), np.empty(room, np.int64), np.empty(room, np.int64),
        np.empty(room, np.int64), np.empty(room), np.empty(room, np.int64),
        np.empty(room, np.bool_), np.empty(room, np.bool_), np.empty(room, np.bool_),
        np.empty(room, np.bool_), np.empty(room, np.bool_), np.empty(room, np.bool_),
        np.empty(room))


@bare
def _into(conflicts: ConflictTable, arrivals: Arrivals, n: int, pair: int) -> float:
    """Return the distance of a front from its conflict [m], negative inside."""
    return float(arrivals.offset[n] - arrivals.half[n]
                 + conflicts.start[pair, arrivals.conflict[n]])


@bare
def _out(conflicts: ConflictTable, arrivals: Arrivals, n: int, pair: int) -> float:
    """Return the distance of a rear from the end of its conflict [m]."""
    return float(arrivals.offset[n] + arrivals.half[n] + conflicts.end[pair, arrivals.conflict[n]])


@inlined
def _has_entered(arrivals: Arrivals, n: int, other: int, into: float) -> bool:
    """
    Return whether a vehicle is in a conflict for good.

    An agent is not if its front is, or halts, where there is room for the other to pass: who waits
    before a conflict may stop a little late. Where the other does not pass, there was no room.

    :param n: row of its arrival, and of the other's.
    :param into: distance of its front from the conflict [m]
    """
    if into > 0.0 or arrivals.owner[n] < 0 or arrivals.speed[other] < QUEUEING:
        return into <= 0.0
    room = spare_room(arrivals.width[other], arrivals.width[n])
    return bool(into - arrivals.speed[n]**2 / (2.0 * FIRM) <= -room)


@inlined
def _can_let_go(into: float, speed: float, begun: bool) -> bool:
    """
    Return whether a vehicle can slow down gently, so that another goes first at a conflict.

    :param into: distance of its front from the conflict [m]
    :param begun: whether it does so already.
    """
    return into > (0.0 if begun else REACTION * speed) + speed**2 / (2.0 * GENTLE)


@bare
def _compare(conflicts: ConflictTable, rules: CrossingRules, agents: AgentTable,
             arrivals: Arrivals, mine: int, theirs: int, pair: int, at: Situation,
             found: Meetings, n: int) -> None:
    """Write the meeting of two arrivals, with the conflict's extent for both, into row n."""
    owner, conflict = arrivals.owner[theirs], arrivals.conflict[mine]
    into, out = (_into(conflicts, arrivals, theirs, pair), _out(conflicts, arrivals, theirs, pair))
    speed, here = arrivals.speed[theirs], _into(conflicts, arrivals, mine, pair)
    clear, leave, slower = out, _out(conflicts, arrivals, mine, pair), 0.0
    i, desired = arrivals.owner[mine], at.desired
    # Where a lane ends beside another, and in a dense roundabout, agents leave the whole conflict
    # free: a roundabout that is full would block its exits.
    ring = abs(conflicts.priority[conflict]) > 1
    joins = owner >= 0 and conflicts.merges[conflict] and not conflicts.tapers[conflict] and (
        not ring or speed > FREELY * min(arrivals.pace[theirs], desired[owner]))
    if joins:
        # The agent that is behind where the lanes come together follows the other from there on.
        clear, leave = into + 2.0 * arrivals.half[theirs], here + 2.0 * arrivals.half[mine]
        top = min(math.sqrt(speed**2 + 2.0 * rules.acceleration * max(into, 0.0)),
                  desired[owner], arrivals.pace[theirs])
        own = min(math.sqrt(arrivals.speed[mine]**2 + 2.0 * rules.acceleration * max(leave, 0.0)),
                  desired[i], arrivals.pace[mine])
        slower = max(top - own, 0.0)**2 / (2.0 * rules.gentle * max(top, 1.0))
    if owner < 0:
        early = math.inf if speed < QUEUEING and into > 0.0 else time_to(
            into, speed, rules.acceleration, speed)
        late = max(clear, 0.0) / max(speed, 0.1)
    else:
        early = max(time_to(into, speed, rules.acceleration, desired[owner]),
                    arrivals.soonest[theirs])
        # In a bend it is no faster than the bend allows.
        late = max(time_to(clear, speed, TIMID, max(0.8 * desired[owner], 2.0)),
                   clear / arrivals.pace[theirs])
        if joins and clear < 0.0:
            # It has been ahead for that time.
            late = clear / max(speed, 1.0)
    there = time_to(here, arrivals.speed[mine], HURRY, desired[i])
    gone = slower + time_to(leave, arrivals.speed[mine], rules.acceleration,
                            min(desired[i], arrivals.pace[mine]))
    found.other[n], found.into[n] = owner, here
    found.step[n], found.theirs[n] = arrivals.step[mine], arrivals.step[theirs]
    found.priority[n] = conflicts.priority[conflict]
    ahead = (rules.ring if ring else rules.merging) if joins else rules.gap_before
    found.apart[n] = there > late + rules.gap_after or gone + ahead < early
    found.inside[n] = out > 0.0 and _has_entered(arrivals, theirs, mine, into)
    found.committed[n] = into < speed**2 / (2.0 * rules.deceleration)
    found.courteous[n] = owner >= 0 and _can_let_go(
        into, speed, agents.blocker[at.slots[owner]] == at.slots[i])
    found.gentle[n] = _can_let_go(
        here, arrivals.speed[mine], owner >= 0 and agents.blocker[at.slots[i]] == at.slots[owner])
    found.tapers[n] = conflicts.tapers[conflict]
    found.behind[n] = here + max(speed**2 / (2.0 * AT_LINE) - clear - BEHIND, -BEFORE) if (
        joins and here > max(clear, 0.0)) else math.inf
