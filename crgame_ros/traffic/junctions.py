# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who will be in which conflict when: the passages of agents, and the ways of all others."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crgame_ros.traffic.conflicts import Conflicts, WAITING_ROOM
from crgame_ros.traffic.lane_cells import spans
from crgame_ros.traffic.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.leaders import Ways
from crgame_ros.traffic.placement import Entries

# How far ahead others are expected, at their present speed [s]; and how much farther [m].
OTHERS_TIME = 8.0
OTHERS_REACH = 15.0
MAX_BRANCHES = 6


@dataclass(frozen=True)
class Arrivals:
    """
    Who comes to which conflict (R rows).

    :param who: (R) row of the agent, or -1 - n for the n-th of the others.
    :param conflict: (R) row of `Conflicts`.
    :param into: (R) distance of its front from the conflict [m], negative inside.
    :param out: (R) distance of its rear from the conflict's end [m]
    :param speed: (R) [m/s]
    :param step: (R) of the agent's way; 0 for others.
    """

    who: IntArray
    conflict: IntArray
    into: FloatArray
    out: FloatArray
    speed: FloatArray
    step: IntArray


@dataclass(frozen=True)
class Passages:
    """
    The next junction on the way of each agent (A).

    :param first: (A) step of the way at which it begins, -1 without one.
    :param last: (A) at which it ends.
    :param hold: (A) distance of the agent's front from where it waits [m]
    :param end: (A) distance of its centre from the end of the last conflict [m]
    """

    first: IntArray
    last: IntArray
    hold: FloatArray
    end: FloatArray


def passages(graph: LaneGraph, conflicts: Conflicts, lines: FloatArray, way: Ways,
             length: FloatArray) -> Passages:
    """
    Find the next junction of each agent: lanes with conflicts and no room to wait in between.

    :param lines: (L) arc length of each lane's stop line [m], infinite without one.
    :param length: (A) of the agents [m]
    """
    lane = np.maximum(way.lane, 0)
    has = (way.lane >= 0) & (conflicts.count[lane] > 0)
    coming = has & (way.offset + conflicts.leave[lane] + 0.5 * length[:, None] > 0.0)
    row = np.arange(len(lane))
    any_coming = coming.any(axis=1)
    first = np.where(any_coming, np.argmax(coming, axis=1), -1)
    last = first.copy()
    for step in range(1, way.depth):
        joined = (last == step - 1) & has[:, step] & (
            conflicts.entry[lane[:, step]] < WAITING_ROOM)
        last = np.where(joined, step, last)
    start = lane[row, np.maximum(first, 0)]
    entry = conflicts.entry[start]
    hold = np.where(entry > WAITING_ROOM, entry - 1.0, np.minimum(0.0, entry - 0.5))
    hold = way.offset[row, np.maximum(first, 0)] + hold
    before = np.maximum(first - 1, 0)
    line = way.offset[row, before] + lines[lane[row, before]]
    hold = np.where((first > 0) & np.isfinite(line), np.minimum(line, hold), hold)
    final = np.maximum(last, 0)
    end = way.offset[row, final] + conflicts.leave[lane[row, final]]
    return Passages(first, last, np.where(any_coming, hold - 0.5 * length, np.inf),
                    np.where(any_coming, end, -np.inf))


def agent_arrivals(graph: LaneGraph, conflicts: Conflicts, way: Ways, previous: IntArray,
                   speed: FloatArray, length: FloatArray) -> Arrivals:
    """
    List the conflicts on the ways of agents, that of the lane just left included.

    :param previous: (A) lane that each was in before its present one, or -1.
    """
    behind = np.where(previous >= 0, way.offset[:, 0] - graph.length[previous], 0.0)
    lane = np.concatenate((previous[:, None], way.lane), axis=1)
    offset = np.concatenate((behind[:, None], way.offset), axis=1)
    used = np.flatnonzero((lane.ravel() >= 0) & (conflicts.count[lane.ravel()] > 0))
    who, step = np.divmod(used, lane.shape[1])
    at, offsets = lane.ravel()[used], offset.ravel()[used]
    row, conflict = spans(conflicts.first[at], conflicts.count[at])
    who, step, offsets = who[row], step[row] - 1, offsets[row]
    into = offsets + conflicts.start[conflict] - 0.5 * length[who]
    out = offsets + conflicts.end[conflict] + 0.5 * length[who]
    keep = out > 0.0
    return Arrivals(who[keep], conflict[keep], into[keep], out[keep], speed[who[keep]],
                    step[keep])


def other_arrivals(graph: LaneGraph, conflicts: Conflicts, entries: Entries,
                   drives: NDArray[np.bool_]) -> Arrivals:
    """
    List the conflicts that others may come to, by whatever way they go on.

    :param drives: (O) which of the others are vehicles.
    """
    other = -1 - entries.owner
    mine = np.flatnonzero((entries.owner < 0) & ~entries.crosses & (entries.speed > -0.5))
    mine = mine[drives[other[mine]]]
    lane, owner, speed = entries.lane[mine], entries.owner[mine], np.maximum(
        entries.speed[mine], 0.0)
    # Distances to the lane's beginning, of the front and of the rear.
    front, rear = -entries.front[mine], -entries.rear[mine]
    parts = []
    for _ in range(MAX_BRANCHES):
        row, conflict = spans(conflicts.first[lane], conflicts.count[lane])
        parts.append((owner[row], conflict, front[row] + conflicts.start[conflict],
                      rear[row] + conflicts.end[conflict], speed[row]))
        front, rear = front + graph.length[lane], rear + graph.length[lane]
        branch, column = np.nonzero((graph.successors[lane] >= 0) & (
            front < OTHERS_REACH + OTHERS_TIME * speed)[:, None])
        lane = graph.successors[lane[branch], column]
        owner, speed, front, rear = owner[branch], speed[branch], front[branch], rear[branch]
        if not len(lane):
            break
    who, conflict, into, out, speed = (np.concatenate([p[i] for p in parts]) for i in range(5))
    keep = out > 0.0
    return Arrivals(who[keep], conflict[keep].astype(np.int64), into[keep], out[keep],
                    speed[keep], np.zeros(int(keep.sum()), dtype=np.int64))


def time_to(distance: FloatArray, speed: FloatArray, acceleration: float,
            top: FloatArray) -> FloatArray:
    """Give the time to cover distances when accelerating up to top speeds [s]; 0 if behind."""
    distance, top = np.maximum(distance, 0.0), np.maximum(np.maximum(top, speed), 0.5)
    gain = (top**2 - speed**2) / (2.0 * acceleration)
    rising = (np.sqrt(speed**2 + 2.0 * acceleration * distance) - speed) / acceleration
    steady = (top - speed) / acceleration + (distance - gain) / top
    return np.asarray(np.where(distance < gain, rising, steady))
