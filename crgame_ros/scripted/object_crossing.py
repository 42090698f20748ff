# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When a pedestrian crosses the way of vehicles, and where he waits."""

import math
from typing import NamedTuple

from crgame_ros.game.object_spec import MoverType
from crgame_ros.geometry.curve import Curve
from crgame_ros.geometry.outline import half_extents
from crgame_ros.scripted.object_surroundings import ObjectSurroundings
from crgame_ros.vehicle.standstill import QUEUEING
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Moving bodies smaller than this in both directions are people, who make way for each other [m].
PERSON = 1.0
# What is left between the moment he is clear of a vehicle's way and its arrival [s].
CLEARANCE_S = 0.5
# Farther ahead in time no vehicle counts [s].
HORIZON_S = 10.0
# From here to the way of a vehicle he has made his mind up [m]: a walker at 1.4 m/s stops in
# 0.5 m at 2 m/s^2.
DECIDED = 0.7


class _Way(NamedTuple):
    """Part of the path [m] in a vehicle's way, and when its front comes and its rear leaves."""

    enter: float
    leave: float
    arrival: float
    departure: float


class _Parts(NamedTuple):
    """
    What of the path is within each of O rectangles, each (O,); NaN where nothing is.

    First and last arc length within, least and greatest x within in the rectangle's frame [m].
    """

    enter: FloatArray
    leave: FloatArray
    nearest: FloatArray
    farthest: FloatArray


class Crossing:
    """
    The rule of a reactive pedestrian.

    Every vehicle is expected to go straight on at its speed. Its way is as wide as itself and the
    pedestrian, and the kept distance on both sides. He enters it only if the vehicle comes no
    earlier than the accepted gap after that (3 s, the T of his type) and no earlier than 0.5 s
    after he has left it, or has passed before he comes. Otherwise he stops at its edge; if the
    edge lies in the way of another vehicle, at the edge of that one's. Once he has decided to
    go, he stops again only in front of a vehicle that would hit him. In front of standing bodies
    he stops in any case and waits until they are gone.

    :param path: of the pedestrian.
    :param walker: radius, speed, acceleration, accepted gap and kept distance.
    """

    def __init__(self, path: Curve, walker: MoverType) -> None:
        self._path, self._walker = path, walker
        self._starts = path.s[:-1]
        # Arc length up to which he has decided to go on.
        self._decided = 0.0

    def stop(self, s: float, speed: float, others: ObjectSurroundings) -> float:
        """
        Return the arc length [m] at which he must stop, infinite where he may walk on.

        :param s: his present arc length [m]
        :param speed: his present speed [m/s]
        """
        small = np.maximum(others.lengths, others.widths) < PERSON
        moving = others.speeds >= QUEUEING
        stop = self._standing_stop(s, others.chosen(~moving))
        ways = self._ways(s, others.chosen(moving & ~small))
        closed = [way.enter for way in ways if self._is_closed(way, s, speed)]
        stop = min([stop, *closed])
        for _ in ways:
            # Not in the way of another while he waits for this one.
            inside = [way.enter for way in ways
                      if s - self._walker.distance < way.enter < stop < way.leave]
            if not inside:
                break
            stop = min(inside)
        near = [way.leave for way in ways if way.enter <= min(s + DECIDED, stop)]
        if stop <= s + DECIDED:
            self._decided = s
        elif near:
            self._decided = max(self._decided, *near)
        return stop

    def _is_closed(self, way: _Way, s: float, speed: float) -> bool:
        if s >= way.enter + self._walker.distance:
            # Already in front of it: the best is to go on.
            return False
        enters = self._time_to(way.enter - s, speed)
        leaves = self._time_to(way.leave - s, speed)
        if way.departure < enters:
            return False
        if way.enter < self._decided:
            return way.arrival < leaves
        return way.arrival < max(enters + self._walker.headway, leaves + CLEARANCE_S)

    def _time_to(self, distance: float, speed: float) -> float:
        """Return the time for a distance when he speeds up to his own speed [s]."""
        distance = max(distance, 0.0)
        a, v = self._walker.acceleration, max(self._walker.speed, speed)
        run_up = (v**2 - speed**2) / (2.0 * a)
        if distance < run_up:
            return (math.sqrt(speed**2 + 2.0 * a * distance) - speed) / a
        return (v - speed) / a + (distance - run_up) / v

    def _ways(self, s: float, vehicles: ObjectSurroundings) -> list[_Way]:
        speeds = vehicles.speeds
        yaws = np.arctan2(vehicles.velocities[:, 1], vehicles.velocities[:, 0])
        room = 0.5 * self._walker.shape.width
        # Extents along and across the motion, should it not be along the body.
        long, wide = (half + room for half in half_extents(
            vehicles.lengths, vehicles.widths, vehicles.poses[:, 2] - yaws))
        # Who is not yet past the kept distance may still stop.
        parts = self._parts(
            np.column_stack((vehicles.poses[:, :2], yaws)), s - self._walker.distance,
            (-long, long + HORIZON_S * speeds), wide + self._walker.distance)
        within = np.isfinite(parts.enter)
        arrival = np.maximum(parts.nearest - long, 0.0) / speeds
        departure = (parts.farthest + long) / speeds
        return [_Way(*row) for row in np.column_stack(
            (parts.enter, parts.leave, arrival, departure))[within].tolist()]

    def _standing_stop(self, s: float, bodies: ObjectSurroundings) -> float:
        kept = self._walker.distance
        long, wide = (0.5 * extent + 0.5 * self._walker.shape.width
                      for extent in (bodies.lengths, bodies.widths))
        enter = self._parts(bodies.poses, s, (-long - kept, long + kept), wide + kept).enter
        touch = self._parts(bodies.poses, s, (-long, long), wide).enter
        # Nearer than he would come by himself: he may go away from it, or past it.
        if ((enter <= s) & (touch > s)).any():
            return s
        return float(enter[enter > s].min(initial=math.inf))

    def _parts(self, frames: FloatArray, s: float, along: tuple[FloatArray, FloatArray],
               wide: FloatArray) -> _Parts:
        """
        Clip the path from an arc length on to rectangles.

        :param frames: (O, 3) x [m], y [m], yaw [rad] of their own axes.
        :param s: the arc length [m]
        :param along: their extents on their x axes, (O,) and (O,) [m]
        :param wide: (O,) to either side [m]
        """
        delta = self._path.points[None, :-1] - frames[:, None, :2]
        axes = np.stack((np.cos(frames[:, 2]), np.sin(frames[:, 2])), axis=-1)
        across = np.stack((-axes[:, 1], axes[:, 0]), axis=-1)
        start = np.stack([np.einsum('opk,ok->op', delta, axis) for axis in (axes, across)])
        direction = np.stack([axis @ self._path.directions.T for axis in (axes, across)])
        # A direction of 0 on an axis makes the bounds infinite: always or never within.
        direction = np.where(np.abs(direction) < 1e-12, 1e-12, direction)
        bounds = [(np.stack(pair)[:, :, None] - start) / direction
                  for pair in ((along[0], -wide), (along[1], wide))]
        enter = np.maximum(np.minimum(*bounds).max(axis=0), np.maximum(s - self._starts, 0.0))
        leave = np.minimum(np.maximum(*bounds).min(axis=0), self._path.steps)
        within = enter < leave
        ends = np.stack((start[0] + enter * direction[0], start[0] + leave * direction[0]))
        least = [np.where(within, values, np.inf).min(axis=1)
                 for values in (self._starts + enter, ends.min(axis=0))]
        most = [np.where(within, values, -np.inf).max(axis=1)
                for values in (self._starts + leave, ends.max(axis=0))]
        missing = ~within.any(axis=1)
        enter, nearest, leave, farthest = (
            np.where(missing, np.nan, values) for values in (*least, *most))
        return _Parts(enter, leave, nearest, farthest)
