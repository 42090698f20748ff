# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Stop lines: where agents halt for traffic lights and stop signs."""

from collections.abc import Mapping
from typing import NamedTuple

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from crgame_ros.roads.signs import (
    governing_lights,
    has_stop_sign,
    lights_of,
    RED_STATES,
    stop_line_middle,
)
from crgame_ros.traffic.compiling.compiled import compiled
from crgame_ros.traffic.following.leaders import Ways
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.movements import LEFT, Movements, RIGHT, STRAIGHT, UNDECIDED
import numpy as np
from numpy.typing import NDArray

YELLOW, RED = 1, 2
# Lanes inside junctions by the lights before them: those who come from there wait, may drive, or
# the light changes; lanes without lights are NO_LIGHT.
NO_LIGHT, HELD, OPENED, CHANGES = 0, 1, 2, 3
LEVELS = {'yellow': YELLOW, **dict.fromkeys(RED_STATES, RED)}
ARROWS = {STRAIGHT: 'straight', LEFT: 'left', RIGHT: 'right'}
# Hardest braking for a light that is red, and for one that turns yellow [m/s^2].
RED_BRAKING = 4.0
YELLOW_BRAKING = 3.4
# The same for an agent that has decided to halt, so that it keeps to its decision: at a yellow, at
# a red light [m/s^2].
STILL_BRAKING, STILL_FOR_RED = 4.0, 7.0
# Time until braking has set in [s].
REACTION = 0.1
# Drivers start this long after a light has left red; red with yellow announces green [s].
START_UP = 1.2


class LightTable(NamedTuple):
    """Columns of `StopLines` for compiled loops."""

    at: FloatArray
    number: IntArray
    shown: IntArray
    movement: IntArray


class StopLines:
    """
    The stop lines and traffic lights of all lanes.

    Which lights apply to a movement is said by `governing_lights`. The movement of a way is that
    of its first lane, from the one with the light on, whose `movement` is decided.

    :param graph: the lanes.
    :param roads: with the traffic lights and signs.
    :param movements: of the lanes.
    :param time_step_s: Delta t_c [s]

    Attributes of each lane (L): `line` (arc length of its stop line [m], infinite without one),
    `stop_sign`, `at` (arc length of its lights' line [m]), `number` (row of its lights in
    `movement`, -1 without lights) and `shown` (L, 4): 2 for red, 1 for yellow, 0 for any other, by
    movement; column 0 is for ways whose movement is undecided as far as an agent looks, and shows
    the strictest light of all movements there. `movement` (R, L): the movements of ways from the
    lane of row R, see `Movements.after`. `inside` (L): NO_LIGHT, HELD, OPENED or CHANGES.
    """

    def __init__(self, graph: LaneGraph, roads: LaneletNetwork, movements: Movements,
                 time_step_s: float) -> None:
        self._graph = graph
        self._start_up = round(START_UP / time_step_s)
        count = len(graph)
        self.line: FloatArray = np.full(count, np.inf)
        self.stop_sign: NDArray[np.bool_] = np.zeros(count, dtype=bool)
        self.at: FloatArray = graph.length.copy()
        self.number: IntArray = np.full(count, -1, dtype=np.int64)
        self.shown: IntArray = np.zeros((count, 4), dtype=np.int64)
        # Ids of the lights for each movement, by lane.
        self._lights: dict[int, dict[int, tuple[int, ...]]] = {}
        rows: list[IntArray] = []
        for lane, lanelet_id in enumerate(graph.ids):
            lanelet = roads.find_lanelet_by_id(lanelet_id)
            self.stop_sign[lane] = has_stop_sign(lanelet, roads)
            if lanelet.stop_line is not None or self.stop_sign[lane]:
                self.line[lane] = self.at[lane] = self._position(lane, lanelet)
            lights = lights_of(lanelet, roads)
            if lights:
                self._lights[lane] = {movement: tuple(
                    x.traffic_light_id for x in governing_lights(lights, arrow))
                    for movement, arrow in ARROWS.items()}
                self.number[lane] = len(rows)
                rows.append(movements.after(lane))
                if lanelet.stop_line is None and movements.is_first(lane):
                    # No agent halts at the far side of the junction.
                    self.at[lane] = 0.0
        self.movement: IntArray = np.array(rows, dtype=np.int64).reshape(-1, count)
        self.inside: IntArray = np.full(count, NO_LIGHT)
        # Until when a light counts as red [k].
        self._red_until: dict[int, int] = {}
        self._levels: dict[int, int] = {}
        self._any_shown = False

    def _position(self, lane: int, lanelet: Lanelet) -> float:
        middle, length = stop_line_middle(lanelet), float(self._graph.length[lane])
        if middle is None:
            return length
        s, _ = self._graph.nearest(lane, middle[:1], middle[1:])
        return float(np.clip(s[0], 0.0, length))

    def show(self, k: int, signals: Mapping[int, str]) -> None:
        """Update the states of the traffic lights at k, as drivers heed them."""
        self._red_until |= {light: k + self._start_up for light, state in signals.items()
                            if state == 'red'}
        levels = {light: RED if k < self._red_until.get(light, k) else LEVELS.get(state, 0)
                  for light, state in signals.items()}
        if levels == self._levels:
            return
        self._levels = levels
        for lane, lights in self._lights.items():
            for movement, ids in lights.items():
                self.shown[lane, movement] = max(levels.get(i, 0) for i in ids)
            possible = np.unique(self.movement[self.number[lane]])
            possible = possible[possible != UNDECIDED]
            self.shown[lane, UNDECIDED] = self.shown[
                lane, possible if len(possible) else STRAIGHT].max()
        self._any_shown = bool(self.shown.any())
        self._note_inside()

    def _note_inside(self) -> None:
        governed = self.movement != UNDECIDED
        shown = self.shown[np.flatnonzero(self.number >= 0)[:, None], self.movement]
        strictest = np.where(governed, shown, 0).max(axis=0, initial=0)
        mildest = np.where(governed, shown, RED).min(axis=0, initial=RED)
        self.inside[:] = np.where(
            ~governed.any(axis=0), NO_LIGHT,
            np.where(mildest == RED, HELD, np.where(strictest == 0, OPENED, CHANGES)))

    def halts(self, way: Ways, speed: FloatArray, length: FloatArray,
              stops: NDArray[np.bool_]) -> FloatArray:
        """
        Return the distance (A) of each agent's front from the first line with a light to heed [m].

        An agent halts at red if hard braking suffices, at yellow if gentler braking does.

        :param stops: (A) whether an agent has already decided to halt.
        """
        if not self._any_shown:
            return np.full(len(speed), np.inf)
        return _halts(LightTable(self.at, self.number, self.shown, self.movement), way, speed,
                      length, stops)


@compiled
def _halts(lights: LightTable, way: Ways, speed: FloatArray, length: FloatArray,
           stops: NDArray[np.bool_]) -> FloatArray:
    result = np.full(len(speed), np.inf)
    for i in range(len(speed)):
        gentle = STILL_BRAKING if stops[i] else YELLOW_BRAKING
        firm = STILL_FOR_RED if stops[i] else RED_BRAKING
        for step in range(way.depth[i]):
            lane = way.lane[i, step]
            if lights.number[lane] < 0:
                continue
            shown = lights.shown[lane, movement_of(lights, way, i, step)]
            away = way.offset[i, step] + lights.at[lane] - 0.5 * length[i]
            # Braking takes a moment to set in.
            late = REACTION * speed[i] if shown == YELLOW and not stops[i] else 0.0
            needed = speed[i]**2 / (2.0 * max(away - late, 0.1))
            heeds = (shown == RED and needed < firm) or (
                shown == YELLOW and needed < gentle)
            if away > -1.0 and heeds:
                result[i] = min(result[i], away)
    return result


@compiled
def movement_of(lights: LightTable, way: Ways, i: int, step: int) -> int:
    """Return the movement of a way at the lights of its lane: the first decided lane counts."""
    row = lights.number[way.lane[i, step]]
    for onward in range(step, way.depth[i]):
        movement = lights.movement[row, way.lane[i, onward]]
        if movement != UNDECIDED:
            return int(movement)
    return UNDECIDED
