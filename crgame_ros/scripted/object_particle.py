# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The particle model, which moves in any direction: a pedestrian (FS II-A3)."""

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

# Moving bodies smaller than this in both directions are people, which yield to each other [m].
PERSON = 1.0
# Least time between leaving a vehicle's path and the vehicle's arrival [s].
CLEARANCE_S = 0.5
# Vehicles that arrive later are ignored [s].
HORIZON_S = 10.0
# Within this distance of a vehicle's path the decision to cross is final [m]: a pedestrian at
# 1.4 m/s stops in 0.5 m at 2 m/s^2.
DECIDED = 0.7


class _Way(NamedTuple):
    """Part of the path [m] in a vehicle's path, and when its front arrives and its rear leaves."""

    enter: float
    leave: float
    arrival: float
    departure: float


class _Parts(NamedTuple):
    """
    The parts of a path within O rectangles, each (O,); NaN where none is.

    The fields are the first and last arc length within, and the least and greatest x within, in
    the rectangle's frame [m].
    """

    enter: FloatArray
    leave: FloatArray
    nearest: FloatArray
    farthest: FloatArray


class Crossing:
    """
    The rule of a reactive pedestrian.

    Every vehicle is expected to go straight on at its speed. Its path is as wide as the vehicle
    plus the pedestrian, plus the kept distance on both sides. The pedestrian enters this path in
    two cases. Either the vehicle has passed before. Or it arrives at least the accepted gap (3 s,
    the T of the type) after the pedestrian enters, and at least 0.5 s after the pedestrian leaves.
    Otherwise the pedestrian stops at the path's edge. If that edge is in the path of another
    vehicle, it stops at the edge of that path. After the decision to cross, the pedestrian stops
    only in front of a vehicle that would hit it. In front of standing bodies it always stops, and
    waits until they are gone.

    :param walker: radius, speed, acceleration, accepted gap and kept distance.
    """

    def __init__(self, path: Curve, walker: MoverType) -> None:
        self._path, self._walker = path, walker
        self._starts = path.s[:-1]
        # Arc length up to which the pedestrian has decided to walk.
        self._decided = 0.0

    def stop(self, s: float, speed: float, others: ObjectSurroundings) -> float:
        """
        Return the arc length [m] at which the pedestrian must stop, infinite if it may walk on.

        :param s: current arc length [m]
        :param speed: current speed [m/s]
        """
        small = np.maximum(others.lengths, others.widths) < PERSON
        moving = others.speeds >= QUEUEING
        stop = self._standing_stop(s, others.chosen(~moving))
        ways = self._ways(s, others.chosen(moving & ~small))
        closed = [way.enter for way in ways if self._is_closed(way, s, speed)]
        stop = min([stop, *closed])
        for _ in ways:
            # The waiting place must not be in the path of another vehicle.
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
            # Already in front of the vehicle: walking on is safest.
            return False
        enters = self._time_to(way.enter - s, speed)
        leaves = self._time_to(way.leave - s, speed)
        if way.departure < enters:
            return False
        if way.enter < self._decided:
            return way.arrival < leaves
        return way.arrival < max(enters + self._walker.headway, leaves + CLEARANCE_S)

    def _time_to(self, distance: float, speed: float) -> float:
        """Return the time for a distance with acceleration to the pedestrian's own speed [s]."""
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
        # Extents along and across the motion, which may differ from the body's axes.
        long, wide = (half + room for half in half_extents(
            vehicles.lengths, vehicles.widths, vehicles.poses[:, 2] - yaws))
        # A pedestrian that has entered only the kept distance can still stop.
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
        # Within the kept distance of a body: the pedestrian may walk away from it or past it.
        if ((enter <= s) & (touch > s)).any():
            return s
        return float(enter[enter > s].min(initial=math.inf))

    def _parts(self, frames: FloatArray, s: float, along: tuple[FloatArray, FloatArray],
               wide: FloatArray) -> _Parts:
        """
        Return the parts within rectangles of the path from an arc length on.

        :param frames: (O, 3) x [m], y [m], yaw [rad] of the rectangles' own axes.
        :param s: the arc length [m]
        :param along: least and greatest extents on their x axes, (O,) and (O,) [m]
        :param wide: (O,) extents to either side [m]
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


# Distance at which corners are rounded, which determines the speed there [m].
CORNER_OFFSET = 0.1
# It walks towards a point on its path ahead by this distance [m] plus that of this time [s].
_AHEAD, _AHEAD_S = 0.1, 0.15
_SPACING = 0.1
_ARRIVED = 0.02


class ParticleMotion(Integrated):
    """
    A point that can accelerate in any direction, |a| <= a_max, and faces its direction of motion.

    It walks along the straight lines between its way-points, slower at corners, which it rounds
    at about 0.1 m, and comes to rest at its goal. A reactive one stops for vehicles and in front
    of standing bodies (`Crossing`).
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
        # A circle that passes a corner at the offset e has the radius e / (1 / cos(turn / 2) - 1).
        cosine = np.clip(np.sum(self._directions[1:] * self._directions[:-1], axis=1), -1.0, 1.0)
        half = np.sqrt(0.5 * (1.0 + cosine))
        radius = CORNER_OFFSET / np.maximum(1.0 / np.maximum(half, 1e-3) - 1.0, 1e-9)
        corner = np.sqrt(0.5 * self._type.acceleration * radius)
        rows = np.searchsorted(grid, self._corners[1:-1])
        wanted[rows] = np.minimum(wanted[rows], corner)
        if self._spec.end == 'stay':
            wanted[-1] = 0.0
        return SpeedEnvelope(grid, wanted, self._type.deceleration)

    def decide(self, others: ObjectSurroundings) -> None:
        """Determine the arc length at which to stop."""
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
        """Return the point at an arc length; straight on beyond the end unless it stays there."""
        if self._spec.end == 'stay':
            s = min(s, self._goal)
        segment = min(int(np.searchsorted(self._corners, s, side='right')) - 1,
                      len(self._directions) - 1)
        along = s - float(self._corners[segment])
        x, y = self._path.points[segment].tolist()
        dx, dy = self._directions[segment].tolist()
        return x + along * dx, y + along * dy

    def _progress(self) -> None:
        """Project the position on the current and the next segment, and never move backwards."""
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
        """Return position and velocity; the yaw rate is 0, because it turns instantly."""
        if self._gone:
            return ABSENT, ABSENT
        return (*self._position, self._yaw), (*self._velocity, 0.0)
