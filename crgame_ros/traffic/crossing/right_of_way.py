# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where agents halt for lights, signs and others at junctions, and who goes first of a circle."""

from commonroad.scenario.lanelet import LaneletNetwork
from crgame_ros.traffic.crossing.crossings import AT_LINE, Crossings, MOVES_UP
from crgame_ros.traffic.crossing.crosswalks import Crosswalks
from crgame_ros.traffic.crossing.exit_room import queues
from crgame_ros.traffic.crossing.junctions import arrivals, passages
from crgame_ros.traffic.crossing.meetings import CrossingRules, Situation
from crgame_ros.traffic.crossing.stop_lines import StopLines
from crgame_ros.traffic.crossing.waiting import (
    break_circles,
    hopeless,
    INSISTS,
    LAST_RESORT,
    TURNS_OFF,
    WAITS,
)
from crgame_ros.traffic.fleet.agents import Agents, BoolArray, FREE
from crgame_ros.traffic.fleet.world_view import Others
from crgame_ros.traffic.following.following import Ahead
from crgame_ros.traffic.following.longitudinal import before_lines
from crgame_ros.traffic.lanes.conflicts import Conflicts
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.movements import Movements
from crgame_ros.traffic.lanes.placement import Entries
import numpy as np

# An agent with a smaller gap than this to its leader waits for it [m].
QUEUE = 12.0


class RightOfWay:
    """
    The rules at lights, stop lines, junctions and crossings for pedestrians.

    :param graph: the lanes.
    :param roads: with the lights, the signs and the crossings.
    :param conflicts: between the lanes.
    :param movements: of the lanes.
    :param time_step_s: Delta t_c [s]

    Attribute `lines`: the stop lines, with the present states of the lights.
    """

    def __init__(self, graph: LaneGraph, roads: LaneletNetwork, conflicts: Conflicts,
                 movements: Movements, time_step_s: float) -> None:
        self._graph, self._conflicts = graph, conflicts
        self.lines = StopLines(graph, roads, movements, time_step_s)
        self.crosswalks = Crosswalks(graph, roads)
        self._crossings = Crossings(conflicts, CrossingRules(), time_step_s)
        self._waiting, self._insisting, self._turning_off, self._last_resort = (
            round(seconds / time_step_s) for seconds in (WAITS, INSISTS, TURNS_OFF, LAST_RESORT))

    def halts(self, k: int, agents: Agents, seen: Ahead, entries: Entries, others: Others,
              run_lights: BoolArray, elapsed_s: float) -> tuple[FloatArray, IntArray]:
        """
        Let agents into junctions; return where the others halt.

        :param run_lights: whether a driver ignores lights, of all slots.
        :param elapsed_s: time since the last call [s]
        :return: distances (A) of the fronts from lights and junctions to halt at, or inf [m]; the
            slots of agents that have stood so long that they had better go another way.
        """
        slots, way, gap = seen.slots, seen.way, seen.gap
        light = self.lines.halts(way, agents.speed[slots], agents.length[slots],
                                 agents.stops[slots])
        light[run_lights[slots]] = np.inf
        agents.stops[slots] = np.isfinite(light)
        before_light = before_lines(agents.speed[slots], light)
        if not len(self._conflicts):
            return before_light, slots[:0]
        passage = passages(self._conflicts.table, self.lines.line, self.lines.inside, way,
                           agents.table, slots)
        number = np.arange(len(slots))
        first = way.lane[number, np.maximum(passage.first, 0)]
        before = way.lane[number, np.maximum(passage.first - 1, 0)]
        sign = self.lines.stop_sign[first] & (passage.first >= 0) \
            | self.lines.stop_sign[before] & (passage.first > 0)
        coming = arrivals(self._graph.table, self._conflicts.table, way, agents.table, slots,
                          entries, others.drives, others.widths)
        rear_stop, queued = queues(agents.table, slots, seen.pairs, entries, passage)
        halt, shut = self._crossings.halts(
            k, agents, way, passage, coming,
            Situation(slots, seen.desired, rear_stop, light, sign, queued),
            elapsed_s)
        behind = (agents.blocker[slots] == FREE) & (gap < QUEUE)
        agents.blocker[slots[behind]] = agents.leader[slots[behind]]
        # An agent that halts at a red light waits for no other, but one that halts before it may.
        at_light = np.isfinite(light) & (light < np.minimum(gap, halt + AT_LINE))
        agents.blocker[slots[at_light]] = FREE
        return np.minimum(before_light, halt), self._break_circles(k, agents, slots, shut, gap)

    def _break_circles(self, k: int, agents: Agents, slots: IntArray, shut: BoolArray,
                       gap: FloatArray) -> IntArray:
        """Let one agent of each circle go first; return those that had better go another way."""
        if not (agents.waits[slots] > self._waiting).any():
            return slots[:0]
        moves_up = np.zeros(agents.count, dtype=bool)
        moves_up[slots[shut & (gap > MOVES_UP)]] = True
        stuck = break_circles(k, agents.table, slots, moves_up, self._waiting, self._insisting)
        stuck = np.union1d(slots[shut], stuck)
        waits = agents.waits[stuck]
        # Not within a fork.
        before = agents.s[stuck] + 0.5 * agents.length[stuck] < self._graph.length[
            agents.lane[stuck]]
        return stuck[before & (waits > 0) & (waits % self._turning_off == 0)]

    def hopeless(self, agents: Agents, slots: IntArray) -> IntArray:
        """List one agent of each circle that no agent could open for a long time."""
        return hopeless(agents.table, slots, self._last_resort)
