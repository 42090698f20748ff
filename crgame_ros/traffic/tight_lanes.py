# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Lanes that are too tight for cars or long vehicles, found by trial drives along them.

Centre lines of published maps bend with radii down to 3 m, along the inner edge of wide junctions.
Real drivers use the room that there is, so agents swing out where that helps.
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

# A point farther beyond the road than this is off it; in traffic it is a decimetre farther [m].
SPARE = 0.05
# Steps in which the distance off the road is measured [m].
OFF = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.3, 2.0)
# Lanes that are wider than the vehicle by this, and straighter than this, need no trial [m, 1/m].
EASY_WIDTH, EASY_BEND = 0.6, 0.02
# Distance before a lane at which a trial begins, and behind it at which it ends [m]; interval of
# the checks [s] and steps of the motion in it.
RUN_UP, RUN_OUT, STEP_S, SUBSTEPS = 20.0, 10.0, 0.1, 10
# Only this length is tried of a longer stretch, which lanes have only by mistake [m].
LONGEST = 1000.0
# Trials are driven at these speeds at most, slower where the road bends, but at least at the
# slowest of them [m/s]: a slow vehicle follows a bend's shift to the inside in full, a fast one
# late.
SPEEDS = (2.5, 8.0)
# Ways driven at once: each takes a table row as long as the number of lanes.
AT_ONCE = 256
# Points this near to the map's edge are not checked [m].
EDGE = 0.5
# Swings that are tried, the least first [m]; then the distance before and behind the tight place
# over which the vehicle swings out, and over which it gets there [m].
SWINGS, LONG_SWINGS = (0.2, 0.3, -0.3), (0.3, 0.6, 0.9, 1.2)
AROUND, WITHIN = 4.0, 6.0
# Long vehicles may reach this far over the edges of their lanes [m].
ASIDE = 0.6


def find_tight_lanes(graph: LaneGraph, car: Shape, large_car: Shape,
                     truck: Shape) -> NDArray[np.bool_]:
    """
    Return the lanes (2, L) on which cars and long vehicles (2) leave the road, driven as agents.

    Each lane with a bend, a kink or little width is driven from every lane before it to every
    lane behind it. Where large cars or trucks leave the road, swings are tried, and those that
    help are written to `Point.swing` and `swing_long` of the graph. Lanes where trucks have to
    swing out, or sweep over lanes beside, still count as too tight for them: trucks would get in
    the way of vehicles that wait there.
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
        """Return how far points (N) are off the road, rounded up to a step of `OFF` [m]."""
        result = np.zeros(len(x))
        left = np.arange(len(x))
        for area, away in zip(self._areas, OFF, strict=True):
            left = left[~shapely.contains_xy(area, x[left], y[left])]
            result[left] = away
        return result


class _Tight(NamedTuple):
    """
    The places where a vehicle leaves the road on lanes (L).

    :param off: greatest distance off the road [m]
    :param begin, end: arc lengths of its centre between which it is off the road [m]
    :param sweeps: whether it reaches too far beyond the lanes of its way.
    """

    off: FloatArray
    begin: FloatArray
    end: FloatArray
    sweeps: NDArray[np.bool_]


class _Trials:
    """
    Trial drives of a vehicle along the lanes that bend or are narrow.

    Attribute `ways`: (N, 3) from every lane before such a lane to every lane behind it.
    """

    def __init__(self, graph: LaneGraph, area: _Area, shape: Shape) -> None:
        self._graph, self._area, self._shape = graph, area, shape
        # Arc lengths between which each lane is tried [m].
        self._extent = _suspicious(graph, shape)
        self._envelope = envelope_of(graph.table, graph.curve_speed)
        self._reference = np.zeros(len(graph.x))
        self.ways = _ways(graph, np.flatnonzero(np.isfinite(self._extent[:, 0])))

    def drive(self, ways: IntArray, aside: float | None = None) -> _Tight:
        """
        Drive ways (N, 3), and return how far off the road the vehicle gets on their middle lanes.

        :param aside: distance from its way's lanes beyond which the vehicle sweeps over others
            [m]; not checked if not given.
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
        """Return the area of the lanes of a way (3), enlarged by a distance [m]."""
        ids = self._graph.ids
        return shapely.buffer(self._graph.network.area_of(
            ids[i] for i in way.tolist() if i >= 0), aside)

    def swing_out(self, of: str, swings: Sequence[float], tight: _Tight) -> None:
        """
        Set the swing of tight lanes to the first with which the vehicle is least off the road.

        :param of: column of the lanes' points to set, for the kind of vehicle.
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
        # Swings of consecutive lanes may not fit together.
        worse = self.drive(ways).off > tight.off
        for lane in np.unique(ways[worse[ways[:, 1]]]).tolist():
            if lane >= 0:
                set_to[graph.rows_of(lane)] = 0.0

    def _bump(self, lane: int, tight: _Tight) -> FloatArray:
        """Return the swing at the points of a lane that moves the vehicle 1 m to the outside."""
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
        # No road is needed beyond the map's edges.
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
        """Return an agent before the tried stretch of each way (N, 3), and their routes."""
        graph, shape = self._graph, self._shape
        agents = Agents([ObjectDescription('trial', 'truck', Role.TRAFFIC, shape)] * len(ways))
        # A way goes on behind its last lane, because agents steer for a point ahead.
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
    """Return the arc lengths (L, 2) between which lanes bend or are narrow; inf, -inf if none."""
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
