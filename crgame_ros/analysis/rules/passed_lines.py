# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which lines a vehicle passed at red, and which stop signs without a halt."""

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

from commonroad.scenario.lanelet import LaneletNetwork
from commonroad.scenario.scenario import Scenario
from crgame_ros.analysis.behaviour.lane_visits import LaneVisits
from crgame_ros.analysis.rules.line_crossings import line_crossings, LineCrossing
from crgame_ros.analysis.rules.stop_lines import find_stop_lines, StopLine
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.signals import governing_lights, INACTIVE, RED_STATES, TrafficLights
from crgame_ros.roads.signs import has_arrow, SIGN_REACH
from crgame_ros.vehicle.state import STANDING, StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Kind = Literal['red light', 'stop sign']

# The way behind a line decides which of several lanes and movements it was [m].
FAR = 60.0
# All of a junction is within this distance of a line before it [m].
AROUND = 250.0


class DrivenTrack(NamedTuple):
    """
    The course of a driven vehicle.

    :param states: (K, 8) rear-axle states in the map's coordinates, at the scenario's steps.
    :param ks: (K) scenario steps.
    :param rear_to_center: from the rear axle forward to the centre [m]
    :param front: from the rear axle forward to the front bumper [m]
    :param jumps: rows at which the vehicle has just been put elsewhere.
    """

    states: FloatArray
    ks: NDArray[np.int64]
    rear_to_center: float
    front: float
    jumps: Sequence[int] = ()


class PassedLine(NamedTuple):
    """
    A line that a vehicle must not have passed then.

    :param kind: of the rule that it broke.
    :param k: scenario step at which the front was on the line, with its fraction.
    :param lanelet: id of the line's lanelet.
    :param speed: of the vehicle there [m/s]
    """

    kind: Kind
    k: float
    lanelet: int
    speed: float


class LineRules:
    """
    The lights and stop signs of a map, and who heeds them.

    :param scenario: with lanelets, lights and signs.
    :param roads: its roads.
    :ivar lines: with a light or a stop sign.
    """

    def __init__(self, scenario: Scenario, roads: RoadNetwork) -> None:
        self.lines = find_stop_lines(scenario.lanelet_network)
        self._lights = TrafficLights(scenario)
        self._roads = roads
        # By the line's lanelet: the movements of lanelets behind it.
        self._after: dict[int, dict[int, int]] = {}

    def passed(self, track: DrivenTrack) -> tuple[PassedLine, ...]:
        """Return the lines that a vehicle passed against a light or a sign, in order."""
        halts = line_crossings(self.lines, track.states[:, :3], track.front, track.jumps)
        return tuple(found for halt in halts for found in self._judged(track, halt))

    def _judged(self, track: DrivenTrack, halt: Sequence[LineCrossing]) -> Iterator[PassedLine]:
        crossing, way = self._chosen(track, halt)
        line, row = self.lines[crossing.line], crossing.row
        if line.begins and line.lanelet not in way:
            # It took another lane that begins there.
            return
        states = self._lights.states_at(int(track.ks[row]))
        shown = {states.get(light.traffic_light_id, INACTIVE) for light in line.lights}
        broken: Kind | None = None
        if shown & RED_STATES and self._is_red(line, states, way):
            broken = 'red light'
        elif line.stop_sign and shown <= {INACTIVE} and not _has_halted(line, track, row):
            broken = 'stop sign'
        if broken:
            yield PassedLine(broken, float(track.ks[row]) + crossing.part, line.lanelet,
                             float(track.states[row, StateColumn.SPEED]))

    def _chosen(self, track: DrivenTrack, halt: Sequence[LineCrossing]
                ) -> tuple[LineCrossing, tuple[int, ...]]:
        """Return the line whose lane was driven, and the lanelets from there on."""
        lines = [self.lines[each.line] for each in halt]
        if len(halt) == 1 and not lines[0].begins and not any(map(has_arrow, lines[0].lights)):
            return halt[0], ()
        way = self._way(track, halt[0].row)
        places = {lanelet: place for place, lanelet in reversed([*enumerate(way)])}
        chosen = min(halt, key=lambda each: (
            places.get(self.lines[each.line].lanelet, len(way)), each.aside))
        return chosen, way

    def _way(self, track: DrivenTrack, row: int) -> tuple[int, ...]:
        """List the lanelets in which the centre was from a row on."""
        poses = track.states[row:, :3]
        later = [jump - row for jump in track.jumps if jump > row]
        gone = np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))
        end = min([1 + int(np.searchsorted(gone, FAR)), *later])
        visits = LaneVisits(self._roads).follow(shifted(poses[:end], track.rear_to_center))
        return tuple(visit.lanelet for visit in visits)

    def _is_red(self, line: StopLine, states: dict[int, str], way: Sequence[int]) -> bool:
        """Return whether the lights of a movement are red: of each that it may be, if unknown."""
        lights = list(line.lights)
        arrows = any(map(has_arrow, lights))
        movements = self._movements(line, way) if arrows else ('straight',)
        return all(any(states.get(light.traffic_light_id) in RED_STATES
                       for light in governing_lights(lights, movement)) for movement in movements)

    def _movements(self, line: StopLine, way: Sequence[int]) -> tuple[str, ...]:
        """Return the movement of a way behind a line, or all that there are if it ends before."""
        # These modules take a second to import, and few lights have arrows.
        from crgame_ros.traffic.crossing.stop_lines import ARROWS
        after = self._after.get(line.lanelet)
        if after is None:
            after = self._after[line.lanelet] = self._movements_after(line)
        decided = [ARROWS[after[each]] for each in way if after.get(each) in ARROWS]
        possible = {ARROWS[each] for each in after.values() if each in ARROWS}
        return tuple(decided[:1] or sorted(possible) or ARROWS.values())

    def _movements_after(self, line: StopLine) -> dict[int, int]:
        """Return the movements of ways behind a line, by the lanelets over which they lead."""
        from crgame_ros.traffic.lanes.lane_graph import LaneGraph
        from crgame_ros.traffic.lanes.movements import Movements
        part, network = LaneletNetwork(), self._roads.lanelet_network
        for lanelet in network.lanelets:
            away = np.hypot(*(lanelet.center_vertices[:, :2] - line.middle).T)
            if away.min() < AROUND or lanelet.lanelet_id == line.lanelet:
                part.add_lanelet(lanelet, rtree=False)
        for intersection in network.intersections:
            part.add_intersection(intersection)
        graph = LaneGraph(RoadNetwork(part))
        lane = graph.index.get(line.lanelet)
        return {} if lane is None else dict(
            zip(graph.ids, Movements(graph).after(lane).tolist(), strict=True))


def _has_halted(line: StopLine, track: DrivenTrack, row: int) -> bool:
    """Return whether a vehicle stood at most `SIGN_REACH` before a line, up to a row."""
    first = max((jump for jump in track.jumps if jump <= row), default=0)
    states = track.states[first:row + 1]
    before = (line.middle - shifted(states[:, :3], track.front)[:, :2]) @ line.ahead
    away = np.flatnonzero((before > SIGN_REACH) | (before < 0.0))
    since = int(away[-1]) + 1 if len(away) else 0
    return bool((np.abs(states[since:, StateColumn.SPEED]) < STANDING).any())
