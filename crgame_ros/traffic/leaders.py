# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is ahead of whom: the ways of all agents over several lanes, and what is on them."""

from dataclasses import dataclass

import numpy as np

from crgame_ros.traffic.lane_cells import spans
from crgame_ros.traffic.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.placement import Entries
from crgame_ros.traffic.routes import Routes

MAX_LANES = 24
# Of what is ahead in one lane this many are looked at: those beside the way lead nobody.
MAX_AHEAD = 8
# A vehicle this far behind the beginning of a body may still be beside it [m].
LONGEST = 25.0
SIDE_MARGIN = 0.15


@dataclass(frozen=True)
class Ways:
    """
    The lanes that agents (A) will drive, in steps (J).

    :param lane: (A, J) -1 behind the end of the way.
    :param offset: (A, J) from the agent's centre to the lane's beginning [m]; negative for the
        lane that it is in.
    :param horizon: (A) how far ahead it looks [m]
    """

    lane: IntArray
    offset: FloatArray
    horizon: FloatArray

    @property
    def depth(self) -> int:
        """Number of steps J."""
        return int(self.lane.shape[1])

    def reach(self, graph: LaneGraph) -> FloatArray:
        """Give the distance (A) from each agent's centre to the end of its way [m]."""
        last = np.maximum((self.lane >= 0).sum(axis=1) - 1, 0)
        row = np.arange(len(last))
        return np.asarray(self.offset[row, last] + graph.length[self.lane[row, last]])


@dataclass(frozen=True)
class Pairs:
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


def look_distance(speed: FloatArray) -> FloatArray:
    """Give how far ahead an agent looks: it stops in half of that, comfortably [m]."""
    return np.asarray(30.0 + 3.0 * speed + speed**2 / 4.0)


def ways(graph: LaneGraph, routes: Routes, lane: IntArray, s: FloatArray,
         destination: IntArray, horizon: FloatArray) -> Ways:
    """Follow the routes of agents (A) from where they are, each as far as it looks."""
    lanes, offsets = [lane], [-s]
    current, offset = lane, -s
    for _ in range(MAX_LANES - 1):
        end = offset + graph.length[current]
        following = routes.next[destination, current]
        on = (lanes[-1] >= 0) & (following >= 0) & (end < horizon)
        if not on.any():
            break
        current = np.where(on, following, current)
        offset = np.where(on, end, offset)
        lanes.append(np.where(on, current, -1))
        offsets.append(offset)
    return Ways(np.stack(lanes, axis=1), np.stack(offsets, axis=1), horizon)


class LaneOrder:
    """
    Finds entries by lane and arc length.

    :param entries: in the order of lane and beginning.
    """

    def __init__(self, entries: Entries) -> None:
        self._stride = 1e6
        self._keys = entries.lane * self._stride + entries.rear

    def between(self, lane: IntArray, low: FloatArray, high: FloatArray,
                ) -> tuple[IntArray, IntArray]:
        """Give the rows (N), (N) from and up to which entries begin within [low, high)."""
        first = np.searchsorted(self._keys, lane * self._stride + np.maximum(low, -1e4))
        last = np.searchsorted(self._keys, lane * self._stride + np.minimum(high, 9e5))
        return first, last


def ahead(entries: Entries, order: LaneOrder, way: Ways, owner: IntArray, length: FloatArray,
          low: FloatArray, high: FloatArray, reference: FloatArray | None = None,
          limit: int = MAX_AHEAD) -> Pairs:
    """
    Find what is ahead of each agent and in its way.

    :param owner: (A) the agents, as entries name them.
    :param length: (A) of the agents [m]
    :param low: (A) right edge of what an agent takes, from the reference [m]
    :param high: (A) its left edge [m]
    :param reference: (E) offset of the reference in the entries' lanes where they are [m]
    :param limit: how many entries of a lane are looked at, the first ones.
    """
    count, depth = way.lane.shape
    agent = np.repeat(np.arange(count), depth)
    lane, offset = way.lane.ravel(), way.offset.ravel()
    used = np.flatnonzero(lane >= 0)
    agent, lane, offset = agent[used], lane[used], offset[used]
    first, last = order.between(lane, -offset - LONGEST, way.horizon[agent] - offset)
    row, entry = spans(first, np.minimum(last - first, limit + 4))
    who = agent[row]
    middle = 0.5 * (entries.rear[entry] + entries.front[entry]) + offset[row]
    shift = 0.0 if reference is None else reference[entry]
    blocks = (middle > 0.0) & (entries.owner[entry] != owner[who]) & (
        entries.low[entry] - shift < high[who] + SIDE_MARGIN) & (
        entries.high[entry] - shift > low[who] - SIDE_MARGIN)
    row, entry, who = row[blocks], entry[blocks], who[blocks]
    distance = entries.rear[entry] + offset[row]
    return Pairs(who, entry, distance - 0.5 * length[who], distance)


def least(agent: IntArray, values: FloatArray, count: int, default: float) -> FloatArray:
    """Give the least value (count) of each agent, the default where there is none."""
    result = np.full(count, default)
    np.minimum.at(result, agent, values)
    return result

