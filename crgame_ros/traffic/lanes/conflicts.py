# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The places where lanes cross or merge, and the right of way there."""

import heapq
from typing import NamedTuple

from commonroad.common.common_lanelet import LaneletType
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.roads.signs import PRIORITY, sign_names, YIELDING
from crgame_ros.traffic.compiling.compiled import bare
from crgame_ros.traffic.lanes.lane_graph import (
    DrivingSide,
    FloatArray,
    IntArray,
    LaneGraph,
    RIGHT_HAND,
)
from crgame_ros.traffic.lanes.movements import LEFT, Movements, RIGHT, UNDECIDED
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
import shapely

# Two vehicles meet where their lanes' centres are closer than a vehicle's width and a margin [m].
WIDTH = 2.6
# The same for trucks; width of the widest vehicle, and of the widest that counts as a car [m].
WIDE, WIDEST, NARROW = 3.4, 2.55, 2.1
# Room between the sides of vehicles: where their ways cross, and where they pass each other in
# parallel [m].
CROSSING_MARGIN, PASSING_MARGIN = 0.8, 0.1
# Lanes whose headings differ by more than this over a conflict are the two ways of one road.
ONCOMING = 2.6
# Lanes whose headings differ by less than this run side by side, even if the file does not call
# them neighbours [rad].
ALONGSIDE = 0.2
TURN = 0.45
# A sign applies to the lanes that follow within this distance, until another lane joins [m].
SIGN_REACH = 80.0
# A roundabout is no longer than this [m], and its radii differ by at most this factor.
LARGEST_ROUNDABOUT, ROUND = 200.0, 1.4
# Neighbours whose centres come as near as this join [m].
JOINING = 1.2
# Lanes that merge count as one from where their centres are this near; the merge before that is at
# least as long as a car [m].
JOINED, SHORTEST_MERGE = 0.8, 5.0
# Lanes that merge do so without a turn if the cosine between their beginnings is greater.
SAME_WAY = 0.9


class ConflictTable(NamedTuple):
    """
    The rows (C) of `Conflicts`, and their extent on lanes (L) for two widths of vehicle.

    :param first, rows: (L) first row of each lane, and number of its rows.
    :param lane, other: (C) lane of the row; the same conflict seen from the other lane.
    :param start, end: (2, C) arc lengths between which cars, or wide vehicles, touch [m]
    :param distance: (C) between the centre lines where they are nearest [m]
    :param margin: (C) between the sides of vehicles that pass each other there [m]
    :param priority: (C) 1: this lane has the right of way, -1: the other lane has it, 0: first
        come, first served; 2 and -2: the same at the entry of a roundabout, even while the vehicle
        with the right of way stands.
    :param merges: (C) whether the lanes join for good.
    :param tapers: (C) whether they do so without a turn: their vehicles alternate.
    :param entry, leave: (2, L) arc length at which the first conflict of a lane begins, and at
        which a vehicle is clear of the last one, for narrow and for wide vehicles; inf and 0
        without one [m]
    """

    first: IntArray
    rows: IntArray
    lane: IntArray
    other: IntArray
    start: FloatArray
    end: FloatArray
    distance: FloatArray
    margin: FloatArray
    priority: IntArray
    merges: NDArray[np.bool_]
    tapers: NDArray[np.bool_]
    entry: FloatArray
    leave: FloatArray


@bare
def extent(width: float, other_width: float) -> int:
    """Return the extent of a conflict that counts for two vehicles: 0 if both are cars, or 1."""
    return 1 if max(width, other_width) > NARROW else 0


@bare
def spare_room(width: float, other_width: float) -> float:
    """
    Return how far a front may stand in a conflict so that another vehicle passes it there [m].

    Half the greatest width remains between them.

    :param width: of the vehicle that passes [m]
    """
    reach = WIDEST + CROSSING_MARGIN if extent(width, other_width) == 1 else WIDTH
    return reach - 0.5 * (width + WIDEST)


@bare
def touch(conflicts: ConflictTable, row: int, width: float, other_width: float) -> bool:
    """Return whether vehicles of two widths are in each other's way in a conflict."""
    between = 0.5 * (width + other_width) + conflicts.margin[row]
    return bool(conflicts.distance[row] < between)


class Conflicts:
    """
    Pairs of lanes that cross, merge or overlap; each is two rows, one seen from either lane.

    The rows of a lane are `first[lane]:first[lane] + count[lane]`.

    :param graph: the lanes.
    :param movements: of the lanes; computed if not given.
    :param side: of the road on which vehicles drive.

    Attribute `table`: the rows; its columns for cars are `lane`, `other`, `start`, `end` and
    `priority`.
    """

    def __init__(self, graph: LaneGraph, movements: Movements | None = None,
                 side: DrivingSide = RIGHT_HAND) -> None:
        self._graph = graph
        movements = Movements(graph) if movements is None else movements
        rows: list[tuple[int, int, _Stretch]] = []
        for i, j in _candidates(graph):
            here, there = _stretch(graph, i, j), _stretch(graph, j, i)
            # Neighbours share a border, but where one lane ends they may still merge.
            if here is None or there is None or _is_fork(graph, i, j, here, there):
                continue
            rows += [(i, j, here), (j, i, there)]
        rows.sort(key=lambda row: row[:2])
        self.lane: IntArray = np.array([r[0] for r in rows], dtype=np.int64)
        start = np.array([r[2].start for r in rows], dtype=np.float64).reshape(-1, 2).T.copy()
        end = np.array([r[2].end for r in rows], dtype=np.float64).reshape(-1, 2).T.copy()
        self.start: FloatArray = start[0]
        self.end: FloatArray = end[0]
        place = {(r[0], r[1]): n for n, r in enumerate(rows)}
        self.other: IntArray = np.array([place[r[1], r[0]] for r in rows], dtype=np.int64)
        self.count: IntArray = np.bincount(self.lane, minlength=len(graph)).astype(np.int64)
        self.first: IntArray = np.cumsum(self.count) - self.count
        self.rank: IntArray = np.array([_rank(graph, i) for i in range(len(graph))])
        ring = roundabouts(graph)
        self.priority: IntArray = np.array(
            [_priority(movements, side, self.rank, ring, r[0], r[1]) for r in rows],
            dtype=np.int64)
        # The lanes join for good: their vehicles continue one behind the other.
        last = self.end > graph.length[self.lane] - 1.0
        self.merges: NDArray[np.bool_] = last & last[self.other] if rows else last
        begins = graph.yaw[graph.first[self.lane]]
        tapers = self.merges & (np.cos(begins - begins[self.other]) > SAME_WAY)
        # A vehicle that has got this far is clear of the conflict.
        clear = end.copy()
        joined = np.array([r[2].joined for r in rows], dtype=np.float64)[self.merges]
        clear[:, self.merges] = np.minimum(end[:, self.merges], np.maximum(
            joined, start[:, self.merges] + SHORTEST_MERGE))
        distance = np.array([r[2].distance for r in rows], dtype=np.float64)
        margin = np.array([r[2].margin for r in rows], dtype=np.float64)
        entry, leave = np.full((2, len(graph)), np.inf), np.zeros((2, len(graph)))
        for wide, width in enumerate((NARROW, WIDEST)):
            counts = distance < 0.5 * (width + WIDEST) + margin
            np.minimum.at(entry[wide], self.lane[counts], start[1][counts])
            np.maximum.at(leave[wide], self.lane[counts], clear[1][counts])
        self.table = ConflictTable(
            self.first, self.count, self.lane, self.other, start, end, distance, margin,
            self.priority, self.merges, tapers, entry, leave)

    def __len__(self) -> int:
        return len(self.lane)

    def tapers(self) -> NDArray[np.bool_]:
        """Return which lanes (L) end in a merge without a turn in which they have to yield."""
        result = np.zeros(len(self._graph), dtype=bool)
        result[self.lane[self.table.tapers & (self.priority < 0)]] = True
        return result


def _candidates(graph: LaneGraph) -> list[tuple[int, int]]:
    lines = [shapely.LineString(np.stack((graph.x[a:b], graph.y[a:b]), axis=-1))
             for a, b in zip(graph.first, graph.first + graph.count, strict=True)]
    tree = shapely.STRtree(lines)
    left, right = tree.query(lines, predicate='dwithin', distance=WIDE)
    following = [{int(j) for j in row if j >= 0} for row in graph.successors]
    before = [{int(j) for j in row if j >= 0} for row in graph.predecessors]
    return sorted((int(i), int(j)) for i, j in zip(left, right, strict=True)
                  if i < j and not (_same_way(graph, int(i), int(j)) and lines[i].distance(
                      lines[j]) > JOINING) and j not in following[i] and i not in following[j]
                  and not before[i] & before[j])


def _same_way(graph: LaneGraph, i: int, j: int) -> bool:
    """Return whether two lanes are neighbours of one direction."""
    return j in (graph.left[i], graph.right[i]) or i in (graph.left[j], graph.right[j])


class _Stretch(NamedTuple):
    """
    The stretch of a lane within reach of another: for cars and for wide vehicles [m].

    :param joined: arc length from which both lanes are one up to their ends: vehicles on them
        follow each other, and the next may enter before the first has left.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    distance: float
    margin: float
    joined: float


def _stretch(graph: LaneGraph, i: int, j: int) -> _Stretch | None:
    """Find where lane i is within reach of lane j, as arc lengths on i."""
    a, b = graph.rows_of(i), graph.rows_of(j)
    there = cKDTree(np.stack((graph.x[b], graph.y[b]), axis=-1))
    distance, nearest = there.query(np.stack((graph.x[a], graph.y[a]), axis=-1))
    turn = np.abs(np.angle(np.exp(1j * (graph.yaw[a] - graph.yaw[b][nearest]))))
    # Vehicles that come towards each other or drive side by side keep to their lanes: little room
    # is enough.
    about = turn[distance < WIDE]
    beside = bool((about < ALONGSIDE).all()) and float(distance.min()) > PASSING_MARGIN + NARROW
    margin = PASSING_MARGIN if beside or bool((about > ONCOMING).all()) else CROSSING_MARGIN
    reach = 0.5 * (WIDEST + WIDEST) + margin
    close = np.flatnonzero(distance < min(reach, WIDE))
    # Lanes whose ends touch follow each other: vehicles on them are not in each other's way.
    if not len(close) or (distance.min() > 0.5 * WIDTH and len(close) < 4):
        return None
    near = np.flatnonzero(distance < min(reach, WIDTH))
    near = near if len(near) else close
    step = float(graph.step[i])
    apart = np.flatnonzero((distance > JOINED) | (turn > ALONGSIDE))
    joined = step * (apart[-1] + 1 if len(apart) else 0)
    return _Stretch((float(near[0] * step), float(close[0] * step)),
                    (float(near[-1] * step), float(close[-1] * step)),
                    float(distance.min()), margin, float(joined))


def _is_fork(graph: LaneGraph, i: int, j: int, first: _Stretch, second: _Stretch) -> bool:
    """Return whether two lanes only part: they begin together, or one ends where one begins."""
    here, there = (first.start[0], first.end[0]), (second.start[0], second.end[0])
    a, b = int(graph.first[i]), int(graph.first[j])
    between = float(np.hypot(graph.x[a] - graph.x[b], graph.y[a] - graph.y[b]))
    starts = here[0] < 1.0 and there[0] < 1.0 and between < JOINING
    same = abs(wrap_pi(float(graph.yaw[a] - graph.yaw[b]))) < 0.5
    joined = (here[0] > graph.length[i] - 3.0 and there[1] < 3.0) or (
        there[0] > graph.length[j] - 3.0 and here[1] < 3.0)
    return (starts and same) or joined


def _rank(graph: LaneGraph, lane: int) -> int:
    """Return the rank that signs before a lane give it: 2 priority, 1 no sign, 0 yield."""
    roads = graph.network.lanelet_network
    current, distance, seen = lane, 0.0, {lane}
    while True:
        lanelet = roads.find_lanelet_by_id(graph.ids[current])
        found = sign_names(lanelet, roads)
        if found & YIELDING or LaneletType.ACCESS_RAMP in lanelet.lanelet_type:
            return 0
        if found & PRIORITY:
            return 2
        before = [int(i) for i in graph.predecessors[current] if i >= 0]
        if len(before) != 1 or distance > SIGN_REACH or before[0] in seen:
            return 1
        distance += float(graph.length[current]) if current != lane else 0.0
        current = before[0]
        seen.add(current)


def roundabouts(graph: LaneGraph) -> NDArray[np.bool_]:
    """Return which lanes (L) belong to a roundabout: a small closed circle."""
    result = np.zeros(len(graph), dtype=bool)
    for lane in range(len(graph)):
        way = () if result[lane] else _way_around(graph, lane)
        if not way:
            continue
        rows = [graph.rows_of(i) for i in way]
        x, y = (np.concatenate([of[i] for i in rows]) for of in (graph.x, graph.y))
        middle = [0.5 * (float(of.max()) + float(of.min())) for of in (x, y)]
        radius = np.hypot(x - middle[0], y - middle[1])
        result[list(way)] |= bool(radius.max() < ROUND * radius.min())
    return result


def _way_around(graph: LaneGraph, lane: int) -> tuple[int, ...]:
    """Return the lanes of the shortest way from a lane back to itself; none if it is too long."""
    heap: list[tuple[float, tuple[int, ...]]] = [(float(graph.length[lane]), (lane,))]
    seen = {lane}
    while heap:
        length, way = heapq.heappop(heap)
        for onward in (int(i) for i in graph.successors[way[-1]] if i >= 0):
            if onward == lane:
                return way
            further = length + float(graph.length[onward])
            if onward not in seen and further <= LARGEST_ROUNDABOUT:
                seen.add(onward)
                heapq.heappush(heap, (further, (*way, onward)))
    return ()


def _priority(movements: Movements, side: DrivingSide, rank: IntArray, ring: NDArray[np.bool_],
              i: int, j: int) -> int:
    """
    Return the right of way of lane i over lane j, as in `ConflictTable.priority`.

    Signs decide first. Then traffic in a roundabout has the right of way, then a turn across
    oncoming traffic yields, and then priority to the right holds.
    """
    inside = 2 if ring[i] != ring[j] else 1
    if rank[i] != rank[j]:
        first = rank[i] > rank[j]
        return (inside if ring[i] == first else 1) * (1 if first else -1)
    if ring[i] != ring[j]:
        return 2 if ring[i] else -2
    # Movements through the whole junction count: a lanelet may be only the end of a turn.
    turn = wrap_pi(float(movements.heading[j] - movements.heading[i]))
    if abs(turn) > 2.2:
        across = [_turns_across(movements, side, lane) for lane in (i, j)]
        return 0 if across[0] == across[1] else -1 if across[0] else 1
    if abs(turn) < 0.6:
        bend = [abs(float(movements.angle[lane])) for lane in (i, j)]
        return 0 if abs(bend[0] - bend[1]) < 0.2 else 1 if bend[0] < bend[1] else -1
    # A vehicle that comes from the right has a heading turned to the left.
    return -1 if (turn > 0.0) is not side.priority_to_left else 1


def _turns_across(movements: Movements, side: DrivingSide, lane: int) -> bool:
    """Return whether a lane belongs to a turn over the lanes of oncoming traffic."""
    if movements.turn[lane] == UNDECIDED:
        angle = float(movements.angle[lane])
        return (-angle if side.keeps_left else angle) > TURN
    return bool(movements.turn[lane] == (RIGHT if side.keeps_left else LEFT))
