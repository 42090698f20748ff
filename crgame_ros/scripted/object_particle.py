# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The particle that goes wherever it likes: a pedestrian (FS II-A3)."""

from collections.abc import Sequence
import math

from crgame_ros.game.object_spec import ObjectSpec
from crgame_ros.geometry.curve import Curve
from crgame_ros.scripted.object_crossing import Crossing
from crgame_ros.scripted.object_motion import ABSENT, Integrated
from crgame_ros.scripted.object_surroundings import ObjectSurroundings
from crgame_ros.vehicle.speed_envelope import SpeedEnvelope
from crgame_ros.vehicle.standstill import REST
import numpy as np

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
