# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Room behind junctions: the queues there, and the room promised to agents let in."""

import math
from typing import NamedTuple

from crgame_ros.traffic.compiling.compiled import bare, compiled
from crgame_ros.traffic.crossing.junctions import Passages
from crgame_ros.traffic.crossing.meetings import CrossingRules, Situation
from crgame_ros.traffic.fleet.agents import AgentTable
from crgame_ros.traffic.following.leaders import Pairs, Ways
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray
from crgame_ros.traffic.lanes.placement import Entries
import numpy as np

# A leader that is faster is not expected to stop [m/s].
DRIVES_ON = 3.0
# Gap between vehicles in a queue [m].
QUEUE_GAP = 2.0


@compiled
def queues(agents: AgentTable, slots: IntArray, pairs: Pairs, entries: Entries,
           passage: Passages) -> tuple[FloatArray, FloatArray]:
    """
    Find the queues ahead of agents (A), before a junction or behind it.

    A leader that drives on makes room, but no farther than to its own waiting place before its
    next junction. The vehicles in between queue behind it.

    :return: `Situation.rear_stop` and `Situation.queued`
    """
    rear_stop, queued = np.full(len(slots), math.inf), np.full(len(slots), math.inf)
    _write_queues(agents, slots, pairs, entries, passage, np.zeros(len(slots)),
                  np.full(len(agents.x), -1, np.int64), rear_stop, queued)
    return rear_stop, queued


@bare
def _write_queues(agents: AgentTable, slots: IntArray, pairs: Pairs, entries: Entries,
                  passage: Passages, between: FloatArray, row: IntArray, rear_stop: FloatArray,
                  queued: FloatArray) -> None:
    for i, slot in enumerate(slots):
        row[slot] = i
    for p in range(len(pairs.agent)):
        i, n = pairs.agent[p], pairs.entry[p]
        speed, owner = max(entries.speed[n], 0.0), entries.owner[n]
        stops = pairs.distance[p] + speed**2 / 6.0 if speed <= DRIVES_ON else math.inf
        if owner >= 0 and not entries.crosses[n]:
            stops = min(stops, pairs.distance[p] + max(passage.hold[row[owner]], 0.0))
        rear_stop[i] = min(rear_stop[i], stops - between[i])
        if not entries.crosses[n]:
            between[i] += entries.front[n] - entries.rear[n] + QUEUE_GAP
            if agents.grant[owner] < 0 if owner >= 0 else speed < DRIVES_ON:
                queued[i] = min(queued[i], pairs.gap[p])


class Promises(NamedTuple):
    """
    Room promised to agents that were let into junctions and have not left them yet.

    :param behind: (L) at the beginning of each lane behind a junction [m]
    :param through: (L) the part of it promised to agents that get there through each lane [m]
    """

    behind: FloatArray
    through: FloatArray


@bare
def promise(promised: Promises, agents: AgentTable, slot: int, way: Ways, step: int,
            i: int) -> None:
    """Reserve room for an agent behind the junction that ends at a step of its way."""
    if 0 <= step < way.depth[i] - 1:
        room = agents.length[slot] + QUEUE_GAP
        promised.behind[way.lane[i, step + 1]] += room
        promised.through[way.lane[i, step]] += room


@bare
def is_full(k: int, rules: CrossingRules, promised: Promises, agents: AgentTable, slot: int,
            way: Ways, passage: Passages, at: Situation, i: int) -> bool:
    """
    Return whether there is no room for an agent behind its next junction.

    In a roundabout agents close up, so that those behind them get to their exits. One that opens a
    circle of waiting agents moves up in any case.
    """
    step = passage.last[i]
    # Agents that go there through the same lane are leaders and already count in `rear_stop`.
    taken = 0.0
    if 0 <= step < way.depth[i] - 1:
        taken = promised.behind[way.lane[i, step + 1]] - promised.through[way.lane[i, step]]
    return bool(not passage.ring[i] and agents.insists_until[slot] <= k and (
        at.rear_stop[i] - taken < passage.end[i] + agents.length[slot] + rules.room))


@bare
def has_filled(k: int, rules: CrossingRules, agents: AgentTable, at: Situation, i: int) -> bool:
    """
    Return whether there is no room any more behind the junction that an agent was let into.

    It was let in behind others, which then left its way or halted later than they seemed to.
    """
    slot = at.slots[i]
    end = agents.grant_left[slot] - 0.5 * agents.length[slot]
    return bool(agents.insists_until[slot] <= k
                and at.rear_stop[i] < end + agents.length[slot] + rules.room)
