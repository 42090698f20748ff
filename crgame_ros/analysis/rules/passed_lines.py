# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lines at which vehicles halt, and which of them a vehicle passed without."""

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_light import TrafficLight
from crgame_ros.analysis.behaviour.lane_visits import LaneVisits
from crgame_ros.geometry.curve import arc_length
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.roads.network import first_of_junctions, RoadNetwork
from crgame_ros.roads.signs import (
    governing_lights,
    has_arrow,
    has_stop_sign,
    INACTIVE,
    lights_of,
    RED_STATES,
    SIGN_REACH,
    stop_line_ends,
    TrafficLights,
)
from crgame_ros.vehicle.state import STANDING, StateColumn
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]
Kind = Literal['red light', 'stop sign']

# The way behind a line decides which of several lanes and movements it was [m].
FAR = 60.0
# All of a junction is within this distance of a line before it [m].
AROUND = 250.0
# A front that passes a line up to this far beside it has passed it [m]: files draw some short.
ASIDE = 0.3
# Least cosine of the angle between a vehicle that drives over a line and the lane.
ALONG = 0.5
# Lines of one halt: those side by side, and of lanes that begin together [m].
TOGETHER = 3.0


class StopLine(NamedTuple):
    """
    A line across a lane.

    :param middle: (2) [m]
    :param ahead: (2) unit vector across the line, in the lane's direction.
    :param half: half of its length [m]
    :param lights: that govern it.
    :param stop_sign: whether a stop sign stands there.
    :param begins: whether the lane begins here, and others may begin with it.
    """

    lanelet: int
    middle: FloatArray
    ahead: FloatArray
    half: float
    lights: tuple[TrafficLight, ...]
    stop_sign: bool
    begins: bool


def _find_stop_lines(network: LaneletNetwork) -> tuple[StopLine, ...]:
    """List the lines of a map that have lights or a stop sign."""
    # Those that the file names as first of a junction but not as incoming.
    inner = first_of_junctions(network) - {
        i for intersection in network.intersections for each in intersection.incomings
        for i in each.incoming_lanelets or ()}
    found = []
    for lanelet in network.lanelets:
        lights, sign = lights_of(lanelet, network), has_stop_sign(lanelet, network)
        if lights or sign:
            # A light of a lane inside a junction stands before it, not at its far side.
            begins = lanelet.stop_line is None and not sign and lanelet.lanelet_id in inner
            found.append(_line(lanelet, begins, lights, sign))
    return tuple(found)


def _line(lanelet: Lanelet, begins: bool, lights: Sequence[TrafficLight],
          sign: bool) -> StopLine:
    """Return a lanelet's stop line, or the line across its start or end."""
    end = 0 if begins else -1
    if lanelet.stop_line is not None:
        left, right = stop_line_ends(lanelet)
    else:
        left, right = lanelet.left_vertices[end, :2], lanelet.right_vertices[end, :2]
    across = right - left
    length = float(np.hypot(*across))
    ahead = np.array((-across[1], across[0])) / max(length, 1e-9)
    # Files give the ends of a line in either order.
    along = np.diff(lanelet.center_vertices[:2] if begins else lanelet.center_vertices[-2:],
                    axis=0)[0, :2]
    return StopLine(int(lanelet.lanelet_id), 0.5 * (left + right),
                    ahead if along @ ahead >= 0.0 else -ahead, 0.5 * length, tuple(lights), sign,
                    begins)


class LineCrossing(NamedTuple):
    """
    A line that a front passed.

    :param line: its index in the lines.
    :param row: last state before it.
    :param part: of the step behind that state until the front was at the line, 0 to 1.
    :param aside: distance beyond the end of the line, 0 on it [m]
    """

    line: int
    row: int
    part: float
    aside: float


def _line_crossings(lines: Sequence[StopLine], poses: FloatArray, front: float,
                    jumps: Sequence[int]) -> list[list[LineCrossing]]:
    """
    Find the lines that a vehicle drove over in the direction of their lanes, in order.

    :param poses: (K, 3) of its reference point, in the map's coordinates.
    :param front: from that point to the front bumper [m]
    :param jumps: rows at which it has just been put elsewhere.
    :return: for each halt the lines that were passed there: one, or several where lines lie side
        by side or upon each other.
    """
    if not lines or len(poses) < 2:
        return []
    fronts = shifted(poses, front)[:, :2]
    found = sorted(_crossings(lines, poses, fronts, jumps), key=lambda x: (x.row, x.part))
    gone = arc_length(fronts)
    halts: list[list[LineCrossing]] = []
    for each in found:
        if halts and gone[each.row] - gone[halts[-1][0].row] < TOGETHER:
            halts[-1].append(each)
        else:
            halts.append([each])
    return halts


def _crossings(lines: Sequence[StopLine], poses: FloatArray, fronts: FloatArray,
               jumps: Sequence[int]) -> Iterator[LineCrossing]:
    middle, ahead, half = (np.array([getattr(line, name) for line in lines])
                           for name in ('middle', 'ahead', 'half'))
    reach = (half + ASIDE)[:, None] * np.column_stack((-ahead[:, 1], ahead[:, 0]))
    tree = shapely.STRtree(shapely.linestrings(np.stack((middle - reach, middle + reach), axis=1)))
    steps = shapely.linestrings(np.stack((fronts[:-1], fronts[1:]), axis=1))
    # By their boxes; which of these steps pass a line is computed below.
    row, line = tree.query(steps)
    before, after = (np.einsum('ij,ij->i', fronts[at] - middle[line], ahead[line])
                     for at in (row, row + 1))
    along = np.cos(poses[row, 2]) * ahead[line, 0] + np.sin(poses[row, 2]) * ahead[line, 1]
    # A front that halts on a line passes it when it gets there, not once more when it leaves.
    passes = (before < 0.0) & (after >= 0.0) & (along > ALONG) & ~np.isin(row + 1, jumps)
    row, line, before, after = row[passes], line[passes], before[passes], after[passes]
    part = before / (before - after)
    place = fronts[row] + part[:, None] * (fronts[row + 1] - fronts[row]) - middle[line]
    across = place[:, 1] * ahead[line, 0] - place[:, 0] * ahead[line, 1]
    aside = np.maximum(np.abs(across) - half[line], 0.0)
    for i in np.flatnonzero(aside <= ASIDE).tolist():
        yield LineCrossing(int(line[i]), int(row[i]), float(part[i]), float(aside[i]))


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
    :ivar lines: with a light or a stop sign.
    """

    def __init__(self, scenario: Scenario, roads: RoadNetwork) -> None:
        self.lines = _find_stop_lines(scenario.lanelet_network)
        self._lights = TrafficLights(scenario)
        self._roads = roads
        # By the line's lanelet: the movements of lanelets behind it.
        self._after: dict[int, dict[int, int]] = {}

    def passed(self, track: DrivenTrack) -> tuple[PassedLine, ...]:
        """Return the lines that a vehicle passed against a light or a sign, in order."""
        halts = _line_crossings(self.lines, track.states[:, :3], track.front, track.jumps)
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
        end = min([int(np.searchsorted(arc_length(poses[:, :2]), FAR)), *later])
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
