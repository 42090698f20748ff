# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How fast agents want to drive, and how they accelerate behind whatever is ahead (FS M2)."""

import numpy as np

from crgame_ros.traffic.agents import Agents, NOBODY
from crgame_ros.traffic.car_following import CarFollowing
from crgame_ros.traffic.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.leaders import ahead, LaneOrder, least, Pairs, Ways, ways
from crgame_ros.traffic.placement import Entries
from crgame_ros.traffic.routes import Routes

# With which agents slow down for a curve or a lower limit ahead [m/s^2].
COASTING = 1.2
# Who drives across ahead has been waited for or will be gone; this much is no alarm yet [m/s^2].
ALARM = 2.5
# With which agents brake before the end of a lane that they have not got out of [m/s^2], and the
# time in which they get to the speed at which that begins [s].
AT_END, AT_END_TIME = 3.0, 1.0
# Lines are halted at with this gap instead of the standstill gap [m].
LINE_GAP = 0.5


class Longitudinal:
    """
    Speeds and accelerations of all agents.

    :param graph: the lanes.
    :param model: of car following.
    """

    def __init__(self, graph: LaneGraph, model: CarFollowing) -> None:
        self._graph = graph
        self._model = model
        # The speeds from which one slows down for the curves of the same lane in time.
        self._envelope = graph.curve_speed.copy()
        for lane in range(len(graph)):
            first, count = int(graph.first[lane]), int(graph.count[lane])
            part = self._envelope[first:first + count]
            ahead_of = 2.0 * COASTING * float(graph.step[lane]) * np.arange(count)
            part[:] = np.sqrt(np.minimum.accumulate((part**2 + ahead_of)[::-1])[::-1] - ahead_of)

    def desired_speed(self, way: Ways, s: FloatArray, factor: FloatArray) -> FloatArray:
        """Give the speeds (A) that limits and curves allow, those ahead in time [m/s]."""
        graph = self._graph
        result = np.minimum(graph.limit[way.lane[:, 0]] * factor,
                            self._envelope[graph.rows(way.lane[:, 0], s)])
        for step in range(1, way.depth):
            lane = np.maximum(way.lane[:, step], 0)
            there = np.minimum(graph.limit[lane] * factor, self._envelope[graph.first[lane]])
            allowed = np.sqrt(there**2 + 2.0 * COASTING * np.maximum(way.offset[:, step], 0.0))
            result = np.where(way.lane[:, step] >= 0, np.minimum(result, allowed), result)
        return result

    def allowed(self, lane: int, s: float, factor: float) -> float:
        """Give the speed that limit and curves allow somewhere [m/s]."""
        row = self._graph.rows(np.array([lane]), np.array([s]))[0]
        return float(min(self._graph.limit[lane] * factor, self._envelope[row]))

    def behind(self, agents: Agents, slots: IntArray, desired: FloatArray, pairs: Pairs,
               entries: Entries) -> FloatArray:
        """Give the acceleration (A) behind everything ahead; that of a free road at most."""
        speed = agents.speed[slots]
        nobody = np.full(len(slots), np.inf)
        free = self._model.acceleration(speed, desired, nobody, speed)
        if not len(pairs.agent):
            return np.asarray(free)
        who, entry = pairs.agent, pairs.entry
        wanted = self._model.acceleration(speed[who], desired[who], pairs.gap,
                                          entries.speed[entry], agents.relief[slots[who]])
        # Crossing agents have agreed on who goes first: only the last moment to brake counts.
        needed = speed[who]**2 / (2.0 * np.maximum(pairs.gap - 0.5, 0.05))
        crossing = entries.crosses[entry] & (entries.owner[entry] >= 0)
        wanted = np.where(crossing, np.where(needed > ALARM, -needed, np.inf), wanted)
        return np.asarray(np.minimum(free, least(who, wanted, len(slots), np.inf)))

    def before_line(self, speed: FloatArray, desired: FloatArray,
                    distance: FloatArray) -> FloatArray:
        """Give the acceleration (A) before a point to halt at, a distance ahead of the front."""
        gap = np.maximum(distance, 0.0) + self._model.standstill_gap - LINE_GAP
        return np.asarray(self._model.acceleration(speed, desired, gap, np.zeros_like(speed)))

    @staticmethod
    def before_end(speed: FloatArray, distance: FloatArray) -> FloatArray:
        """
        Give the acceleration (A) before the end of a lane, a distance ahead of the front.

        The speed follows sqrt(2 b d): at full speed as far as can be, for gaps are found there,
        then with constant braking, and softly at the end.
        """
        distance = np.maximum(distance, 0.0)
        allowed = np.sqrt(2.0 * AT_END * distance)
        share = np.minimum(speed / np.maximum(allowed, 0.01), 1.0)
        softly = (allowed - speed) / AT_END_TIME - AT_END * share**2
        needed = speed**2 / (2.0 * np.maximum(distance, 0.5))
        return np.where(speed > allowed, np.minimum(softly, -needed), softly)


def changing_pairs(graph: LaneGraph, routes: Routes, agents: Agents, slots: IntArray,
                   entries: Entries, order: LaneOrder, horizon: FloatArray,
                   ) -> tuple[IntArray, Pairs]:
    """
    Find what is ahead in the lanes that agents are leaving, as far as they are still there.

    :return: rows of `slots`, and pairs of these.
    """
    row = np.flatnonzero(agents.source[slots] != NOBODY)
    row = row[agents.source[slots[row]] != agents.lane[slots[row]]]
    who = slots[row]
    lane, center = agents.source[who], agents.centers()[who]
    guess = agents.s[who] * graph.length[lane] / graph.length[agents.lane[who]]
    s, d, _ = graph.project(lane, center[:, 0], center[:, 1], guess)
    way = ways(graph, routes, lane, s, agents.destination[who], horizon[row])
    half = 0.5 * agents.width[who]
    pairs = ahead(entries, order, way, who, agents.length[who], d - half, d + half)
    return row, pairs
