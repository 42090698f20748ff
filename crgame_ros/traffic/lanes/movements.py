# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Straight on, left or right: the movement that a way through a junction belongs to."""

from collections.abc import Iterable, Iterator
import math
from typing import NamedTuple

from commonroad.scenario.intersection import IntersectionIncomingElement
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
import numpy as np
from numpy.typing import NDArray
import shapely

UNDECIDED, STRAIGHT, LEFT, RIGHT = range(4)
# An angle below this is no turn [rad].
TURN = 0.5
# The nominal angle of each movement, and how far a named movement may differ from it [rad].
HEADING = {STRAIGHT: 0.0, LEFT: 0.5 * math.pi, RIGHT: -0.5 * math.pi}
PLAUSIBLE = math.pi / 3.0
# Ways whose angles differ by less are one [rad].
SAME = 0.3
# Centre lines that come this near to each other meet: they belong to a junction [m].
MEETING = 1.0
# Greatest distance of a light before its junction, and greatest length of a junction [m].
APPROACH, LONGEST = 60.0, 150.0
MAX_PASSAGES = 64


class LanePassage(NamedTuple):
    """
    One way through a junction.

    :param lanes: in the order of travel.
    :param exit: the lane behind it, -1 where there is none.
    :param movement: STRAIGHT, LEFT or RIGHT as the file names it, to which the arrows of lights
        refer.
    :param turn: the same as it is driven. At T-junctions files call a way that turns "straight
        on", and one that goes straight on "left", which is no left turn that has to yield.
    :param heading: before the junction [rad]
    :param angle: by which it turns, positive to the left [rad]
    """

    lanes: tuple[int, ...]
    exit: int  # noqa: A003
    movement: int
    turn: int
    heading: float
    angle: float


class Movements:
    """
    The movements of all junctions: those that the file names, by geometry where it names none.

    A file names the first lanelets behind an incoming one. These may be part of several movements,
    and turn by a few degrees only. Therefore the whole ways from there to the exits decide.

    :param graph: the lanes.

    Attributes of each lane (L): `turn`, the movement inside junctions as it is driven, UNDECIDED
    where several share a lane, and outside; `heading` of the way before the junction and `angle`
    by which the whole way turns there [rad], or those of the lane itself where ways differ, and
    outside.
    """

    def __init__(self, graph: LaneGraph) -> None:
        self._graph = graph
        self._inside = _inside(graph)
        # From the file: by incoming lane, the movements of the lanes that follow it.
        self._named: dict[int, dict[int, set[int]]] = {}
        for intersection in graph.network.lanelet_network.intersections:
            for incoming in intersection.incomings:
                self._read(incoming)
        self._first: set[int] = {lane for names in self._named.values() for lane in names}
        self.turn: IntArray = np.zeros(len(graph), dtype=np.int64)
        found: list[LanePassage] = []
        for lane in range(len(graph)):
            if lane in self._named or not self._inside[lane]:
                found += [passage for follower in self._following(lane)
                          if self._begins(lane, follower, self._named.get(lane, {}))
                          for passage in self._through(lane, follower)]
            elif graph.predecessors[lane, 0] < 0:
                found += self._through(-1, lane)
        _decide(self.turn, ((passage.lanes, passage.turn) for passage in found))
        self.heading: FloatArray = graph.yaw[graph.first]
        self.angle: FloatArray = np.array([graph.turn(lane) for lane in range(len(graph))])
        _agree(self.heading, ((passage.lanes, passage.heading) for passage in found))
        _agree(self.angle, ((passage.lanes, passage.angle) for passage in found))

    def after(self, lane: int) -> IntArray:
        """
        Return the movements of the ways from a lane through the next junction, by lane.

        :return: (L) the movement of a way from here that leads over a lane; UNDECIDED where it
            still depends on later lanes, and everywhere else. The first decided lane of a way
            counts.
        """
        result = np.zeros(len(self._graph), dtype=np.int64)
        _decide(result, ((passage.lanes + (passage.exit,) * (passage.exit >= 0), passage.movement)
                         for passage in self._ahead(lane)))
        return result

    def is_first(self, lane: int) -> bool:
        """Return whether the file names a lane as first of a junction but not as incoming."""
        return lane in self._first and lane not in self._named

    def _read(self, incoming: IntersectionIncomingElement) -> None:
        index = self._graph.index
        named = [(index[i], movement) for movement, ids in (
            (STRAIGHT, incoming.successors_straight), (LEFT, incoming.successors_left),
            (RIGHT, incoming.successors_right)) for i in ids or () if i in index]
        for lanelet in incoming.incoming_lanelets or ():
            if lanelet in index:
                names = self._named.setdefault(index[lanelet], {})
                for lane, movement in named:
                    names.setdefault(lane, set()).add(movement)

    def _following(self, lane: int) -> list[int]:
        return [int(i) for i in self._graph.successors[lane] if i >= 0]

    def _begins(self, lane: int, follower: int, names: dict[int, set[int]]) -> bool:
        """Return whether a junction begins between two lanes."""
        return follower in names or (
            bool(self._inside[follower]) and follower not in self._named)

    def _ahead(self, lane: int) -> Iterator[LanePassage]:
        """List the ways through the next junction, at most `APPROACH` behind a lane."""
        if self.is_first(lane):
            before = [int(i) for i in self._graph.predecessors[lane] if i >= 0]
            for previous in before or [-1]:
                yield from self._through(previous, lane)
            return
        pending, seen = [(lane, self._named.get(lane, {}), 0.0)], {lane}
        while pending:
            current, names, distance = pending.pop()
            for follower in self._following(current):
                if self._begins(current, follower, names):
                    yield from self._through(current, follower, names)
                    continue
                beyond = distance + float(self._graph.length[follower])
                if follower not in seen and beyond < APPROACH:
                    seen.add(follower)
                    pending.append((follower, self._named.get(follower, names), beyond))

    def _through(self, before: int, first: int,
                 names: dict[int, set[int]] | None = None) -> list[LanePassage]:
        """List the ways through a junction from its lane `first`; `before` that lane, or -1."""
        names = self._named.get(before, {}) if names is None else names
        named = sorted(names.get(first, ()))
        ways = list(self._ways(first))
        graph, result = self._graph, []
        heading = float(graph.yaw[graph.first[first] if before < 0 else
                                  graph.first[before] + graph.count[before] - 1])
        for lanes, behind in ways:
            angle = self._angle((before, *lanes, behind))
            movement = turn = STRAIGHT if abs(angle) < TURN else LEFT if angle > 0.0 else RIGHT
            if named:
                best = min(named, key=lambda m: abs(angle - HEADING[m]))
                plausible = abs(angle - HEADING[best]) < PLAUSIBLE
                # A lanelet that leads to several exits may be named for one of them only.
                movement = best if plausible or len(ways) == 1 else movement
                turn = best if plausible else turn
            result.append(LanePassage(lanes, behind, movement, turn, heading, angle))
        return result

    def _ways(self, first: int) -> Iterator[tuple[tuple[int, ...], int]]:
        """List the ways inside a junction from a lane, and the lane behind each, or -1."""
        graph, found = self._graph, 0
        pending: list[tuple[tuple[int, ...], float]] = [((first,), float(graph.length[first]))]
        while pending and found < MAX_PASSAGES:
            lanes, length = pending.pop()
            following = self._following(lanes[-1])
            for follower in following or [-1]:
                if follower >= 0 and self._inside[follower] and follower not in lanes and (
                        follower not in self._named and length < LONGEST):
                    pending.append(((*lanes, follower), length + float(graph.length[follower])))
                else:
                    found += 1
                    yield lanes, follower

    def _angle(self, lanes: tuple[int, ...]) -> float:
        """Return the turn from the end of the first lane to the start of the last [rad]."""
        graph = self._graph
        first = np.array(lanes)
        begin = graph.yaw[graph.first[first]]
        end = graph.yaw[graph.first[first] + graph.count[first] - 1]
        inner = float((end - begin)[1:-1].sum())
        joints = [wrap_pi(float(begin[i + 1] - end[i])) for i in range(len(lanes) - 1)
                  if lanes[i] >= 0 and lanes[i + 1] >= 0]
        return inner + math.fsum(joints)


def _decide(result: IntArray, ways: Iterable[tuple[tuple[int, ...], int]]) -> None:
    """Write the movement of each lane whose ways all have the same."""
    found: dict[int, set[int]] = {}
    for lanes, movement in ways:
        for lane in lanes:
            found.setdefault(lane, set()).add(movement)
    for lane, movements in found.items():
        if len(movements) == 1:
            result[lane] = movements.pop()


def _agree(result: FloatArray, ways: Iterable[tuple[tuple[int, ...], float]]) -> None:
    """Write the angle of each lane whose ways all have nearly the same."""
    found: dict[int, list[float]] = {}
    for lanes, angle in ways:
        for lane in lanes:
            found.setdefault(lane, []).append(angle)
    for lane, angles in found.items():
        if max(abs(wrap_pi(angle - angles[0])) for angle in angles) < SAME:
            result[lane] = angles[0]


def _inside(graph: LaneGraph) -> NDArray[np.bool_]:
    """Return which lanes meet others that they neither lead into nor run beside."""
    lines = [shapely.LineString(np.stack((graph.x[a:b], graph.y[a:b]), axis=-1))
             for a, b in zip(graph.first, graph.first + graph.count, strict=True)]
    one, other = shapely.STRtree(lines).query(lines, predicate='dwithin', distance=MEETING)
    start = np.stack((graph.x, graph.y), axis=-1)[graph.first]
    end = np.stack((graph.x, graph.y), axis=-1)[graph.first + graph.count - 1]
    # Published maps leave out links: a lane that begins where another ends counts as linked.
    follows = np.hypot(*(end[one] - start[other]).T) < MEETING
    leads = np.hypot(*(end[other] - start[one]).T) < MEETING
    linked = (graph.successors[one] == other[:, None]).any(axis=1) | (
        graph.successors[other] == one[:, None]).any(axis=1)
    beside = np.array([j in graph.beside[i] or i in graph.beside[j]
                       for i, j in zip(one.tolist(), other.tolist(), strict=True)], dtype=bool)
    result = np.zeros(len(graph), dtype=bool)
    result[one[(one != other) & ~follows & ~leads & ~linked & ~beside]] = True
    return result
