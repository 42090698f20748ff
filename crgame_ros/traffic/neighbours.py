# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who drives in the lane beside an agent: the gap it would change into."""

from dataclasses import dataclass

import numpy as np

from crgame_ros.traffic.agents import Agents
from crgame_ros.traffic.lane_cells import spans
from crgame_ros.traffic.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.leaders import ahead, LaneOrder, look_distance, ways
from crgame_ros.traffic.placement import Entries
from crgame_ros.traffic.routes import Routes

LOOK_BEHIND = 120.0
MAX_LANES_BEHIND = 5
# Of the entries that begin behind an agent in one lane the last ones are looked at.
LAST = 3


@dataclass(frozen=True)
class Beside:
    """
    The lanes beside agents (N), and who is ahead and behind there.

    :param lane: (N)
    :param s: (N) of the agent's centre there [m]
    :param d: (N) [m]
    :param turn: (N) its heading against the lane's [rad]
    :param lead_gap: (N) bumper to bumper, inf where nobody is ahead [m]
    :param lead_speed: (N) [m/s]
    :param leader: (N) row of `Entries` of who is ahead, -1 where nobody is.
    :param follow_gap: (N) bumper to bumper, inf where nobody is behind [m]
    :param follow_speed: (N) [m/s]
    :param follower: (N) the agent behind; -1 where there is none or it is no agent.
    """

    lane: IntArray
    s: FloatArray
    d: FloatArray
    turn: FloatArray
    lead_gap: FloatArray
    lead_speed: FloatArray
    leader: IntArray
    follow_gap: FloatArray
    follow_speed: FloatArray
    follower: IntArray


def look_beside(graph: LaneGraph, routes: Routes, agents: Agents, slots: IntArray,
                lane: IntArray, entries: Entries, order: LaneOrder) -> Beside:
    """
    Look into the lanes beside agents.

    :param slots: (N) the agents.
    :param lane: (N) the lane beside each.
    """
    center = agents.centers()[slots]
    guess = agents.s[slots] * graph.length[lane] / graph.length[agents.lane[slots]]
    s, d, yaw = graph.project(lane, center[:, 0], center[:, 1], guess)
    count, half = len(slots), 0.5 * agents.width[slots]
    horizon = look_distance(agents.speed[slots])
    way = ways(graph, routes, lane, s, agents.destination[slots], horizon)
    pairs = ahead(entries, order, way, slots, agents.length[slots], -half, half)
    lead_gap, lead_speed = np.full(count, np.inf), np.zeros(count)
    leader = np.full(count, -1, dtype=np.int64)
    for_row = np.lexsort((pairs.gap, pairs.agent))
    who, place = np.unique(pairs.agent[for_row], return_index=True)
    lead_gap[who] = pairs.gap[for_row[place]]
    leader[who] = pairs.entry[for_row[place]]
    lead_speed[who] = entries.speed[leader[who]]
    gap, row = _behind(graph, agents, slots, lane, s, entries, order)
    known = row >= 0
    speed = np.where(known, entries.speed[np.maximum(row, 0)], 0.0) if len(entries) else gap * 0.0
    owner = entries.owner[np.maximum(row, 0)] if len(entries) else np.full(count, -1)
    return Beside(lane, s, d, center[:, 2] - yaw, lead_gap, lead_speed, leader, gap,
                  speed, np.where(known & (owner >= 0), owner, -1))


def _behind(graph: LaneGraph, agents: Agents, slots: IntArray, lane: IntArray, s: FloatArray,
            entries: Entries, order: LaneOrder) -> tuple[FloatArray, IntArray]:
    """Find who is next behind each agent, in the lane or those that lead to it."""
    count, half = len(slots), 0.5 * agents.width[slots]
    rear = -0.5 * agents.length[slots]
    best, entry_of = np.full(count, np.inf), np.full(count, -1, dtype=np.int64)
    agent, current, offset = np.arange(count), lane, -s
    for _ in range(MAX_LANES_BEHIND):
        # Arc lengths of the lane that are behind the agent's centre.
        first, last = order.between(current, -offset - LOOK_BEHIND, -offset)
        row, entry = spans(np.maximum(first, last - LAST), np.minimum(last - first, LAST))
        who = agent[row]
        middle = 0.5 * (entries.rear[entry] + entries.front[entry]) + offset[row]
        blocks = (middle <= 0.0) & (entries.owner[entry] != slots[who]) & (
            entries.low[entry] < half[who]) & (entries.high[entry] > -half[who])
        row, entry, who = row[blocks], entry[blocks], who[blocks]
        gap = rear[who] - (entries.front[entry] + offset[row])
        ordered = np.lexsort((gap, who))
        unique, place = np.unique(who[ordered], return_index=True)
        better = gap[ordered[place]] < best[unique]
        best[unique[better]] = gap[ordered[place]][better]
        entry_of[unique[better]] = entry[ordered[place]][better]
        branch, column = np.nonzero((graph.predecessors[current] >= 0) & (
            (offset > -LOOK_BEHIND) & np.isinf(best[agent]))[:, None])
        current = graph.predecessors[current[branch], column]
        agent, offset = agent[branch], offset[branch] - graph.length[current]
        if not len(agent):
            break
    return best, entry_of
