# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which lanes are too tight for whom, and where swinging out helps: found by driving along them.

Centre lines of published maps bend as sharply as 3 m, along the inner edge of wide junctions. Who
drives there takes the room that there is.
"""

from collections.abc import Sequence
from itertools import pairwise, product
from typing import NamedTuple

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.shape import Shape
from crgame_ros.traffic.agents import Agents, REAR_TO_CENTER
from crgame_ros.traffic.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lane_table import column_of
from crgame_ros.traffic.longitudinal import envelope_of
from crgame_ros.traffic.motion import move
import numpy as np
from numpy.typing import NDArray
import shapely

# Beyond the road by so much is off it: in traffic it becomes a decimetre more [m].
SPARE = 0.05
# How far off it is told by steps [m].
OFF = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.3, 2.0)
# Lanes that are wider than the vehicle by this, and straighter, are not tried [m, 1/m].
EASY_WIDTH, EASY_BEND = 0.6, 0.02
# How far before a lane a trial begins, how far behind it ends, and how often one looks [m, s].
RUN_UP, RUN_OUT, STEP_S, SUBSTEPS = 20.0, 10.0, 0.1, 10
# Of a longer stretch, which lanes have only by mistake, the begin is tried [m].
LONGEST = 1000.0
# Trials are driven at these speeds at most, or slower where the road bends, and at the slowest of
# them at least [m/s]: who is slow follows a bend's shift to the inside in full, who is fast late.
SPEEDS = (2.5, 8.0)
# Ways driven at once: each takes a row as long as the map has lanes.
AT_ONCE = 256
# So near to the map's edge one does not look [m].
EDGE = 0.5
# How far out one swings [m], the least first; from how far before the place that is too tight to
# how far behind it, and within what way one gets there [m].
SWINGS, LONG_SWINGS = (0.2, 0.3, -0.3), (0.3, 0.6, 0.9, 1.2)
AROUND, WITHIN = 4.0, 6.0
# Long vehicles get this far over the edges of their lanes [m].
ASIDE = 0.6


def find_tight_lanes(graph: LaneGraph, car: Shape, large_car: Shape,
                     truck: Shape) -> NDArray[np.bool_]:
    """
    Return the lanes (2, L) on which cars and long vehicles (2) leave the road, as agents drive.

    Each lane with a bend, a kink or little width is driven from every lane before it to every
    lane behind it. Where one leaves the road it is tried whether swinging out helps, and
    `Point.swing` and `swing_long` of the graph are set, for large cars and trucks. Lanes where
    trucks have to, or sweep over lanes beside, count as too tight for them all the same: they get
    in the way of those who wait there.
    """
    area = _Area(graph.network.road_area())
    cars, large_cars, trucks = (_Trials(graph, area, x) for x in (car, large_car, truck))
    for_trucks = trucks.drive(trucks.ways, aside=ASIDE)
    large_cars.swing_out('swing', SWINGS, large_cars.drive(large_cars.ways))
    trucks.swing_out('swing_long', LONG_SWINGS, for_trucks)
    return np.array([cars.drive(cars.ways).off > 0.0, (for_trucks.off > 0.0) | for_trucks.sweeps])


class _Area:
    """The road, with as much around it as counts as road."""

    def __init__(self, road: shapely.Geometry) -> None:
        self._areas = [shapely.buffer(road, beyond) for beyond in (SPARE, *OFF[:-1])]
        for area in self._areas:
            shapely.prepare(area)

    def off(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return how far points (N) are off it at most, as steps of `OFF` [m]."""
        result = np.zeros(len(x))
        left = np.arange(len(x))
        for area, away in zip(self._areas, OFF, strict=True):
            left = left[~shapely.contains_xy(area, x[left], y[left])]
            result[left] = away
        return result


class _Tight(NamedTuple):
    """
    Where a vehicle leaves the road on lanes (L).

    :param off: how far at most [m]
    :param begin, end: arc lengths of its centre between which it does [m]
    :param sweeps: whether it gets too far over the lanes of its way.
    """

    off: FloatArray
    begin: FloatArray
    end: FloatArray
    sweeps: NDArray[np.bool_]


class _Trials:
    """
    Drives of a vehicle along the lanes that bend or are narrow.

    Attribute `ways`: (N, 3) from every lane before one of these to every lane behind it.
    """

    def __init__(self, graph: LaneGraph, area: _Area, shape: Shape) -> None:
        self._graph, self._area, self._shape = graph, area, shape
        # From where to where each lane is tried [m].
        self._extent = _suspicious(graph, shape)
        self._envelope = envelope_of(graph.table, graph.curve_speed)
        self._reference = np.zeros(len(graph.x))
        self.ways = _ways(graph, np.flatnonzero(np.isfinite(self._extent[:, 0])))

    def drive(self, ways: IntArray, aside: float | None = None) -> _Tight:
        """
        Drive ways (N, 3), and note for the lanes in their middles how far off the road one gets.

        :param aside: farther from its way's lanes a vehicle sweeps over others [m]; not looked at
            if not given.
        """
        lanes = len(self._graph)
        result = _Tight(np.zeros(lanes), np.full(lanes, np.inf), np.full(lanes, -np.inf),
                        np.zeros(lanes, dtype=bool))
        for begin, speed in product(range(0, len(ways), AT_ONCE), SPEEDS):
            some = ways[begin:begin + AT_ONCE]
            way, s, x, y = self._drive(some, speed)
            away = self._area.off(x, y)
            off = np.flatnonzero(away)
            lane = some[way[off], 1]
            np.maximum.at(result.off, lane, away[off])
            np.minimum.at(result.begin, lane, s[off])
            np.maximum.at(result.end, lane, s[off])
            if aside is not None:
                first = np.searchsorted(way, np.arange(len(some) + 1))
                for lanes_of, (a, b) in zip(some, pairwise(first.tolist()), strict=True):
                    result.sweeps[lanes_of[1]] |= not shapely.contains_xy(
                        self._around(lanes_of, aside), x[a:b], y[a:b]).all()
        return result

    def _around(self, way: IntArray, aside: float) -> shapely.Geometry:
        """Return the lanes of a way (3) and what is near them."""
        ids = self._graph.ids
        return shapely.buffer(self._graph.network.area_of(
            ids[i] for i in way.tolist() if i >= 0), aside)

    def swing_out(self, of: str, swings: Sequence[float], tight: _Tight) -> None:
        """
        Set the swing of tight lanes to the least with which the vehicle stays on the road most.

        :param of: whom, a column of the lanes' points.
        :param swings: to try, the least first [m]
        """
        lanes = np.flatnonzero(tight.off > 0.0)
        if not len(lanes):
            return
        graph, ways = self._graph, _ways(self._graph, lanes)
        set_to, least = column_of(graph.table.line, of), tight.off.copy()
        unit = np.zeros(len(graph.x))
        for lane in lanes.tolist():
            unit[graph.rows_of(lane)] = self._bump(lane, tight)
        best = np.zeros(len(graph.x))
        for swing in swings:
            tried = swing * unit
            set_to += tried
            off = self.drive(ways).off
            set_to -= tried
            for lane in lanes[off[lanes] < least[lanes]].tolist():
                rows = graph.rows_of(lane)
                best[rows], least[lane] = tried[rows], off[lane]
        set_to += best
        # Swings of lanes one behind the other may not go together.
        worse = self.drive(ways).off > tight.off
        for lane in np.unique(ways[worse[ways[:, 1]]]).tolist():
            if lane >= 0:
                set_to[graph.rows_of(lane)] = 0.0

    def _bump(self, lane: int, tight: _Tight) -> FloatArray:
        """Return the swing at the points of a lane with which the vehicle is 1 m farther out."""
        graph, shape = self._graph, self._shape
        s = np.arange(int(graph.count[lane])) * graph.step[lane]
        begin, end = tight.begin[lane] - AROUND, tight.end[lane] + AROUND
        # Positive is away from the inside of the bend.
        bend = graph.curvature[graph.rows_of(lane)]
        outside = -np.sign(bend[np.abs(bend).argmax()])
        front = REAR_TO_CENTER * shape.length + 0.5 * shape.length
        return np.asarray(outside / front**2 * np.interp(
            s, (begin - WITHIN, begin, end, end + WITHIN), (0.0, 1.0, 1.0, 0.0)))

    def _drive(self, ways: IntArray,
               top: float) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
        """
        Drive ways (N, 3) of lanes.

        :return: in the order of ways: way, the centre's arc length in the middle lane, x and y of
            all corners there and around it [m]
        """
        graph, shape = self._graph, self._shape
        bad_from, bad_to = self._extent[ways[:, 1]].T
        agents, following = self._at_starts(ways)
        # Nobody needs a road beyond the map's edges.
        margin = 0.5 * shape.length + EDGE
        begin = np.where(ways[:, 0] < 0, margin, -np.inf)
        last = np.where(ways[:, 2] < 0, ways[:, 1], ways[:, 2])
        whole = graph.length[ways[:, 1]] + np.where(ways[:, 2] < 0, 0.0, graph.length[last])
        end = np.minimum(np.where(graph.successors[last, 0] < 0, whole - margin, np.inf),
                         bad_to + RUN_OUT)
        found: list[tuple[IntArray, FloatArray, FloatArray]] = []
        slots = np.arange(len(ways))
        longest = min(float((bad_to - bad_from).max()), LONGEST) + 2.0 * (RUN_UP + RUN_OUT)
        for _ in range(int(longest / (SPEEDS[0] * STEP_S))):
            points = graph.rows(agents.lane[slots], agents.s[slots])
            agents.speed[slots] = np.clip(self._envelope[points], SPEEDS[0], top)
            move(graph.table, following, agents.table, slots, self._reference, SUBSTEPS,
                 STEP_S / SUBSTEPS)
            before, middle, behind = (agents.lane[slots, None] == ways[slots]).T
            length = graph.length[ways[slots]]
            at = agents.s[slots] + np.where(before, -length[:, 0], np.where(
                middle, 0.0, np.where(behind, length[:, 1], -np.inf)))
            on = (at > np.maximum(begin[slots], -shape.length)) & (at < end[slots])
            near = slots[on]
            found.append((near, at[on], agents.centers()[near]))
            slots = slots[~((at > np.minimum(length[:, 1] + RUN_OUT, end[slots]))
                            | (agents.previous[slots] == ways[slots, 2]) & (ways[slots, 2] >= 0))]
            if not len(slots):
                break
        way, at, centers = (np.concatenate(part) for part in zip(*found, strict=True))
        order = np.argsort(way, kind='stable')
        corners = placed(outline(shape), centers[order]).reshape(-1, 2)
        return np.repeat(way[order], 4), np.repeat(at[order], 4), corners[:, 0], corners[:, 1]

    def _at_starts(self, ways: IntArray) -> tuple[Agents, IntArray]:
        """Place an agent before what is to be tried on each way (N, 3); and give their routes."""
        graph, shape = self._graph, self._shape
        agents = Agents([ObjectDescription('trial', 'truck', Role.TRAFFIC, shape)] * len(ways))
        # Behind its last lane a way goes on somewhere: one steers for what is ahead.
        following = np.tile(graph.successors[:, 0], (len(ways), 1))
        for i, (before, lane, behind) in enumerate(ways.tolist()):
            chain, back = [lane], 0.0
            while before >= 0 and before not in (*chain, behind):
                chain.insert(0, before)
                back += float(graph.length[before])
                before = int(graph.predecessors[before, 0]) if back < RUN_UP else -1
            following[i, chain] = [*chain[1:], behind]
            least = min(0.5 * shape.length, float(graph.length[chain[0]]))
            start = max(back + self._extent[lane, 0] - RUN_UP, least)
            while start > graph.length[chain[0]] and len(chain) > 1:
                start -= float(graph.length[chain.pop(0)])
            pose = graph.poses(np.array(chain[:1]), np.array([start]), np.zeros(1))[0].tolist()
            agents.put(i, chain[0], start, 0.0, pose, SPEEDS[0])
        agents.destination[:] = np.arange(len(ways))
        return agents, following


def _suspicious(graph: LaneGraph, shape: Shape) -> FloatArray:
    """Return from where to where lanes (L, 2) bend or are narrow [m]; inf, -inf if nowhere."""
    wide = 0.5 * shape.width + 0.5 * EASY_WIDTH
    bad = (graph.half_width < wide) | (np.abs(graph.curvature) > EASY_BEND)
    s = (np.arange(len(bad)) - np.repeat(graph.first, graph.count)) * np.repeat(
        graph.step, graph.count)
    return np.stack((np.minimum.reduceat(np.where(bad, s, np.inf), graph.first),
                     np.maximum.reduceat(np.where(bad, s, -np.inf), graph.first)), axis=-1)


def _ways(graph: LaneGraph, lanes: IntArray) -> IntArray:
    """List the ways (N, 3) from every lane before some lanes to every lane behind them."""
    return np.array([way for lane in lanes.tolist() for way in product(
        _or_none(graph.predecessors[lane]), [lane], _or_none(graph.successors[lane]))],
        dtype=np.int64).reshape(-1, 3)


def _or_none(lanes: IntArray) -> list[int]:
    return [int(i) for i in lanes if i >= 0] or [-1]
