# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Crossing and merging: who goes first, by right of way and gap acceptance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crgame_ros.traffic.agents import Agents, NOBODY
from crgame_ros.traffic.conflicts import Conflicts
from crgame_ros.traffic.junctions import Arrivals, Passages, time_to
from crgame_ros.traffic.lane_cells import spans
from crgame_ros.traffic.lane_graph import FloatArray, IntArray
from crgame_ros.traffic.leaders import Ways

BoolArray = NDArray[np.bool_]

STANDING = 0.05


@dataclass(frozen=True)
class CrossingRules:
    """
    How agents pass junctions.

    :param gap_after: time between another leaving a conflict and the agent getting there [s];
        own choice.
    :param gap_before: time between the agent leaving it and another getting there [s]; the
        agent's own time included, a crossing of 6 s accepts the 7 s to 8 s that the Highway
        Capacity Manual 2010 (table 19-11) gives as critical gaps.
    :param patience: standing time after which whoever stands longest goes first, whatever the
        right of way among those who stand [s]; own choice.
    :param acceleration: with which agents expect to cross [m/s^2]
    :param deceleration: that others are expected to bear at most, to stop for the agent [m/s^2]
    :param zipper: standing time after which those on the road let one merge, if they can slow
        down gently [s]; own choice.
    :param room: behind the junction, besides the agent's own length [m]
    """

    gap_after: float = 0.7
    gap_before: float = 1.5
    patience: float = 3.0
    acceleration: float = 1.3
    deceleration: float = 3.0
    zipper: float = 6.0
    room: float = 1.5


@dataclass(frozen=True)
class _Meetings:
    """Pairs of an agent and somebody else who comes to the same conflict."""

    agent: IntArray
    who: IntArray
    into: FloatArray
    is_other: BoolArray
    priority: IntArray
    apart: BoolArray
    inside: BoolArray
    committed: BoolArray
    courteous: BoolArray


class Crossings:
    """
    Lets agents into junctions.

    An agent waits before a junction until it is let in. It is let in for all conflicts of the
    junction at once: when everybody who has the right of way, and everybody already let in, gets
    to them in sufficient time before or after it, and there is room behind. Among those let in
    whoever was first goes first. So nobody waits in a circle.

    :param conflicts: of the lanes.
    :param rules: of passing.
    :param time_step_s: Delta t_c [s]
    """

    def __init__(self, conflicts: Conflicts, rules: CrossingRules, time_step_s: float) -> None:
        self._conflicts = conflicts
        self._rules = rules
        self._patience = round(rules.patience / time_step_s)
        self._zipper = round(rules.zipper / time_step_s)
        self._second = max(1, round(1.0 / time_step_s))

    def halts(self, k: int, agents: Agents, slots: IntArray, way: Ways, passage: Passages,
              arrivals: Arrivals, others: Arrivals, desired: FloatArray, rear_stop: FloatArray,
              light: FloatArray, stop_sign: BoolArray, queued: FloatArray) -> FloatArray:
        """
        Let agents (A) in, and tell where the others halt.

        :param slots: (A) of the agents.
        :param desired: (A) desired speeds [m/s]
        :param rear_stop: (A) distance to where the leader's rear will be if it stops [m]
        :param light: (A) distance of the front from a line with a red light, or inf [m]
        :param stop_sign: (A) whether a stop sign stands before the junction.
        :param queued: (A) gap to the nearest who waits ahead and was not let in, or inf [m]
        :return: (A) distance of the front from where it has to halt, or inf [m]
        """
        speed, length = agents.speed[slots], agents.length[slots]
        self._release(agents, slots, way, passage)
        granted = agents.grant[slots] >= 0
        needed = speed**2 / (2.0 * np.maximum(passage.hold, 0.1))
        can_stop = (passage.hold > 0.0) & (needed < self._rules.deceleration)
        # Nobody is let in past somebody who waits before the same junction.
        stopped = np.minimum(light, queued) < passage.hold + 2.0
        near = passage.hold < 10.0 + 4.2 * speed
        full = rear_stop < passage.end + 0.5 * length + self._rules.room
        ready = (passage.first >= 0) & near & ~stopped & ~full & (
            ~stop_sign | ((agents.waits[slots] >= self._second) & (speed < STANDING)
                          & (passage.hold < 4.0)))
        inside = (passage.first >= 0) & ~granted & (passage.hold < -1.0)
        meeting = self._meet(agents, slots, way, passage, arrivals, others, desired,
                             stopped | full)
        count = len(slots)
        withdrawn = granted & can_stop & (stopped | _any(
            meeting, meeting.is_other & self._yields(meeting, agents, slots, granted), count))
        agents.grant[slots[withdrawn]] = NOBODY
        granted &= ~withdrawn
        blocked = _any(meeting, self._yields(meeting, agents, slots, granted), count)
        wants = ready & ~granted & ~blocked & ~inside
        wants &= ~_any(meeting, self._loses(meeting, agents, slots, wants), count)
        self._grant(k, agents, slots, way, passage, wants | inside)
        granted = agents.grant[slots] >= 0
        halt = np.where((passage.first >= 0) & ~granted & near, passage.hold, np.inf)
        return np.minimum(halt, self._inside_halt(meeting, agents, slots, granted, speed))

    def _release(self, agents: Agents, slots: IntArray, way: Ways, passage: Passages) -> None:
        """Take back what agents were granted that have passed their junction."""
        row = np.arange(len(slots))
        ahead = (way.lane == agents.until[slots][:, None]).any(axis=1)
        start = way.lane[row, np.maximum(passage.first, 0)]
        done = (agents.grant[slots] >= 0) & (~ahead | (passage.first < 0))
        # A lane may be on the way again later: then its beginning is the next junction's.
        done |= (agents.grant[slots] >= 0) & (passage.first > 0) & (
            passage.hold > 0.0) & (start != agents.entered[slots])
        agents.grant[slots[done]] = NOBODY

    def _grant(self, k: int, agents: Agents, slots: IntArray, way: Ways, passage: Passages,
               chosen: BoolArray) -> None:
        row = np.flatnonzero(chosen)
        agents.grant[slots[row]] = k
        agents.until[slots[row]] = way.lane[row, passage.last[row]]
        agents.entered[slots[row]] = way.lane[row, passage.first[row]]

    def _meet(self, agents: Agents, slots: IntArray, way: Ways, passage: Passages,
              arrivals: Arrivals, others: Arrivals, desired: FloatArray,
              stays: BoolArray) -> _Meetings:
        """Pair agents with everybody whose conflicts are theirs, and compare their times."""
        rules, conflicts = self._rules, self._conflicts
        mine = np.flatnonzero((passage.first[arrivals.who] >= 0) & (
            arrivals.step <= passage.last[arrivals.who]))
        who = np.concatenate((arrivals.who, others.who))
        conflict = np.concatenate((arrivals.conflict, others.conflict))
        order = np.argsort(conflict, kind='stable')
        wanted = conflicts.other[arrivals.conflict[mine]]
        first = np.searchsorted(conflict[order], wanted)
        row, place = spans(first, np.searchsorted(conflict[order], wanted, side='right') - first)
        theirs, ours = order[place], mine[row]
        agent, them = arrivals.who[ours], who[theirs]
        is_other = them < 0
        keep = (is_other | (them != agent)) & (arrivals.into[ours] > 0.0)
        # Who waits before a red light or a full junction comes to no conflict.
        keep &= is_other | ~stays[np.maximum(them, 0)] | (
            agents.grant[slots[np.maximum(them, 0)]] >= 0)
        ours, theirs, agent, them = ours[keep], theirs[keep], agent[keep], them[keep]
        is_other = is_other[keep]
        into, out, speed = (np.concatenate(pair)[theirs] for pair in (
            (arrivals.into, others.into), (arrivals.out, others.out),
            (arrivals.speed, others.speed)))
        top = np.where(is_other, speed, desired[np.maximum(them, 0)])
        early = np.where(is_other & (speed < 0.3) & (into > 0.0), np.inf,
                         time_to(into, speed, rules.acceleration, top))
        late = np.where(is_other, np.maximum(out, 0.0) / np.maximum(speed, 0.1),
                        time_to(out, speed, 0.7, np.maximum(0.8 * top, 2.0)))
        there = time_to(arrivals.into[ours], arrivals.speed[ours], 1.8, desired[agent])
        gone = time_to(arrivals.out[ours], arrivals.speed[ours], rules.acceleration,
                       desired[agent])
        apart = (there > late + rules.gap_after) | (gone + rules.gap_before < early)
        committed = into < speed**2 / (2.0 * rules.deceleration)
        joins = conflicts.merges[arrivals.conflict[ours]]
        courteous = ~is_other & joins & (into > 2.0 * speed + speed**2 / 3.0)
        return _Meetings(agent, them, arrivals.into[ours], is_other,
                         conflicts.priority[arrivals.conflict[ours]], apart,
                         (into <= 0.0) & (out > 0.0), committed, courteous)

    def _yields(self, meeting: _Meetings, agents: Agents, slots: IntArray,
                granted: BoolArray) -> BoolArray:
        """Tell in which meetings the agent lets the other go first."""
        them = np.maximum(meeting.who, 0)
        let_in = ~meeting.is_other & granted[them]
        waits, theirs = agents.waits[slots[meeting.agent]], agents.waits[slots[them]]
        # Among those who stand, whoever has stood for longest goes first.
        patient = ~meeting.is_other & ~let_in & (waits > self._patience) & (
            theirs > 0) & _first(waits, meeting.agent, theirs, them)
        patient |= meeting.courteous & (waits > self._zipper)
        right = (meeting.priority < 0) & ~patient
        sure = meeting.inside | (meeting.is_other & meeting.committed)
        return ~meeting.apart & (let_in | right | sure)

    def _loses(self, meeting: _Meetings, agents: Agents, slots: IntArray,
               wants: BoolArray) -> BoolArray:
        """Tell in which meetings of two who could both go now the agent lets the other go."""
        them = np.maximum(meeting.who, 0)
        both = ~meeting.is_other & wants[them] & wants[meeting.agent] & ~meeting.apart
        waits, theirs = agents.waits[slots[meeting.agent]], agents.waits[slots[them]]
        later = ~_first(waits, meeting.agent, theirs, them)
        long = np.maximum(waits, theirs) > self._patience
        return both & np.where(long | (meeting.priority == 0), later, meeting.priority < 0)

    def _inside_halt(self, meeting: _Meetings, agents: Agents, slots: IntArray,
                     granted: BoolArray, speed: FloatArray) -> FloatArray:
        """Let agents in a junction halt before a conflict whose other side is taken."""
        them = np.maximum(meeting.who, 0)
        key = agents.grant[slots] * agents.count + slots
        senior = ~meeting.is_other & granted[them] & (key[them] < key[meeting.agent])
        taken = meeting.is_other & (meeting.inside | meeting.committed)
        stop = granted[meeting.agent] & ~meeting.apart & (senior | taken)
        # Who cannot stop before it any more had better be quick.
        stop &= speed[meeting.agent]**2 / (2.0 * np.maximum(meeting.into, 0.1)) < 6.0
        result = np.full(len(slots), np.inf)
        np.minimum.at(result, meeting.agent[stop], meeting.into[stop])
        return result


def _any(meeting: _Meetings, holds: BoolArray, count: int) -> BoolArray:
    """Tell for which agents something holds in any meeting."""
    result = np.zeros(count, dtype=bool)
    result[meeting.agent[holds]] = True
    return result


def _first(waits: IntArray, agent: IntArray, theirs: IntArray, them: IntArray) -> BoolArray:
    """Tell whether an agent has stood longer than another; the lower number decides a tie."""
    return np.asarray((waits > theirs) | ((waits == theirs) & (agent < them)))
