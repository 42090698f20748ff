# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Crossing and merging by right of way and gap acceptance."""

import math

from crgame_ros.traffic.compiling.compiled import bare, compiled
from crgame_ros.traffic.crossing.exit_room import (
    has_filled,
    is_full,
    promise,
    Promises,
    QUEUE_GAP,
)
from crgame_ros.traffic.crossing.junctions import (
    Arrivals,
    BEFORE,
    ENTERED,
    FIRM,
    Passages,
    STARTED,
    waits_inside,
)
from crgame_ros.traffic.crossing.meetings import (
    BoolArray,
    CrossingRules,
    GENTLE,
    is_let_in,
    meet,
    Meetings,
    REACTION,
    Situation,
)
from crgame_ros.traffic.fleet.agents import Agents, AgentTable, FREE, NONE
from crgame_ros.traffic.following.leaders import Ways
from crgame_ros.traffic.lanes.conflicts import Conflicts, ConflictTable
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray
from crgame_ros.vehicle.state import STANDING
import numpy as np

# An agent nearer than this to its waiting place is the first there [m].
AT_LINE = 3.0
# An agent that opens a circle of waiting agents moves up by at least this [m].
MOVES_UP = 2.0
# A grant ends this far behind its junction [m].
PASSED = 1.0


class Crossings:
    """
    The admission of agents to junctions.

    An agent waits before a junction until it is let in. It is let in for all conflicts of the
    junction at once. This happens when all vehicles that have the right of way, and all already
    let in, pass the conflicts in sufficient time before or after it, and there is room behind the
    junction. Agents are let in one after the other. Among agents that were let in, the one let in
    first goes first. `waiting` finds agents that wait for each other in a circle.

    Where lights hold the cross traffic, an agent that yields to oncoming vehicles waits for them
    in the middle, so that it leaves the junction when the light changes at the latest.

    :param conflicts: of the lanes.
    :param rules: of passing.
    :param time_step_s: Delta t_c [s]
    """

    def __init__(self, conflicts: Conflicts, rules: CrossingRules, time_step_s: float) -> None:
        self._conflicts = conflicts.table
        self._rules = rules
        self._ticks = np.array([max(1, round(seconds / time_step_s)) for seconds in (
            rules.patience, rules.zipper, 1.0, rules.mercy)])

    def halts(self, k: int, agents: Agents, way: Ways, passage: Passages, arrivals: Arrivals,
              situation: Situation, elapsed_s: float) -> tuple[FloatArray, BoolArray]:
        """
        Update the grants of agents (A) at junctions, and return where the others halt.

        The agent for which one halts is written to `Agents.blocker`.

        :param elapsed_s: time since the last call [s]
        :return: (A) distance of the front from where it has to halt, or inf [m], and (A) whether
            an agent is the first before a junction behind which there is no room.
        """
        return _halts(self._conflicts, self._rules, self._ticks, elapsed_s, k,
                      agents.table, way, passage, arrivals, situation)


@compiled
def _halts(conflicts: ConflictTable, rules: CrossingRules, ticks: IntArray, dt_s: float, k: int,
           agents: AgentTable, way: Ways, passage: Passages, arrivals: Arrivals,
           at: Situation) -> tuple[FloatArray, BoolArray]:
    slots, count = at.slots, len(at.slots)
    promised = Promises(np.zeros(len(conflicts.first)), np.zeros(len(conflicts.first)))
    stopped, full = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    _look(rules, dt_s, k, agents, way, passage, at, promised, stopped, full)
    # Other agents leave the room behind the junction to an agent that has waited very long.
    first = full & ~stopped
    next_in = first & (agents.waits[slots] > ticks[3])
    meeting = meet(conflicts, rules, agents, way, passage, arrivals, at, stopped | full, first,
                   next_in)
    halt = np.full(count, math.inf)
    _decide(rules, ticks, k, agents, way, passage, meeting, at, promised,
            _in_turn(k, agents, slots), stopped, full, halt)
    return halt, full & ~stopped & (passage.first >= 0) & (passage.hold < AT_LINE)


@bare
def _look(rules: CrossingRules, dt_s: float, k: int, agents: AgentTable, way: Ways,
          passage: Passages, at: Situation, promised: Promises, stopped: BoolArray,
          full: BoolArray) -> None:
    """End grants; write the room promised, and what keeps agents from entering."""
    slots = at.slots
    _release(agents, slots, way, dt_s)
    _see_junctions(rules, agents, slots, passage, dt_s)
    for i, slot in enumerate(slots):
        if agents.grant[slot] >= 0:
            promise(promised, agents, slot, way, passage.granted[i], i)
        elif waits_inside(passage, i):
            promise(promised, agents, slot, way, passage.last[i], i)
    for i, slot in enumerate(slots):
        # No agent is let in past another that waits before the same junction.
        stopped[i] = _is_stopped(at, i, passage.hold[i])
        full[i] = is_full(k, rules, promised, agents, slot, way, passage, at, i)


@bare
def _decide(rules: CrossingRules, ticks: IntArray, k: int, agents: AgentTable, way: Ways,
            passage: Passages, meeting: Meetings, at: Situation, promised: Promises,
            in_turn: IntArray, stopped: BoolArray, full: BoolArray, halt: FloatArray) -> None:
    """Withdraw grants and give new ones, in turn; write where agents (A) halt."""
    slots = at.slots
    for i, slot in enumerate(slots):
        agents.blocker[slot] = FREE
        if agents.grant[slot] >= 0 and _withdraws(rules, ticks, k, agents, passage, meeting, at,
                                                  i):
            agents.grant[slot] = agents.before[slot] = NONE
            halt[i] = agents.grant_hold[slot]
    for i in in_turn:
        slot = slots[i]
        if passage.first[i] < 0 or halt[i] < math.inf:
            continue
        # Agents let in before it take room as well.
        full[i] = full[i] or is_full(k, rules, promised, agents, slot, way, passage, at, i)
        if passage.inside[i] < STARTED and not stopped[i] or _may_enter(
                rules, ticks, k, agents, passage, meeting, at, stopped, full, i):
            if not waits_inside(passage, i):
                promise(promised, agents, slot, way, passage.last[i], i)
            _grant(k, agents, slot, way, passage, i)
    for i, slot in enumerate(slots):
        if agents.grant[slot] >= 0:
            halt[i] = min(halt[i], _inside_halt(k, agents, passage, meeting, at, i))
        if passage.first[i] >= 0 and _is_near(agents.speed[slot], passage.hold[i]) and (
                stopped[i] or full[i] or _heeds(agents, slot)):
            halt[i] = min(halt[i], _waiting_place(ticks, k, agents, passage, meeting, at,
                                                  stopped[i] or full[i], i))


@bare
def _grant(k: int, agents: AgentTable, slot: int, way: Ways, passage: Passages, i: int) -> None:
    """Grant an agent its next junction, so that it no longer waits before it."""
    if agents.grant[slot] < 0:
        agents.grant_hold[slot] = passage.hold[i]
    else:
        # It keeps its rank in the junction that it is in.
        agents.before[slot], agents.before_until[slot] = agents.grant[slot], agents.until[slot]
        passage.before[i] = passage.granted[i]
    agents.grant[slot] = k
    agents.until[slot] = way.lane[i, passage.last[i]]
    agents.grant_left[slot] = passage.end[i] + 0.5 * agents.length[slot]
    passage.granted[i], passage.first[i] = passage.last[i], -1


@bare
def _is_near(speed: float, hold: float) -> bool:
    """Return whether a junction is so near that an agent asks to be let in, or lets others in."""
    return hold < 10.0 + REACTION * speed + speed * speed / (2.0 * GENTLE)


@bare
def _release(agents: AgentTable, slots: IntArray, way: Ways, dt_s: float) -> None:
    """End the grants of agents that have passed their junction."""
    for i, slot in enumerate(slots):
        if agents.grant[slot] < 0:
            continue
        # The same lane may come again later on the way, so the distance counts as well.
        agents.grant_left[slot] -= agents.speed[slot] * dt_s
        agents.grant_hold[slot] -= agents.speed[slot] * dt_s
        ahead = False
        for step in range(way.depth[i]):
            ahead |= way.lane[i, step] == agents.until[slot]
        if not ahead or agents.grant_left[slot] < -PASSED:
            agents.grant[slot], agents.sees[slot] = NONE, False
            agents.before[slot] = NONE


@bare
def _is_stopped(at: Situation, i: int, hold: float) -> bool:
    """Return whether a red light or a queue stops an agent before its hold [m], or close by."""
    return bool(min(at.light[i], at.queued[i]) < max(hold, 0.0) + 2.0)


@bare
def _see_junctions(rules: CrossingRules, agents: AgentTable, slots: IntArray, passage: Passages,
                   dt_s: float) -> None:
    """Mark when late drivers notice a junction: at the last tick at which hard braking helps."""
    for i, slot in enumerate(slots):
        hold = agents.grant_hold[slot] if agents.grant[slot] >= 0 else passage.hold[i]
        speed = agents.speed[slot]
        if agents.late[slot] and speed**2 > 2.0 * rules.late * (hold - speed * dt_s):
            agents.sees[slot] = True


@bare
def _heeds(agents: AgentTable, slot: int) -> bool:
    """Return whether an agent obeys the right of way: a late one does once it has noticed."""
    return bool(agents.sees[slot] or not agents.late[slot])


@compiled
def _in_turn(k: int, agents: AgentTable, slots: IntArray) -> IntArray:
    """Return the order of agents: those that insist, then longest standing, then lower number."""
    key = np.empty(len(slots))
    for i, slot in enumerate(slots):
        key[i] = -agents.waits[slot] - (1e9 if agents.insists_until[slot] > k else 0.0)
    return np.argsort(key, kind='mergesort')


@bare
def _withdraws(rules: CrossingRules, ticks: IntArray, k: int, agents: AgentTable,
               passage: Passages, meeting: Meetings, at: Situation, i: int) -> bool:
    """Return whether an agent gives up its grant; only a late driver does so by hard braking."""
    slot = at.slots[i]
    speed, hold = agents.speed[slot], agents.grant_hold[slot]
    easy = speed**2 <= 2.0 * rules.withdrawal * hold
    if _is_stopped(at, i, hold) and (hold > 0.0 and easy or speed < STANDING):
        # Otherwise it would block all others for as long as its own light is red.
        return True
    if hold <= 0.0 or not (agents.sees[slot] if agents.late[slot] else easy):
        return False
    if easy and has_filled(k, rules, agents, at, i):
        return True
    for n in range(meeting.begin[i], meeting.begin[i + 1]):
        if meeting.other[n] < 0 and meeting.step[n] <= passage.granted[i] and _yields(
                ticks, k, agents, passage, meeting, at, i, n):
            return True
    return False


@bare
def _may_enter(rules: CrossingRules, ticks: IntArray, k: int, agents: AgentTable,
               passage: Passages, meeting: Meetings, at: Situation, stopped: BoolArray,
               full: BoolArray, i: int) -> bool:
    """Return whether an agent is let in now; write what it waits for otherwise."""
    slot = at.slots[i]
    speed = agents.speed[slot]
    if not _is_near(speed, passage.hold[i]):
        return False
    if stopped[i] or full[i]:
        agents.blocker[slot] = agents.leader[slot]
        return False
    if at.stop_sign[i] and (agents.waits[slot] < ticks[2] or speed >= STANDING
                            or passage.hold[i] >= 4.0):
        return False
    insists = agents.insists_until[slot] > k
    for n in range(meeting.begin[i], meeting.begin[i + 1]):
        if insists and meeting.inside[n] and meeting.into[n] > BEFORE + MOVES_UP:
            # It halts behind the other, in the junction.
            continue
        if meeting.step[n] > passage.granted[i] and (
                _yields(ticks, k, agents, passage, meeting, at, i, n)
                or _has_mercy(ticks, k, agents, meeting, at, i, n)):
            other = meeting.other[n]
            agents.blocker[slot] = at.slots[other] if other >= 0 else other
            return False
    return True


@bare
def _waiting_place(ticks: IntArray, k: int, agents: AgentTable, passage: Passages,
                   meeting: Meetings, at: Situation, stays: bool, i: int) -> float:
    """
    Return the distance at which an agent that is not let in halts: before or in a junction [m].

    :param stays: whether a light, a queue or a full junction keeps it from entering.
    """
    hold, place = passage.hold[i], passage.inside[i]
    enters = hold >= STARTED
    if place <= hold or (enters and stays):
        return float(hold)
    for n in range(meeting.begin[i], meeting.begin[i + 1]):
        if meeting.step[n] > passage.granted[i] and meeting.into[n] - BEFORE < place and _yields(
                ticks, k, agents, passage, meeting, at, i, n):
            place = meeting.into[n] - BEFORE
    if enters and min(place, at.queued[i] - QUEUE_GAP) < hold + ENTERED:
        return float(hold)
    return float(place)


@bare
def _has_mercy(ticks: IntArray, k: int, agents: AgentTable, meeting: Meetings, at: Situation,
               i: int, n: int) -> bool:
    """Return whether an agent lets another go first that has waited very long."""
    other = meeting.other[n]
    if other < 0 or meeting.apart[n] or not meeting.gentle[n] or (
            agents.insists_until[at.slots[i]] > k):
        return False
    waits = agents.waits[at.slots[other]]
    return bool(waits > ticks[3] and waits > agents.waits[at.slots[i]])


@bare
def _yields(ticks: IntArray, k: int, agents: AgentTable, passage: Passages, meeting: Meetings,
            at: Situation, i: int, n: int) -> bool:
    """Return whether an agent lets the other of a meeting go first."""
    if meeting.apart[n]:
        return False
    slot, other = at.slots[i], meeting.other[n]
    if meeting.inside[n]:
        return True
    if other < 0:
        return bool(meeting.committed[n] or meeting.priority[n] < 0)
    them = at.slots[other]
    if agents.insists_until[slot] > k and agents.speed[them] < 1.0:
        return False
    if is_let_in(agents, them, passage, other, meeting.theirs[n]):
        return True
    waits, theirs = agents.waits[slot], agents.waits[them]
    # Of two standing agents the one that has stood longer goes first.
    longer = waits > theirs or (waits == theirs and i < other)
    patient = meeting.priority[n] > -2 and waits > ticks[0] and theirs > 0 and longer
    patient |= meeting.courteous[n] and waits > (ticks[1] if meeting.tapers[n] else ticks[3])
    return bool(meeting.priority[n] < 0 and not patient)


@bare
def _inside_halt(k: int, agents: AgentTable, passage: Passages, meeting: Meetings,
                 at: Situation, i: int) -> float:
    """
    Return the distance at which an agent that was let in halts, in a junction or behind it [m].

    It halts before a conflict that is taken, and behind an agent that has joined its lane ahead.
    """
    slot = at.slots[i]
    result = joined = math.inf
    for n in range(meeting.begin[i], meeting.begin[i + 1]):
        other = meeting.other[n]
        joins = meeting.behind[n] < joined
        # An agent that cannot stop before the conflict any more drives on.
        halts = not meeting.apart[n] and meeting.into[n] < result and (
            agents.speed[slot]**2 <= 8.0 * max(meeting.into[n], 0.1))
        if not ((joins or halts) and _goes_first(k, agents, passage, meeting, at, i, n)):
            continue
        if joins:
            joined = meeting.behind[n]
        if halts:
            result = meeting.into[n]
            agents.blocker[slot] = at.slots[other] if other >= 0 else other
    # The room before the conflict gets smaller rather than that the agent brakes hard for it.
    result = max(result - BEFORE, min(result, agents.speed[slot]**2 / (2.0 * FIRM)))
    return min(result, joined)


@bare
def _goes_first(k: int, agents: AgentTable, passage: Passages, meeting: Meetings, at: Situation,
                i: int, n: int) -> bool:
    """Return whether the other of a meeting goes before an agent that was let in."""
    other = meeting.other[n]
    if meeting.step[n] > passage.granted[i]:
        return False
    if other < 0:
        return bool(meeting.inside[n] or meeting.committed[n])
    return bool(meeting.inside[n]
                or is_let_in(agents, at.slots[other], passage, other, meeting.theirs[n])
                and _is_senior(k, agents, passage, meeting, at, i, n))


@bare
def _is_senior(k: int, agents: AgentTable, passage: Passages, meeting: Meetings, at: Situation,
               i: int, n: int) -> bool:
    """Return whether the other of a meeting goes before an agent, both having been let in."""
    other = meeting.other[n]
    slot, them = at.slots[i], at.slots[other]
    grant = _admission_tick(agents, slot, passage, i, meeting.step[n])
    theirs = _admission_tick(agents, them, passage, other, meeting.theirs[n])
    if agents.insists_until[slot] > k and agents.speed[them] < 1.0:
        return False
    return bool(theirs < grant or (theirs == grant and them < slot))


@bare
def _admission_tick(agents: AgentTable, slot: int, passage: Passages, i: int, step: int) -> int:
    """Return the tick at which an agent was let into the junction at a step of its way."""
    in_first = agents.before[slot] >= 0 and step <= passage.before[i]
    return int(agents.before[slot] if in_first else agents.grant[slot])
