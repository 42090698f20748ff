# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who waits for whom: circles of waiting are found, and one of each goes first."""

from crgame_ros.traffic.agents import AgentTable
from crgame_ros.traffic.compiled import compiled
from crgame_ros.traffic.lane_graph import FloatArray, IntArray
from crgame_ros.vehicle.state import QUEUEING
import numpy as np

# Who wants to accelerate by more than this does not wait [m/s^2].
STARTS = 0.5
# Standing for so many seconds is waiting; who insists does so for so long [s].
WAITS, INSISTS = 2.0, 6.0
# Who has stood this long before a way that is full, or in a circle, turns off elsewhere, if there
# is a way [s].
TURNS_OFF = 15.0
# Who has stood this long in a circle that nobody can open is taken off the road [s].
LAST_RESORT = 45.0


@compiled
def note_standing(agents: AgentTable, slots: IntArray, acceleration: FloatArray) -> None:
    """Count the ticks for which agents (A) have been standing."""
    for i, slot in enumerate(slots):
        stands = agents.speed[slot] < QUEUEING and acceleration[i] < STARTS
        agents.waits[slot] = agents.waits[slot] + 1 if stands else 0


@compiled
def break_circles(k: int, agents: AgentTable, slots: IntArray, waits: int,
                  insists: int) -> IntArray:
    """
    Let one agent of each circle of waiting go first.

    Each standing agent waits for one other at most (`AgentTable.blocker`); following these leads
    out, or around. In a circle it is the one that has insisted longest ago.

    :param waits: ticks of standing that count as waiting.
    :param insists: ticks for which it goes first.
    :return: who is in circles.
    """
    seen = np.full(len(agents.x), -1, np.int64)
    members = np.empty(len(slots), np.int64)
    count = 0
    for slot in slots:
        current = first = _in_circle(agents, slot, seen, waits)
        if current < 0:
            continue
        chosen = _least_insistent(k, agents, current)
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
    Follow who waits for whom from an agent on; give one of a circle that it leads to, or -1.

    :param seen: (A) from which agent each was come to, -1 if from none; a circle is given once.
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
def _least_insistent(k: int, agents: AgentTable, start: int) -> int:
    """Choose who in a circle is to insist: none while one does, nobody who waits for a leader."""
    chosen, current = -1, start
    while True:
        if agents.insists_until[current] > k:
            return -1
        if agents.blocker[current] != agents.leader[current] and (
                chosen < 0 or agents.insists_until[current] < agents.insists_until[chosen]):
            chosen = current
        current = agents.blocker[current]
        if current == start:
            return int(chosen)


@compiled
def hopeless(agents: AgentTable, slots: IntArray, ticks: int) -> IntArray:
    """List the agents in circles that have stood for so many ticks, one of each circle."""
    found = np.empty(len(slots), np.int64)
    count = 0
    seen = np.full(len(agents.x), -1, np.int64)
    for slot in slots:
        current = _in_circle(agents, slot, seen, ticks)
        if current >= 0:
            found[count] = current
            count += 1
    return found[:count]
