# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who drives in the lane beside an agent: the gap it would change into."""

import math
from typing import NamedTuple

from crgame_ros.traffic.agents import AgentTable
from crgame_ros.traffic.compiled import bare, compiled
from crgame_ros.traffic.lane_graph import FloatArray, IntArray
from crgame_ros.traffic.lane_table import LaneTable, project_on
from crgame_ros.traffic.leaders import first_from
from crgame_ros.traffic.placement import Entries, front_within, rear_within
import numpy as np

LOOK_BEHIND = 120.0
MAX_LANES_BEHIND = 32
MAX_LANES_AHEAD = 12
# Who is beside has to be clear of the own width by this [m].
SIDE_MARGIN = 0.15
# No vehicle is longer [m].
LONG = 25.0


class Beside(NamedTuple):
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


@compiled
def look_beside(lanes: LaneTable, following: IntArray, agents: AgentTable, slots: IntArray,
                lane: IntArray, entries: Entries) -> Beside:
    """
    Look into the lanes beside agents.

    :param following: (D, L) next lane to a destination, or -1.
    :param slots: (N) the agents.
    :param lane: (N) the lane beside each.
    """
    count = len(slots)
    result = Beside(
        lane, np.empty(count), np.empty(count), np.empty(count), np.full(count, math.inf),
        np.zeros(count), np.full(count, -1, np.int64), np.full(count, math.inf),
        np.zeros(count), np.full(count, -1, np.int64))
    _look(lanes, following, agents, slots, entries, result, np.empty(MAX_LANES_BEHIND, np.int64),
          np.empty(MAX_LANES_BEHIND))
    return result


@bare
def _look(lanes: LaneTable, following: IntArray, agents: AgentTable, slots: IntArray,
          entries: Entries, result: Beside, pending_lane: IntArray,
          pending_offset: FloatArray) -> None:
    """Write what is beside all agents; `pending_…` is room to note lanes in."""
    lane = result.lane
    for i, slot in enumerate(slots):
        yaw = agents.yaw[slot]
        x = agents.x[slot] + agents.rear_to_center[slot] * math.cos(yaw)
        y = agents.y[slot] + agents.rear_to_center[slot] * math.sin(yaw)
        guess = agents.s[slot] * lanes.length[lane[i]] / lanes.length[agents.lane[slot]]
        s, d, heading = project_on(lanes, lane[i], x, y, guess, 3)
        result.s[i], result.d[i], result.turn[i] = s, d, yaw - heading
        _look_ahead(lanes, following, agents, slot, entries, result, i)
        _look_behind(lanes, agents, slot, entries, result, i, pending_lane, pending_offset)


@bare
def _look_ahead(lanes: LaneTable, following: IntArray, agents: AgentTable, slot: int,
                entries: Entries, result: Beside, i: int) -> None:
    """Find who is next ahead in the lane beside and those that follow on the route."""
    speed, half = agents.speed[slot], 0.5 * agents.width[slot] + SIDE_MARGIN
    horizon = 30.0 + 3.0 * speed + speed**2 / 4.0
    lane, offset = result.lane[i], -result.s[i]
    for _ in range(MAX_LANES_AHEAD):
        for n in range(entries.begin[lane], entries.begin[lane + 1]):
            if entries.rear[n] + offset > horizon:
                break
            middle = 0.5 * (entries.rear[n] + entries.front[n]) + offset
            if middle > 0.0 and entries.owner[n] != slot:
                gap = rear_within(entries, n, -half, half) + offset - 0.5 * agents.length[slot]
                if gap < result.lead_gap[i]:
                    result.lead_gap[i], result.leader[i] = gap, n
                    result.lead_speed[i] = entries.speed[n]
        offset += lanes.length[lane]
        lane = following[agents.destination[slot], lane]
        if lane < 0 or offset > horizon or result.leader[i] >= 0:
            break


@bare
def _look_behind(lanes: LaneTable, agents: AgentTable, slot: int, entries: Entries,
                 result: Beside, i: int, pending_lane: IntArray,
                 pending_offset: FloatArray) -> None:
    """Find who is next behind, in the lane or those that lead to it."""
    half = 0.5 * agents.width[slot] + SIDE_MARGIN
    pending_lane[0], pending_offset[0] = result.lane[i], -result.s[i]
    done, pending = 0, 1
    while done < pending:
        lane, offset = pending_lane[done], pending_offset[done]
        done += 1
        found = False
        last = first_from(entries, lane, LONG - offset)
        for n in range(last - 1, entries.begin[lane] - 1, -1):
            if entries.rear[n] + offset < -LOOK_BEHIND:
                break
            middle = 0.5 * (entries.rear[n] + entries.front[n]) + offset
            if middle > 0.0 or entries.owner[n] == slot:
                continue
            gap = -0.5 * agents.length[slot] - (front_within(entries, n, -half, half) + offset)
            if gap < math.inf:
                found = True
            if gap < result.follow_gap[i]:
                result.follow_gap[i], result.follow_speed[i] = gap, entries.speed[n]
                result.follower[i] = max(entries.owner[n], -1)
            # Those sorted before begin, and so end, farther behind; the longest are excepted.
            if found and entries.rear[n] + offset < -LONG:
                break
        if not found and offset > -LOOK_BEHIND:
            for before in lanes.predecessors[lane]:
                if before >= 0 and pending < len(pending_lane):
                    pending_lane[pending] = before
                    pending_offset[pending] = offset - lanes.length[before]
                    pending += 1
