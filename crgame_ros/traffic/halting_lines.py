# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where traffic lights and stop signs want agents to halt."""

from collections.abc import Mapping

from commonroad.scenario.lanelet import LaneletNetwork
import numpy as np
from numpy.typing import NDArray

from crgame_ros.traffic.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.leaders import Ways

TURN = 0.45
RED = ('red', 'redYellow')
# Hardest braking for a light that is red, and for one that turns yellow [m/s^2].
RED_BRAKING = 6.0
YELLOW_BRAKING = 3.0


class HaltingLines:
    """
    The stop lines and traffic lights of all lanes.

    :param graph: the lanes.
    :param roads: with the traffic lights and signs.

    Attributes of each lane: `line` (arc length of its stop line [m], infinite without one) and
    `stop_sign`.
    """

    def __init__(self, graph: LaneGraph, roads: LaneletNetwork) -> None:
        self._graph = graph
        count = len(graph)
        self.line: FloatArray = np.full(count, np.inf)
        self.stop_sign: NDArray[np.bool_] = np.zeros(count, dtype=bool)
        self._at: FloatArray = graph.length.copy()
        self._lights: dict[int, tuple[tuple[int, str], ...]] = {}
        for lane, lanelet_id in enumerate(graph.ids):
            lanelet = roads.find_lanelet_by_id(lanelet_id)
            lights, signs = set(lanelet.traffic_lights), set(lanelet.traffic_signs)
            if lanelet.stop_line is not None:
                lights |= lanelet.stop_line.traffic_light_ref or set()
                signs |= lanelet.stop_line.traffic_sign_ref or set()
                self.line[lane] = self._at[lane] = self._position(lane, lanelet.stop_line)
                self.stop_sign[lane] = any(
                    element.traffic_sign_element_id.name == 'STOP' for sign_id in signs
                    if (sign := roads.find_traffic_sign_by_id(sign_id)) is not None
                    for element in sign.traffic_sign_elements)
            found = [(i, roads.find_traffic_light_by_id(i)) for i in sorted(lights)]
            shown = tuple((i, 'all' if light.direction is None else light.direction.value.lower())
                          for i, light in found if light is not None)
            if shown:
                self._lights[lane] = shown
        self._states: Mapping[int, str] | None = None
        # What lights show to whoever goes straight on, left, or right: 2 red, 1 yellow.
        self._shown: IntArray = np.zeros((count, 3), dtype=np.int64)
        self._turn: IntArray = np.array(
            [1 if turn > TURN else 2 if turn < -TURN else 0
             for turn in (graph.turn(lane) for lane in range(count))])

    def _position(self, lane: int, line: object) -> float:
        start, end = getattr(line, 'start', None), getattr(line, 'end', None)
        length = float(self._graph.length[lane])
        if start is None or end is None:
            return length
        middle = 0.5 * (np.asarray(start) + np.asarray(end))
        s, _ = self._graph.nearest(lane, middle[:1], middle[1:2])
        return float(np.clip(s[0], 0.0, length))

    def show(self, signals: Mapping[int, str]) -> None:
        """Take over the states of the traffic lights."""
        if signals == self._states:
            return
        self._states = dict(signals)
        for lane, lights in self._lights.items():
            for turn, name in enumerate(('straight', 'left', 'right')):
                relevant = [i for i, arrow in lights if arrow == 'all' or name in arrow]
                states = {signals.get(i, 'inactive') for i in relevant or [i for i, _ in lights]}
                self._shown[lane, turn] = (2 if states & set(RED) else
                                           1 if 'yellow' in states else 0)

    def halts(self, way: Ways, speed: FloatArray, length: FloatArray) -> FloatArray:
        """
        Give the distance (A) of each agent's front from the first line with a light to heed [m].

        Red holds unless braking hard would not suffice, yellow if gentle braking does.
        """
        result = np.full(len(speed), np.inf)
        if not self._shown.any():
            return result
        for step in range(way.depth):
            lane = np.maximum(way.lane[:, step], 0)
            onto = way.lane[:, step + 1] if step + 1 < way.depth else np.full(len(lane), -1)
            turn = np.where(onto >= 0, self._turn[np.maximum(onto, 0)], 0)
            shown = np.where(way.lane[:, step] >= 0, self._shown[lane, turn], 0)
            away = way.offset[:, step] + self._at[lane] - 0.5 * length
            needed = speed**2 / (2.0 * np.maximum(away, 0.1))
            heeds = (away > -1.0) & (((shown == 2) & (needed < RED_BRAKING)) | (
                (shown == 1) & (needed < YELLOW_BRAKING)))
            result = np.where(heeds, np.minimum(result, away), result)
        return result
