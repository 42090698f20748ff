# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is ahead of whom: the ways of all agents over several lanes, and what is on them."""

from typing import NamedTuple

import numpy as np

from crgame_ros.traffic.agents import FREE
from crgame_ros.traffic.compiled import compiled, inlined
from crgame_ros.traffic.lane_graph import FloatArray, IntArray
from crgame_ros.traffic.lane_table import LaneTable, nearest_row
from crgame_ros.traffic.placement import Entries, rear_within

MAX_LANES = 40
# Of what is in the way ahead so many are answered to, and so many that drive the same way.
MAX_AHEAD, MAX_LEADERS = 6, 2
# A vehicle this far behind the beginning of a body may still be beside it [m].
LONGEST = 25.0
SIDE_MARGIN = 0.15
# In a curve the corners of a vehicle swing out by at most this, its front keeps that in lane [m].
MAX_SWING = 1.0


class Ways(NamedTuple):
    """
    The lanes that agents (A) will drive, in steps (J).

    :param lane: (A, J) -1 behind the end of the way.
    :param offset: (A, J) from the agent's centre to the lane's beginning [m]; negative for the
        lane that it is in.
    :param depth: (A) steps of each way.
    :param horizon: (A) how far ahead it looks [m]
    """

    lane: IntArray
    offset: FloatArray
    depth: IntArray
    horizon: FloatArray


class Pairs(NamedTuple):
    """
    What is ahead of agents (P pairs), in the order of the agents.

    :param agent: (P) row of the agent.
    :param entry: (P) row of `Entries`.
    :param gap: (P) bumper to bumper [m]; negative where they overlap.
    :param distance: (P) from the agent's centre to the entry's rear [m]
    """

    agent: IntArray
    entry: IntArray
    gap: FloatArray
    distance: FloatArray


class Corridors(NamedTuple):
    """
    What agents (A) take of the road.

    :param owner: (A) the agents, as entries name them.
    :param length: (A) [m]
    :param front: (A) from the rear axle to the front bumper [m]
    :param low, high: (A) right and left edge, from the reference [m]
    """

    owner: IntArray
    length: FloatArray
    front: FloatArray
    low: FloatArray
    high: FloatArray


def look_distance(speed: FloatArray) -> FloatArray:
    """Give how far ahead an agent looks: it stops in half of that, comfortably [m]."""
    return np.asarray(50.0 + 3.0 * speed + speed**2 / 4.0)


@compiled
def ways(lanes: LaneTable, following: IntArray, lane: IntArray, s: FloatArray,
         destination: IntArray, horizon: FloatArray) -> Ways:
    """
    Follow the routes of agents (A) from where they are, each as far as it looks.

    :param following: (D, L) next lane to a destination, or -1 (`Routes.next`).
    """
    count = len(lane)
    way = Ways(np.full((count, MAX_LANES), -1, np.int64), np.zeros((count, MAX_LANES)),
               np.ones(count, np.int64), horizon)
    for i in range(count):
        current, offset = lane[i], -s[i]
        way.lane[i, 0], way.offset[i, 0] = current, offset
        for step in range(1, MAX_LANES):
            offset += lanes.length[current]
            current = following[destination[i], current]
            if current < 0 or offset >= horizon[i]:
                break
            way.lane[i, step], way.offset[i, step] = current, offset
            way.depth[i] = step + 1
    return way


@inlined
def first_from(entries: Entries, lane: int, rear: float) -> int:
    """Give the first row of a lane whose entry begins at an arc length or behind it."""
    low, high = entries.begin[lane], entries.begin[lane + 1]
    while low < high:
        middle = (low + high) // 2
        if entries.rear[middle] < rear:
            low = middle + 1
        else:
            high = middle
    return int(low)


@inlined
def swing(curvature: float, front: float) -> float:
    """
    Give by how much more than half its width a vehicle takes on either side in a curve [m].

    With its rear axle f^2 / (4 R) inside the middle, f the distance to its front, the rear's
    inner and the front's outer corner are equally far out.
    """
    return min(0.25 * abs(curvature) * front * front, MAX_SWING)


@compiled
def ahead(lanes: LaneTable, entries: Entries, way: Ways, corridor: Corridors,
          reference: FloatArray) -> Pairs:
    """
    Find what is ahead of each agent and in its way.

    :param reference: offset of the reference at each point of the lanes [m]; empty: none.
    """
    count = len(way.depth)
    agent, entry = np.empty(count * MAX_AHEAD, np.int64), np.empty(count * MAX_AHEAD, np.int64)
    distance = np.empty(count * MAX_AHEAD)
    used = 0
    for i in range(count):
        end = used + MAX_AHEAD
        leaders = 0
        for step in range(way.depth[i]):
            lane, offset = way.lane[i, step], way.offset[i, step]
            n = first_from(entries, lane, -offset - LONGEST)
            while n < entries.begin[lane + 1] and used < end and leaders < MAX_LEADERS and (
                    entries.rear[n] + offset < way.horizon[i]):
                rear = _in_the_way(lanes, entries, n, lane, offset, corridor, i, reference)
                if rear < np.inf:
                    agent[used], entry[used], distance[used] = i, n, rear + offset
                    used += 1
                    leaders += 0 if entries.crosses[n] else 1
                n += 1
            if used >= end or leaders >= MAX_LEADERS:
                break
    who = agent[:used].copy()
    return Pairs(who, entry[:used].copy(), distance[:used] - 0.5 * corridor.length[who],
                 distance[:used].copy())


@compiled
def _in_the_way(lanes: LaneTable, entries: Entries, n: int, lane: int, offset: float,
                corridor: Corridors, i: int, reference: FloatArray) -> float:
    """Give where an entry that is in an agent's way begins [m], inf for any other."""
    middle = 0.5 * (entries.rear[n] + entries.front[n])
    if middle + offset <= 0.0 or entries.owner[n] == corridor.owner[i]:
        return np.inf
    row = nearest_row(lanes, lane, min(max(middle, 0.0), lanes.length[lane]))
    shift = reference[row] if len(reference) else 0.0
    margin = SIDE_MARGIN + swing(lanes.line[row].curvature, corridor.front[i])
    return float(rear_within(entries, n, corridor.low[i] + shift - margin,
                             corridor.high[i] + shift + margin))


@compiled
def least(agent: IntArray, values: FloatArray, count: int, default: float) -> FloatArray:
    """Give the least value (count) of each agent, the default where there is none."""
    result = np.full(count, default)
    for i in range(len(agent)):
        result[agent[i]] = min(result[agent[i]], values[i])
    return result


@compiled
def nearest(pairs: Pairs, owner: IntArray, count: int) -> tuple[FloatArray, IntArray]:
    """Give the least gap (count) of each agent and whose it is; inf and `FREE` without one."""
    gap, leader = np.full(count, np.inf), np.full(count, FREE, np.int64)
    for p in range(len(pairs.agent)):
        i = pairs.agent[p]
        if pairs.gap[p] < gap[i]:
            gap[i], leader[i] = pairs.gap[p], owner[pairs.entry[p]]
    return gap, leader
