# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Circles of agents that wait for each other: they are found, and one agent goes first."""

from crgame_ros.traffic.compiling.compiled import compiled
from crgame_ros.traffic.fleet.agents import AgentTable, BoolArray
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray
from crgame_ros.vehicle.state import QUEUEING
import numpy as np

# An agent that wants to accelerate by more than this does not wait [m/s^2].
STARTS = 0.5
# Standing time that counts as waiting, and time for which an agent insists on going first [s].
WAITS, INSISTS = 2.0, 6.0
# An agent that has stood this long before a full way, or in a circle, takes another way if there
# is one [s].
TURNS_OFF = 15.0
# An agent that has stood this long in a circle that no agent can open is removed [s].
LAST_RESORT = 45.0


@compiled
def note_standing(agents: AgentTable, slots: IntArray, acceleration: FloatArray) -> None:
    """Count the ticks for which agents (A) have been standing."""
    for i, slot in enumerate(slots):
        stands = agents.speed[slot] < QUEUEING and acceleration[i] < STARTS
        agents.waits[slot] = agents.waits[slot] + 1 if stands else 0


@compiled
def break_circles(k: int, agents: AgentTable, slots: IntArray, moves_up: BoolArray, waits: int,
                  insists: int) -> IntArray:
    """
    Make one agent of each circle of waiting agents go first.

    Each standing agent waits for one other at most (`AgentTable.blocker`). The chain of blockers
    ends, or leads around in a circle. There the agent goes first that has insisted longest ago.

    :param moves_up: (A) whether an agent could move up, but stays out of a junction because there
        is no room behind it.
    :param waits: ticks of standing that count as waiting.
    :param insists: ticks for which it goes first.
    :return: the agents in circles.
    """
    seen = np.full(len(agents.x), -1, np.int64)
    members = np.empty(len(slots), np.int64)
    count = 0
    for slot in slots:
        current = first = _in_circle(agents, slot, seen, waits)
        if current < 0:
            continue
        chosen = _least_insistent(k, agents, current, moves_up)
        if chosen >= 0:
            agents.insists_until[chosen] = k + insists
        while True:
            members[count] = current
            count += 1
            current = agents.blocker[current]
            if current == first:
                break
    return members[:count]


@compiled
def _in_circle(agents: AgentTable, slot: int, seen: IntArray, ticks: int) -> int:
    """
    Return one agent of the circle to which the blockers of an agent lead, or -1.

    :param seen: (A) the agent from which each was reached, -1 if from none; each circle is
        returned only once.
    :param ticks: of standing that count as waiting.
    """
    current = slot
    while current >= 0 and agents.waits[current] > ticks and seen[current] < 0:
        seen[current] = slot
        current = agents.blocker[current]
    if current >= 0 and agents.waits[current] > ticks and seen[current] == slot:
        return int(current)
    return -1


@compiled
def _least_insistent(k: int, agents: AgentTable, start: int, moves_up: BoolArray) -> int:
    """Return the agent of a circle to go first, none close to its leader; -1 while one insists."""
    chosen, current = -1, start
    while True:
        if agents.insists_until[current] > k:
            return -1
        if (agents.blocker[current] != agents.leader[current] or moves_up[current]) and (
                chosen < 0 or agents.insists_until[current] < agents.insists_until[chosen]):
            chosen = current
        current = agents.blocker[current]
        if current == start:
            return int(chosen)


@compiled
def hopeless(agents: AgentTable, slots: IntArray, ticks: int) -> IntArray:
    """List one agent of each circle whose agents have stood for a number of ticks."""
    found = np.empty(len(slots), np.int64)
    count = 0
    seen = np.full(len(agents.x), -1, np.int64)
    for slot in slots:
        current = _in_circle(agents, slot, seen, ticks)
        if current >= 0:
            found[count] = current
            count += 1
    return found[:count]
