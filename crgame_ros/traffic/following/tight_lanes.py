# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Lanes that are too tight for cars or long vehicles, found by trial drives along them.

Centre lines of published maps bend with radii down to 3 m, along the inner edge of wide junctions.
Real drivers use the room that there is, so agents swing out where that helps.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise, product
import math
from typing import NamedTuple

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.shape import Shape
from crgame_ros.traffic.compiling.compiled import compiled
from crgame_ros.traffic.fleet.agents import Agents, AgentTable, REAR_TO_CENTER, write_centers
from crgame_ros.traffic.following.longitudinal import COASTING, envelope_of
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.lane_table import column_of, LaneTable, nearest_row
from crgame_ros.traffic.lanes.pursuit import LONG_FRONT
from crgame_ros.traffic.motion.motion import move
import numpy as np
from numpy.typing import NDArray
import shapely

# A point farther beyond the road than this is off it; in traffic it is a decimetre farther [m].
SPARE = 0.05
# A swing that keeps this away from the edge is better than one that does not [m].
MARGIN = 0.05
# Steps in which the distance off the road is measured [m].
OFF = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.3, 2.0)
# Lanes that are wider than the vehicle by this, and straighter than this, need no trial [m, 1/m].
EASY_WIDTH, EASY_BEND = 0.6, 0.02
# Distance before a lane at which a trial begins, and behind it at which it ends [m]; interval of
# the checks [s] and steps of the motion in it.
RUN_UP, RUN_OUT, STEP_S, SUBSTEPS = 20.0, 10.0, 0.1, 5
# Only this length is tried of a longer stretch, which lanes have only by mistake [m].
LONGEST = 1000.0
# Trials are driven at these speeds at most, slower where the road bends, but at least at the
# slowest of them [m/s]: a slow vehicle follows a bend's shift to the inside in full, a fast one
# late. A search for swings drives with more of them, so that what it finds holds for all.
SPEEDS, SEARCH_SPEEDS = (2.5, 8.0), (2.5, 3.3, 8.0)
# Behind a bend vehicles speed up with this [m/s^2].
GAIN = 1.5
# Ways driven at once: each takes a table row as long as the number of lanes.
AT_ONCE = 256
# Points this near to the map's edge are not checked [m].
EDGE = 0.5
# A swing changes linearly between knots this far apart, in distances from rear axle to front, and
# up to this distance before and behind the tight place [m], also on the lanes there.
KNOTS, AROUND = 0.8, 8.0
# Changes of the swing at one knot that are tried, one after the other [m], as long as they lower
# the cost to this share.
CHANGES, HELPS = (0.4, 0.8, 0.4, 0.2, 0.1), 0.8
# A swing costs the squared distance off the road, and the distance times `OFF_COST` [m]; for a
# corner beyond each of the distances `ASIDES` from the way's lanes [m] `ASIDE_COST` [m^2], of cars
# and of long vehicles; and the square of the lateral acceleration beyond `LATERAL` [m/s^2], times
# `LATERAL_COST` [s^4].
OFF_COST = 0.3
ASIDES, ASIDE_COST = (0.3, 0.6, 0.9, 1.2), 0.012
LONG_ASIDES, LONG_ASIDE_COST = (0.4, 0.7, 1.0, 1.3, 1.6), 0.03
LATERAL, LATERAL_COST = 2.0, 0.005
# Where a vehicle is off the road over more than this, its lane is broken and no swing helps [m].
BROKEN = 50.0
# Long vehicles may reach this far over the edges of their lanes [m].
ASIDE = 0.6


def find_tight_lanes(graph: LaneGraph, cars: Sequence[Shape], truck: Shape,
                     recorded: Sequence[Shape] = ()) -> NDArray[np.bool_]:
    """
    Return the lanes (2, L) on which cars and trucks (2) leave the road, driven as agents.

    Each lane with a bend, a kink or little width is driven from every lane before it to every
    lane behind it. Where vehicles leave the road, swings are tried, and those that help are
    written to `Point.swing` and `swing_long` of the graph. Lanes where trucks have to swing out,
    or sweep over lanes beside, still count as too tight for them: trucks would get in the way of
    vehicles that wait there.

    :param cars: that may drive there; the first counts for the result.
    :param recorded: long vehicles that may have no other way than through lanes that are too
        tight for them; trucks swing out only if there are any, because that takes seconds.
    """
    area = _Area(graph.network.road_area())
    small, long = ([_Trials(graph, area, x) for x in some] for some in (cars, recorded))
    trucks = _Trials(graph, area, truck)
    for_trucks = trucks.drive(trucks.ways, aside=ASIDE)
    _swing_out(graph, small, 'swing')
    if recorded:
        _swing_out(graph, long, 'swing_long')
    return np.array([small[0].drive(small[0].ways).off > 0.0,
                     (for_trucks.off > 0.0) | for_trucks.sweeps])


def _swing_out(graph: LaneGraph, trials: Sequence['_Trials'], of: str) -> None:
    """
    Set the swing of tight lanes so that vehicles are least off the road, by a pattern search.

    :param of: column of the lanes' points to set, for the kind of vehicle.
    """
    swing = column_of(graph.table.line, of)
    tight = [x.drive(x.ways) for x in trials]
    begin = np.min([x.begin for x in tight], axis=0)
    end = np.max([x.end for x in tight], axis=0)
    off = np.max([x.off for x in tight], axis=0)
    for lanes in _apart(graph, np.flatnonzero((off > 0.0) & (end - begin < BROKEN))):
        hats = {lane: _hats(graph, trials[0].front, lane, float(begin[lane]), float(end[lane]))
                for lane in lanes}
        around = {lane: [lane, *_beside(graph, lane)] for lane in lanes}
        ways = [{lane: x.ways[np.isin(x.ways[:, 1], around[lane])] for lane in lanes}
                for x in trials]
        least = _costs(trials, ways, around, lanes)
        active = lanes
        for change in CHANGES:
            before = least.copy()
            for n, sign in product(range(max(len(hats[i]) for i in active)), (1.0, -1.0)):
                tried = [lane for lane in active if n < len(hats[lane])]
                while tried:
                    old = [swing[hats[lane][n][0]].copy() for lane in tried]
                    for lane in tried:
                        rows, hat = hats[lane][n]
                        swing[rows] += sign * change * hat
                    now = _costs(trials, ways, around, tried)
                    for lane, values in zip(tried, old, strict=True):
                        if now[lane] >= least[lane]:
                            swing[hats[lane][n][0]] = values
                    tried = [lane for lane in tried if now[lane] < least[lane]]
                    least |= {lane: now[lane] for lane in tried}
            # What did not help is given up.
            active = [lane for lane in active if 0.0 < least[lane] < HELPS * before[lane]]
            if not active:
                break


def _costs(trials: Sequence['_Trials'], ways: Sequence[Mapping[int, IntArray]],
           around: Mapping[int, list[int]], lanes: list[int]) -> dict[int, float]:
    """
    Return the costs of driving on and beside some lanes that are far from each other.

    :param ways: of each trial, by lane.
    :param around: each lane and those beside it.
    """
    cost = np.sum([x.cost(np.concatenate([of[lane] for lane in lanes]))
                   for x, of in zip(trials, ways, strict=True)], axis=0)
    return {lane: float(cost[around[lane]].sum()) for lane in lanes}


def _hats(graph: LaneGraph, front: float, lane: int, begin: float,
          end: float) -> list[tuple[slice, FloatArray]]:
    """
    Return, for each knot around a tight place, the rows of its lane and the swing of 1 m there.

    :param front: of the vehicle, from the rear axle [m]
    :param begin, end: of the tight place [m]
    """
    begin, end = max(begin - AROUND, 0.0), min(end + AROUND, float(graph.length[lane]))
    apart = KNOTS * front
    knots = [(lane, s) for s in np.linspace(begin, end, 1 + math.ceil((end - begin) / apart))]
    # Vehicles of other ways do not swing out for it.
    knots += [(i, graph.length[i] - s) for i in _or_none(graph.predecessors[lane])
              if i >= 0 and len(_or_none(graph.successors[i])) == 1 for s in (0.0, apart)]
    knots += [(i, s) for i in _or_none(graph.successors[lane])
              if i >= 0 and len(_or_none(graph.predecessors[i])) == 1 for s in (0.0, apart)]
    return [(graph.rows_of(of), np.maximum(1.0 - np.abs(
        np.arange(int(graph.count[of])) * graph.step[of] - at) / apart, 0.0) / front**2)
        for of, at in knots]


class _Area:
    """The road, with as much around it as counts as road."""

    def __init__(self, road: shapely.Geometry) -> None:
        self._areas = [shapely.buffer(road, beyond) for beyond in (-MARGIN, SPARE, *OFF[:-1])]
        shapely.prepare(self._areas)

    def off(self, x: FloatArray, y: FloatArray, with_margin: bool = False) -> FloatArray:
        """
        Return how far points (N) are off the road, rounded up to a step of `OFF` [m].

        :param with_margin: points on the road near its edge are the first step off it.
        """
        result = np.zeros(len(x))
        left = np.arange(len(x))
        steps = list(zip(self._areas, (OFF[0], *OFF), strict=True))
        for area, away in steps if with_margin else steps[1:]:
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
        self._enlarged: dict[tuple[int, ...], list[shapely.Geometry]] = {}
        self.front = REAR_TO_CENTER * shape.length + 0.5 * shape.length
        is_long = self.front >= LONG_FRONT
        self._asides: tuple[float, ...] = LONG_ASIDES if is_long else ASIDES
        self._aside_cost = LONG_ASIDE_COST if is_long else ASIDE_COST
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
            way, s, x, y, _ = self._drive(some, speed)
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

    def cost(self, ways: IntArray) -> FloatArray:
        """Return what driving ways (N, 3) costs, for each lane (L) that is one's middle."""
        result = np.zeros(len(self._graph))
        for begin, speed in product(range(0, len(ways), AT_ONCE), SEARCH_SPEEDS):
            some = ways[begin:begin + AT_ONCE]
            way, _, x, y, lateral = self._drive(some, speed)
            off = self._area.off(x, y, with_margin=True)
            cost = off * (off + OFF_COST)
            cost += LATERAL_COST * np.maximum(np.abs(lateral) - LATERAL, 0.0)**2
            first = np.searchsorted(way, np.arange(len(some) + 1))
            for lanes, (a, b) in zip(some.tolist(), pairwise(first.tolist()), strict=True):
                left = np.arange(a, b)
                for area in self._areas_beside(tuple(lanes)):
                    left = left[~shapely.contains_xy(area, x[left], y[left])]
                    cost[left] += self._aside_cost
            np.add.at(result, some[way, 1], cost)
        return result

    def _areas_beside(self, way: tuple[int, ...]) -> list[shapely.Geometry]:
        """Return the areas of a way's lanes, enlarged by each of the distances that cost."""
        if way not in self._enlarged:
            self._enlarged[way] = [self._around(np.array(way), aside) for aside in self._asides]
            shapely.prepare(self._enlarged[way])
        return self._enlarged[way]

    def _around(self, way: IntArray, aside: float) -> shapely.Geometry:
        """Return the area of the lanes of a way (3), enlarged by a distance [m]."""
        graph, length = self._graph, self._shape.length
        lanes = way[way >= 0].tolist()
        return shapely.buffer(graph.network.area_of(graph.ids[i] for i in {
            *lanes, *_chain(graph, graph.predecessors, lanes[0], length),
            *_chain(graph, graph.successors, lanes[-1], length)}), aside)

    def _drive(self, ways: IntArray, top: float,
               ) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """
        Drive ways (N, 3) of lanes.

        :return: in the order of ways: way, the centre's arc length in the middle lane, x and y of
            all corners there and around it [m], and the lateral acceleration [m/s^2]
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
        longest = np.minimum(bad_to - bad_from, LONGEST) + 2.0 * (RUN_UP + RUN_OUT)
        steps = (longest / (SPEEDS[0] * STEP_S)).astype(np.int64)
        way, at, centers, lateral = _drive(
            graph.table, following, agents.table, ways, np.maximum(begin, -shape.length), end,
            steps, self._envelope, self._reference, top)
        corners = placed(outline(shape), centers).reshape(-1, 2)
        return (np.repeat(way, 4), np.repeat(at, 4), corners[:, 0], corners[:, 1],
                np.repeat(lateral, 4))

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


@compiled
def _drive(lanes: LaneTable, following: IntArray, agents: AgentTable, ways: IntArray,
           begin: FloatArray, end: FloatArray, steps: IntArray, envelope: FloatArray,
           reference: FloatArray, top: float,
           ) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """
    Drive one agent along each way (N, 3) of lanes.

    :param begin, end: (N) arc lengths in the middle lane between which poses are returned [m]
    :param steps: (N) longest drive.
    :param envelope: speed at each row of the lanes' tables [m/s]
    :return: way (K), arc length in its middle lane (K) and pose (K, 3) of the centre [m, rad],
        lateral acceleration (K) [m/s^2]
    """
    way, at = np.empty(steps.sum(), np.int64), np.empty(steps.sum())
    poses, velocities = np.empty((steps.sum(), 3)), np.empty((1, 3))
    lateral = np.empty(steps.sum())
    slots, count = np.zeros(1, np.int64), 0
    for n in range(len(ways)):
        slots[0] = n
        before, middle, behind = ways[n, 0], ways[n, 1], ways[n, 2]
        for _ in range(steps[n]):
            lane = agents.lane[n]
            wanted = envelope[nearest_row(lanes, lane, agents.s[n])]
            onto = following[n, lane]
            if onto >= 0:
                wanted = min(wanted, math.sqrt(envelope[lanes.first[onto]]**2 + 2.0 * COASTING
                                               * max(lanes.length[lane] - agents.s[n], 0.0)))
            agents.speed[n] = max(min(wanted, top, agents.speed[n] + GAIN * STEP_S), SPEEDS[0])
            move(lanes, following, agents, slots, reference, SUBSTEPS, STEP_S / SUBSTEPS)
            lane, s = agents.lane[n], agents.s[n]
            if lane == before:
                s -= lanes.length[before]
            elif lane == middle:
                pass
            elif lane == behind:
                s += lanes.length[middle]
            else:
                s = -math.inf
            if begin[n] < s < end[n]:
                way[count], at[count] = n, s
                write_centers(agents, slots, poses[count:count + 1], velocities)
                lateral[count] = agents.speed[n] * agents.yaw_rate[n]
                count += 1
            if s > min(lanes.length[middle] + RUN_OUT, end[n]) or (
                    behind >= 0 and agents.previous[n] == behind):
                break
    return way[:count], at[:count], poses[:count], lateral[:count]


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


def _chain(graph: LaneGraph, following: IntArray, lane: int, length: float) -> Iterator[int]:
    """Yield the lanes that a vehicle of a length also covers before or behind a lane."""
    some = _or_none(following[lane])
    while length > 0.0 and some[0] >= 0:
        yield from some
        length -= float(graph.length[some[0]])
        some = _or_none(following[some[0]]) if len(some) == 1 else [-1]


def _beside(graph: LaneGraph, lane: int) -> list[int]:
    """List the lanes before and behind a lane."""
    return [int(i) for i in (*graph.predecessors[lane], *graph.successors[lane]) if i >= 0]


def _apart(graph: LaneGraph, lanes: IntArray) -> list[list[int]]:
    """Divide lanes into lists in which no two are near each other."""
    result: list[list[int]] = []
    near: list[set[int]] = []
    for lane in lanes.tolist():
        here = {lane, *_beside(graph, lane)}
        for some, taken in zip(result, near, strict=True):
            if not here & taken:
                some.append(lane)
                taken |= here
                break
        else:
            result.append([lane])
            near.append(here)
    return result


def _or_none(lanes: IntArray) -> list[int]:
    return [int(i) for i in lanes if i >= 0] or [-1]
