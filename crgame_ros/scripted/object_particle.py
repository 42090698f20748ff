# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The particle that goes wherever it likes: a pedestrian (FS II-A3)."""

from collections.abc import Sequence
import math
from typing import NamedTuple

from crgame_ros.game.object_spec import MoverType, ObjectSpec
from crgame_ros.geometry.curve import Curve
from crgame_ros.geometry.outline import half_extents
from crgame_ros.scripted.object_motion import ABSENT, Integrated, ObjectSurroundings
from crgame_ros.vehicle.state import QUEUEING, REST
from crgame_ros.vehicle.stopping import SpeedEnvelope
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


# How far the way may pass a corner, which decides the speed there [m].
CORNER_OFFSET = 0.1
# It walks towards a point of its path this far ahead, and as far as it gets in this time.
_AHEAD, _AHEAD_S = 0.1, 0.15
_SPACING = 0.1
_ARRIVED = 0.02


class ParticleMotion(Integrated):
    """
    A point that is accelerated in any direction, |a| <= a_max, and looks where it goes.

    It walks along the straight lines between its way-points, slower at corners, which it rounds
    by about 0.1 m, and comes to rest at its goal. A reactive one stops in front of what it must
    not walk into (`Crossing`).

    :param spec: of the object.
    """

    def __init__(self, spec: ObjectSpec) -> None:
        super().__init__(spec.start)
        self._spec, self._type = spec, spec.mover
        self._path = Curve.from_polyline(np.array(spec.path))
        self._corners, self._directions = self._path.s, self._path.directions
        self._goal = self._path.length
        self._profile = self._planned_speeds()
        self._crossing = Crossing(self._path, self._type)
        self._s, self._stop = 0.0, math.inf
        speed = self._profile.at(0.0) if spec.start == 0.0 else 0.0
        self._position: tuple[float, float] = (spec.path[0][0], spec.path[0][1])
        dx, dy = self._directions[0].tolist()
        self._velocity = (speed * dx, speed * dy)
        self._yaw = math.atan2(dy, dx)

    def _planned_speeds(self) -> SpeedEnvelope:
        grid = np.union1d(np.linspace(0.0, self._goal, math.ceil(self._goal / _SPACING) + 1),
                          self._corners)
        wanted = np.interp(grid, self._corners, self._spec.speeds) if self._spec.speeds \
            else np.full(len(grid), self._type.speed)
        # A circle that passes a corner at this offset has the radius e / (1 / cos(turn / 2) - 1).
        cosine = np.clip(np.sum(self._directions[1:] * self._directions[:-1], axis=1), -1.0, 1.0)
        half = np.sqrt(0.5 * (1.0 + cosine))
        radius = CORNER_OFFSET / np.maximum(1.0 / np.maximum(half, 1e-3) - 1.0, 1e-9)
        corner = np.sqrt(0.5 * self._type.acceleration * radius)
        rows = np.searchsorted(grid, self._corners[1:-1])
        wanted[rows] = np.minimum(wanted[rows], corner)
        if self._spec.end == 'stay':
            wanted[-1] = 0.0
        return SpeedEnvelope(grid, wanted, self._type.deceleration)

    def decide(self, time_s: float, others: ObjectSurroundings) -> None:
        """Choose how far to walk."""
        if not self._gone:
            self._stop = self._crossing.stop(self._s, math.hypot(*self._velocity), others)

    def _advance(self, step: float) -> None:
        (x, y), (vx, vy) = self._position, self._velocity
        speed = math.hypot(vx, vy)
        allowed = self._profile.at(self._s + speed * step)
        room = self._stop - self._s - speed * step
        allowed = min(allowed, math.sqrt(2.0 * self._type.deceleration * max(room, 0.0)))
        tx, ty = self._point(self._s + _AHEAD + _AHEAD_S * speed)
        away = math.hypot(tx - x, ty - y)
        scale = allowed / away if away > _ARRIVED else 0.0
        ax, ay = ((tx - x) * scale - vx) / step, ((ty - y) * scale - vy) / step
        share = min(1.0, self._type.acceleration / max(math.hypot(ax, ay), 1e-12))
        wx, wy = vx + share * ax * step, vy + share * ay * step
        self._position = (x + 0.5 * (vx + wx) * step, y + 0.5 * (vy + wy) * step)
        self._velocity = (wx, wy)
        if math.hypot(wx, wy) > REST:
            self._yaw = math.atan2(wy, wx)
        self._progress()
        self._gone = self._spec.end == 'vanish' and self._s >= self._goal - _ARRIVED

    def _point(self, s: float) -> tuple[float, float]:
        """Return the point of the path at an arc length; straight on where it vanishes."""
        if self._spec.end == 'stay':
            s = min(s, self._goal)
        segment = min(int(np.searchsorted(self._corners, s, side='right')) - 1,
                      len(self._directions) - 1)
        along = s - float(self._corners[segment])
        x, y = self._path.points[segment].tolist()
        dx, dy = self._directions[segment].tolist()
        return x + along * dx, y + along * dy

    def _progress(self) -> None:
        """Project the position on the present segment and the next, never backwards."""
        present = int(np.searchsorted(self._corners, self._s, side='right')) - 1
        best, nearest = self._s, math.inf
        for segment in range(present, min(present + 2, len(self._directions))):
            start, end = self._corners[segment:segment + 2].tolist()
            dx, dy = self._directions[segment].tolist()
            x, y = self._path.points[segment].tolist()
            px, py = self._position[0] - x, self._position[1] - y
            along = min(max(px * dx + py * dy, 0.0), end - start)
            distance = math.hypot(px - along * dx, py - along * dy)
            if distance < nearest:
                best, nearest = start + along, distance
        self._s = max(self._s, best)

    def state(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return position and velocity; its yaw rate counts as 0, for it turns at once."""
        if self._gone:
            return ABSENT, ABSENT
        return (*self._position, self._yaw), (*self._velocity, 0.0)
