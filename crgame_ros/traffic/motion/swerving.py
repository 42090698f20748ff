# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One reference per lane around obstacles that stand in it, shared by all agents (FS M1)."""

from crgame_ros.traffic.fleet.routes import Routes
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.placement import Entries
from crgame_ros.traffic.lanes.pursuit import pursuit_distance
from crgame_ros.traffic.motion.elastic_band import ElasticBand
from crgame_ros.traffic.motion.passage import Obstacles
import numpy as np
from scipy.linalg.lapack import dtbtrs

# A swerve begins and ends within this distance of its obstacle [m].
REACH = 80.0
# Greatest legal width of a truck in most countries [m].
WIDEST = 2.55
# No curve demands a lower speed than this [m/s].
SLOWEST = 2.0
# Cutting a swerve may take this much of the clearance [m].
CUT = 0.1
# Points in front of the rear axle that are checked: fronts of cars and trucks swing out [m].
FRONTS = (0.0, 3.5, 6.0)
# Speeds for which cutting is checked [m/s]; below, agents steer for the same distance ahead.
SPEEDS = (4.0, 5.0, 6.0, 7.0, 8.5, 10.0, 12.0, 14.0, 17.0, 20.0, 25.0)


class Swerving:
    """
    The references of all lanes: offsets from their centre lines.

    There is one band for all widths. It is planned for the widest vehicles wherever these have
    room, which leaves cars more clearance than they need, and for cars elsewhere.

    :param graph: the lanes.
    :param routes: with the straightest continuations of lanes.
    :param lateral_acceleration: comfortable in curves [m/s^2]
    :param widest: width of the widest vehicle [m]
    :param keeps_left: whether traffic does.

    Attributes at each row of the lanes' tables: `reference`, offset [m]; `curvature`, of the band,
    to be added to the lane's [1/m]; `speed`, at which agents follow it, infinite where they drive
    on the centre line [m/s]. `version` counts the plans.
    """

    def __init__(self, graph: LaneGraph, routes: Routes, lateral_acceleration: float = 2.0,
                 widest: float = WIDEST, keeps_left: bool = False) -> None:
        self._graph = graph
        self._routes = routes
        self._band = ElasticBand(wide_half_width=0.5 * widest, keeps_left=keeps_left)
        self._lateral_acceleration = lateral_acceleration
        self.reference: FloatArray = np.zeros(len(graph.x))
        self.curvature: FloatArray = np.zeros(len(graph.x))
        self.speed: FloatArray = np.full(len(graph.x), np.inf)
        self.version = 0
        self._seen: bytes = b''

    def update(self, standing: Entries) -> None:
        """
        Plan the references around standing obstacles, if these have changed.

        :param standing: the obstacles in lanes.
        """
        seen = np.concatenate((standing.lane, standing.rear, standing.front, standing.low,
                               standing.high)).round(2).tobytes()
        if seen == self._seen:
            return
        self._seen = seen
        self.version += 1
        self.reference[:] = 0.0
        self.curvature[:] = 0.0
        self.speed[:] = np.inf
        self._band.begin_plan()
        planned: set[int] = set()
        for lane in np.unique(standing.lane).tolist():
            if lane not in planned:
                planned |= self._plan(lane, standing, planned)

    def _plan(self, lane: int, standing: Entries, planned: set[int]) -> set[int]:
        """Plan one reference along a lane and the lanes before and behind it; return them all."""
        graph, chain = self._graph, self._chain(lane)
        starts = np.concatenate(([0.0], np.cumsum(graph.length[chain])))
        step = self._band.step
        grid = np.arange(0.0, starts[-1], step)
        at = np.clip(np.searchsorted(starts, grid, side='right') - 1, 0, len(chain) - 1)
        of = np.array(chain)[at]
        half = graph.half_width[graph.rows(of, grid - starts[at])]
        obstacles = _along(chain, starts, standing)
        d, curvature, _ = self._band.relax(half, half, float(graph.limit[lane]), obstacles)
        cut = self._lateral_acceleration / cutting_speed(d, step, obstacles)**2
        for i, begin in zip(chain, starts, strict=False):
            if i not in planned:
                rows = graph.rows_of(i)
                own = np.arange(int(graph.count[i])) * graph.step[i] + begin
                self.reference[rows] = np.interp(own, grid, d)
                self.curvature[rows] = np.interp(own, grid, curvature)
                bend = np.where(np.abs(self.reference[rows]) < 1e-3, 0.0, np.abs(
                    self.curvature[rows] + graph.curvature[rows]))
                bend = np.maximum(bend, np.interp(own, grid, cut))
                with np.errstate(divide='ignore'):
                    self.speed[rows] = np.maximum(
                        np.sqrt(self._lateral_acceleration / bend), SLOWEST)
        return set(chain)

    def _chain(self, lane: int) -> list[int]:
        """Return a lane with those before and behind it, each as far as a swerve reaches."""
        graph, chain = self._graph, [lane]
        length = 0.0
        while length < REACH:
            following = int(self._routes.onward[chain[-1]])
            if following < 0 or following in chain:
                break
            chain.append(following)
            length += float(graph.length[following])
        length = 0.0
        while length < REACH:
            before = [int(i) for i in graph.predecessors[chain[0]]
                      if i >= 0 and self._routes.onward[i] == chain[0]]
            if not before or before[0] in chain:
                break
            chain.insert(0, before[0])
            length += float(graph.length[before[0]])
        return chain


def _along(chain: list[int], starts: FloatArray, standing: Entries) -> Obstacles:
    """Return the obstacles in a chain of lanes, by the distance from its beginning."""
    parts = [np.flatnonzero(standing.lane == i) for i in chain]
    number: IntArray = np.repeat(np.arange(len(chain)), [len(p) for p in parts])
    row = np.concatenate(parts)
    return Obstacles(
        0.5 * (standing.rear[row] + standing.front[row]) + starts[number],
        0.5 * (standing.low[row] + standing.high[row]),
        0.5 * (standing.front[row] - standing.rear[row]),
        0.5 * (standing.high[row] - standing.low[row]))


def cutting_speed(d: FloatArray, step: float, obstacles: Obstacles) -> FloatArray:
    """
    Return the speeds at which agents that steer by pure pursuit keep a band's clearance.

    The faster they drive, the farther ahead is the point for which they steer, so that they cut
    swerves shorter than that. For small angles a rear axle that steers for the point at the
    distance l moves as `pursued` has it, and a point f in front of it is at y + f y'.

    :param d: (S,) offsets at s = 0, step, ... [m]
    :return: (S,) infinite away from obstacles [m/s]
    """
    result = np.full(len(d), np.inf)
    if not len(obstacles.s) or not np.abs(d).max() > CUT:
        return result
    s = step * np.arange(len(d))
    beside = np.abs(s[:, None] - obstacles.s) <= obstacles.half_length + step
    side = np.sign(np.interp(obstacles.s, s, d) - obstacles.d)
    allowed = np.full(len(obstacles.s), SPEEDS[0])
    fine = np.ones(len(obstacles.s), dtype=bool)
    for speed in SPEEDS:
        distance = pursuit_distance(speed, 0.0)
        driven = pursued(np.interp(s + distance, s, d), distance, step)
        slope = np.gradient(driven, step)
        lost = np.max([d - np.interp(s - front, s, driven + front * slope)
                       for front in FRONTS], axis=0)[:, None]
        gained = np.min([d - np.interp(s - front, s, driven + front * slope)
                         for front in FRONTS], axis=0)[:, None]
        worst = np.where(beside, np.where(side > 0.0, lost, -gained), -np.inf).max(axis=0)
        fine &= worst < CUT
        allowed[fine] = speed
    allowed[fine] = np.inf
    for at, length, speed in zip(obstacles.s, obstacles.half_length, allowed, strict=True):
        near = (s > at - length - max(FRONTS) - 2.0 * min(speed, SPEEDS[-1])) & (
            s < at + length + max(FRONTS))
        result[near] = np.minimum(result[near], speed)
    return result


def pursued(aim: FloatArray, distance: float, step: float) -> FloatArray:
    """
    Return the offsets (S,) of a rear axle that steers for points at a distance in front of it.

    They follow l^2 y'' / 2 + l y' + y = d(s + l) from rest, by the bilinear transform.

    :param aim: (S,) offsets d(s + l) of the points, at s = 0, step, ... [m]
    :param distance: l [m]
    """
    rate = 2.0 * distance / step
    bands = np.empty((3, len(aim)))
    bands[:] = np.array((rate**2 + 2.0 * rate + 2.0, 4.0 - 2.0 * rate**2,
                         rate**2 - 2.0 * rate + 2.0))[:, None]
    right = 2.0 * aim
    right[1:] += 4.0 * aim[:-1]
    right[2:] += 2.0 * aim[:-2]
    return np.asarray(dtbtrs(bands, right[:, None], uplo='L')[0][:, 0])
