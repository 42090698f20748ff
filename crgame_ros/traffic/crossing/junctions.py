# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Arrivals at conflicts: the passages of agents through junctions, and the ways of others."""

import math
from typing import NamedTuple

from crgame_ros.traffic.compiling.compiled import bare, compiled
from crgame_ros.traffic.crossing.stop_lines import HELD, NO_LIGHT, OPENED
from crgame_ros.traffic.fleet.agents import AgentTable
from crgame_ros.traffic.following.leaders import Ways
from crgame_ros.traffic.lanes.conflicts import ConflictTable, extent, NARROW
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray
from crgame_ros.traffic.lanes.lane_table import LaneTable, time_at
from crgame_ros.traffic.lanes.placement import Entries
import numpy as np
from numpy.typing import NDArray

# Agents do not wait inside a junction with less room than this before a conflict [m].
WAITING_ROOM = 15.0
# In a junction longer than an agent sees it waits with more room than this beyond its length [m].
BETWEEN = 3.0
# An agent whose front is farther than this behind its waiting place is inside the junction [m].
STARTED = -1.0
# An agent enters a junction to wait there if its front gets at least as far as this beyond its
# waiting place, and halts some way before the conflict [m]; it does not brake harder than this to
# stop at the waiting place instead [m/s^2].
ENTERED, BEFORE = 3.0, 0.3
FIRM = 3.0
# How far ahead others are predicted, at their present speed [s], plus this distance [m].
OTHERS_TIME = 8.0
OTHERS_REACH = 15.0
MAX_BRANCHES = 6


class Arrivals(NamedTuple):
    """
    The arrivals of vehicles at conflicts (R rows), in the order of the conflicts.

    :param begin: (C + 1) rows at which those of each conflict begin.
    :param owner: (R) row of the agent, or -1 - n for the n-th of the others.
    :param conflict: (R) row of `Conflicts`.
    :param offset: (R) distance of its centre from the start of the conflict's lane [m]
    :param half: (R) of its length [m]
    :param speed: (R) [m/s]
    :param width: (R) [m]
    :param step: (R) of the agent's way; 0 for others.
    :param soonest: (R) time until its front is in the conflict, as fast as limits and bends allow;
        0 for others [s]
    :param pace: (R) mean speed that they allow until its rear is out of the conflict; inf for
        others [m/s]
    """

    begin: IntArray
    owner: IntArray
    conflict: IntArray
    offset: FloatArray
    half: FloatArray
    speed: FloatArray
    width: FloatArray
    step: IntArray
    soonest: FloatArray
    pace: FloatArray


class Passages(NamedTuple):
    """
    The next junction on the way of each agent (A) to which it has no grant yet.

    :param granted: (A) step of the way at which the junctions end that it was let into, -1
        without one; `before` the same of the junction let into before, while it is still in it.
    :param first: (A) step of the way at which the next junction begins, -1 without one.
    :param last: (A) step at which it ends.
    :param hold: (A) distance of the agent's front from where it waits [m]
    :param inside: (A) the same where it waits in the middle for oncoming vehicles; `hold` where
        there is no such place [m]
    :param end: (A) distance of its centre from the end of the last conflict [m]
    :param ring: (A) whether the agent drives in a roundabout there, and all others yield to it.
    """

    granted: IntArray
    before: IntArray
    first: IntArray
    last: IntArray
    hold: FloatArray
    inside: FloatArray
    end: FloatArray
    ring: NDArray[np.bool_]


@compiled
def passages(conflicts: ConflictTable, lines: FloatArray, lights: IntArray, way: Ways,
             agents: AgentTable, slots: IntArray) -> Passages:
    """
    Find the next junction of each agent: lanes with conflicts and no room to wait in between.

    :param lines: (L) arc length of each lane's stop line [m], infinite without one.
    :param lights: (L) `StopLines.inside`
    """
    count = len(slots)
    result = Passages(
        np.full(count, -1, np.int64), np.full(count, -1, np.int64), np.full(count, -1, np.int64),
        np.full(count, -1, np.int64), np.full(count, math.inf), np.full(count, math.inf),
        np.full(count, -math.inf), np.zeros(count, np.bool_))
    _write_passages(conflicts, lines, lights, way, agents, slots, result)
    return result


@bare
def _write_passages(conflicts: ConflictTable, lines: FloatArray, lights: IntArray, way: Ways,
                    agents: AgentTable, slots: IntArray, result: Passages) -> None:
    for i, slot in enumerate(slots):
        wide = 1 if agents.width[slot] > NARROW else 0
        entry, leave = conflicts.entry[wide], conflicts.leave[wide]
        half = 0.5 * agents.length[slot]
        if agents.grant[slot] >= 0:
            for step in range(way.depth[i]):
                if agents.before[slot] >= 0 and way.lane[i, step] == agents.before_until[slot]:
                    result.before[i] = step
                if way.lane[i, step] == agents.until[slot]:
                    result.granted[i] = step
                    break
        behind = -math.inf
        for step in range(result.granted[i] + 1):
            if math.isfinite(entry[way.lane[i, step]]):
                behind = way.offset[i, step] + leave[way.lane[i, step]]
        widest, last, end = agents.length[slot] + BETWEEN, -1, 0.0
        for step in range(result.granted[i] + 1, way.depth[i]):
            lane = way.lane[i, step]
            if not math.isfinite(entry[lane]):
                continue
            room = way.offset[i, step] + entry[lane] - result.end[i]
            if result.first[i] < 0:
                if way.offset[i, step] + leave[lane] + half > 0.0:
                    result.first[i] = result.last[i] = step
                    result.hold[i] = _hold(
                        entry[lane], lines, way, i, step, behind + agents.length[slot]) - half
                    result.end[i] = way.offset[i, step] + leave[lane]
            elif room < WAITING_ROOM:
                if room > widest:
                    widest, last, end = room, result.last[i], result.end[i]
                result.last[i] = step
                result.end[i] = way.offset[i, step] + leave[lane]
            else:
                break
        if last >= 0 and result.end[i] + WAITING_ROOM > way.horizon[i]:
            # The junction may go on beyond the horizon: the agent plans to wait where there is
            # most room.
            result.last[i], result.end[i] = last, end
        if result.first[i] >= 0:
            result.inside[i] = _place_inside(conflicts, lights, way, agents, slot, result, i)
            result.ring[i] = _is_in_ring(conflicts, way, result, i)


@bare
def _is_in_ring(conflicts: ConflictTable, way: Ways, passage: Passages, i: int) -> bool:
    """Return `Passages.ring`."""
    for step in range(passage.first[i], passage.last[i] + 1):
        lane = way.lane[i, step]
        for row in range(conflicts.first[lane], conflicts.first[lane] + conflicts.rows[lane]):
            if conflicts.priority[row] < 2:
                return False
    return True


@bare
def _place_inside(conflicts: ConflictTable, lights: IntArray, way: Ways, agents: AgentTable,
                  slot: int, passage: Passages, i: int) -> float:
    """Return `Passages.inside`: before the first conflict with a lane not held at red."""
    hold, speed = passage.hold[i], agents.speed[slot]
    own = NO_LIGHT
    for step in range(passage.first[i], passage.last[i] + 1):
        if own == NO_LIGHT:
            own = lights[way.lane[i, step]]
    # An agent that could only stop hard goes on to the place inside, although the light changes.
    comes = own == OPENED or hold < speed**2 / (2.0 * FIRM)
    if own == NO_LIGHT or not (hold < STARTED or comes):
        return float(hold)
    half, place, yields = 0.5 * agents.length[slot], math.inf, False
    wide = extent(agents.width[slot], 0.0)
    for step in range(passage.first[i], passage.last[i] + 1):
        lane = way.lane[i, step]
        for row in range(conflicts.first[lane], conflicts.first[lane] + conflicts.rows[lane]):
            if lights[conflicts.lane[conflicts.other[row]]] == HELD or (
                    way.offset[i, step] + conflicts.end[1, row] + half < 0.0):
                continue
            place = min(place, way.offset[i, step] + conflicts.start[wide, row] - half - BEFORE)
            yields |= conflicts.priority[row] < 0
    return float(place if yields and (hold < STARTED or place > hold + ENTERED) else hold)


@bare
def waits_inside(passage: Passages, i: int) -> bool:
    """Return whether an agent is in a junction and waits there without having been let in."""
    return bool(passage.first[i] >= 0 and passage.hold[i] < STARTED < passage.inside[i])


@bare
def hold_before(entry: float) -> float:
    """Return the arc length on a lane at which fronts wait before its first conflict [m]."""
    return entry - 1.0 if entry > WAITING_ROOM else min(0.0, entry - 0.5)


@bare
def _hold(entry: float, lines: FloatArray, way: Ways, i: int, step: int, clear: float) -> float:
    """
    Return the distance of an agent's centre to where its front waits before a junction [m].

    :param clear: the same to where its front has to be for its rear to leave the junction before.
    """
    own = lines[way.lane[i, step]]
    if own <= entry - 0.5:
        return float(way.offset[i, step] + own)
    hold = max(hold_before(entry), min(clear - way.offset[i, step], entry - 1.0))
    hold += way.offset[i, step]
    if step > 0:
        line = lines[way.lane[i, step - 1]]
        if math.isfinite(line):
            hold = min(hold, way.offset[i, step - 1] + line)
    return float(hold)


@compiled
def arrivals(lanes: LaneTable, conflicts: ConflictTable, way: Ways, agents: AgentTable,
             slots: IntArray, entries: Entries, drives: NDArray[np.bool_],
             widths: FloatArray) -> Arrivals:
    """
    Return the arrivals at conflicts of agents, including the lane just left, and of others.

    Others may take any branch of the road.

    :param drives: (O) which of the others are vehicles.
    :param widths: (O) of the others [m]
    """
    lane, start = np.empty(MAX_BRANCHES**2, np.int64), np.empty(MAX_BRANCHES**2)
    room = _room(conflicts, way, agents, slots)
    room += _write_others(lanes, conflicts, entries, drives, widths, lane, start, _empty(0, 0), 0)
    found = _empty(0, room)
    used = _write_agents(lanes, conflicts, way, agents, slots, found)
    used = _write_others(lanes, conflicts, entries, drives, widths, lane, start, found, used)
    result = _empty(len(conflicts.lane), used)
    _write_by_conflict(found, used, np.zeros(len(conflicts.lane), np.int64), result)
    return result


@bare
def _write_agents(lanes: LaneTable, conflicts: ConflictTable, way: Ways, agents: AgentTable,
                  slots: IntArray, found: Arrivals) -> int:
    """Write the arrivals of agents; return how many there are."""
    used = 0
    for i, slot in enumerate(slots):
        half, factor = 0.5 * agents.length[slot], max(agents.factor[slot], 1.0)
        # Of the start of the lane, from the agent's centre [s].
        begins = -time_at(lanes, way.lane[i, 0], -way.offset[i, 0])
        for step in range(-1, way.depth[i]):
            if step < 0:
                lane = agents.previous[slot]
                offset = way.offset[i, 0] - lanes.length[lane] if lane >= 0 else 0.0
                lane_begins = begins - time_at(lanes, max(lane, 0), lanes.length[lane])
            else:
                lane, offset = way.lane[i, step], way.offset[i, step]
                lane_begins = begins
                begins += time_at(lanes, lane, lanes.length[lane])
            if lane >= 0:
                for row in range(conflicts.first[lane], conflicts.first[lane]
                                 + conflicts.rows[lane]):
                    if offset + conflicts.end[1, row] + half > 0.0:
                        soonest = lane_begins + time_at(
                            lanes, lane, max(conflicts.start[1, row] - half, 0.0))
                        leaves = lane_begins + time_at(lanes, lane, conflicts.end[1, row] + half)
                        pace = (offset + conflicts.end[1, row] + half) / max(leaves, 1e-3)
                        _note(found, used, i, row, offset, half, agents.speed[slot],
                              agents.width[slot], step, soonest / factor, pace * factor)
                        used += 1
    return used


@bare
def _write_others(lanes: LaneTable, conflicts: ConflictTable, entries: Entries,
                  drives: NDArray[np.bool_], widths: FloatArray, lane: IntArray,
                  start: FloatArray, found: Arrivals, used: int) -> int:
    """Write the arrivals of others; return how many there are with those before, room or not."""
    for n in range(len(entries.owner)):
        other = -1 - entries.owner[n]
        if other >= 0 and drives[other] and not entries.crosses[n] and entries.speed[n] > -0.5:
            used = _write_other(lanes, conflicts, entries, n, widths[other], lane, start, found,
                                used)
    return used


@bare
def _room(conflicts: ConflictTable, way: Ways, agents: AgentTable, slots: IntArray) -> int:
    room = 0
    for i, slot in enumerate(slots):
        if agents.previous[slot] >= 0:
            room += conflicts.rows[agents.previous[slot]]
        for step in range(way.depth[i]):
            room += conflicts.rows[way.lane[i, step]]
    return int(room)


@compiled
def _empty(conflicts: int, room: int) -> Arrivals:
    return Arrivals(np.zeros(conflicts + 1, np.int64), np.empty(room, np.int64),
                    np.empty(room, np.int64), np.empty(room), np.empty(room), np.empty(room),
                    np.empty(room), np.empty(room, np.int64), np.empty(room), np.empty(room))


@bare
def _note(found: Arrivals, n: int, owner: int, conflict: int, offset: float, half: float,
          speed: float, width: float, step: int, soonest: float, pace: float) -> None:
    found.owner[n], found.conflict[n], found.step[n] = owner, conflict, step
    found.offset[n], found.half[n], found.speed[n], found.width[n] = offset, half, speed, width
    found.soonest[n], found.pace[n] = soonest, pace


@bare
def _write_other(lanes: LaneTable, conflicts: ConflictTable, entries: Entries, n: int,
                 width: float, lane: IntArray, start: FloatArray, found: Arrivals,
                 used: int) -> int:
    """Write the conflicts that one of the others may come to, along all branches."""
    speed = max(entries.speed[n], 0.0)
    reach = OTHERS_REACH + OTHERS_TIME * speed
    half = 0.5 * (entries.front[n] - entries.rear[n])
    lane[0], start[0] = entries.lane[n], half - entries.front[n]
    pending, done = 1, 0
    while done < pending:
        current, offset = lane[done], start[done]
        done += 1
        for row in range(conflicts.first[current],
                         conflicts.first[current] + conflicts.rows[current]):
            if offset + conflicts.end[1, row] + half > 0.0:
                if used < len(found.owner):
                    _note(found, used, entries.owner[n], row, offset, half, speed, width, 0, 0.0,
                          math.inf)
                used += 1
        offset += lanes.length[current]
        if offset - half < reach:
            for onward in lanes.successors[current]:
                if onward >= 0 and pending < len(lane):
                    lane[pending], start[pending] = onward, offset
                    pending += 1
    return used


@bare
def _write_by_conflict(found: Arrivals, used: int, fill: IntArray, result: Arrivals) -> None:
    """Write arrivals sorted by conflict; those of one conflict keep their order."""
    for n in range(used):
        result.begin[found.conflict[n] + 1] += 1
    for row in range(len(fill)):
        fill[row] = result.begin[row]
        result.begin[row + 1] += result.begin[row]
    for n in range(used):
        row = found.conflict[n]
        _note(result, fill[row], found.owner[n], row, found.offset[n], found.half[n],
              found.speed[n], found.width[n], found.step[n], found.soonest[n], found.pace[n])
        fill[row] += 1


@bare
def time_to(distance: float, speed: float, acceleration: float, top: float) -> float:
    """Return the time to cover a distance when accelerating up to a top speed [s]; 0 if behind."""
    distance, top = max(distance, 0.0), max(top, speed, 0.5)
    gain = (top**2 - speed**2) / (2.0 * acceleration)
    if distance < gain:
        return (math.sqrt(speed**2 + 2.0 * acceleration * distance) - speed) / acceleration
    return (top - speed) / acceleration + (distance - gain) / top
