# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The kinematic bicycle model along a path (FS II-A3)."""

from collections.abc import Sequence
import math

from crgame_ros.errors import InputError
from crgame_ros.game.object_spec import MoverType, ObjectSpec
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.outline import half_extents
from crgame_ros.scripted.object_motion import ABSENT, Integrated, ObjectSurroundings
from crgame_ros.scripted.object_path import ObjectPath
from crgame_ros.vehicle.idm_model import free_acceleration, IdmParameters, interaction
from crgame_ros.vehicle.state import STANDING
from crgame_ros.vehicle.stopping import SpeedEnvelope
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# A body is in the way if its lateral distance is below this plus both half widths [m].
SIDE_MARGIN = 0.3
# A reactive object considers others within its comfortable stopping distance plus this [m].
_LOOK = 30.0
_ARRIVED = 0.01
# Additions of traffic's `idm` to the model (traffic.car_following is compiled, and too large to
# load into every node): the guard begins at this share of the hardest deceleration and leaves this
# share of the gap at standstill; a standing object starts once the model's acceleration reaches
# START.
_GUARD_SHARE, _GUARD_GAP, _LEAST_ROOM = 0.8, 0.5, 0.01
_START = 0.2


def follow(model: IdmParameters, speed: float, desired: float, gap: float,
           leader_speed: float) -> float:
    """
    Return the acceleration behind a leader that may brake at its hardest at any moment [m/s^2].

    The result equals that of traffic's `idm`, to the last bit.

    :param desired: speed on a free road, `STANDING` or above [m/s]
    :param gap: bumper to bumper [m]
    """
    # Arrays, with products for squares: powers of Python's floats are rounded differently.
    v, v0, s, v_l = np.array([[speed], [desired], [gap], [leader_speed]])
    wanted = float((free_acceleration(v, v0, model, np.maximum)
                    + interaction(v, s, v_l, model, np.maximum))[0])
    leader_speed = max(leader_speed, 0.0)
    stopping = gap - _GUARD_GAP * model.s0 + leader_speed * leader_speed / (2.0 * model.b_max)
    share = speed * speed / (2.0 * model.b_max * max(stopping, _LEAST_ROOM))
    if share > _GUARD_SHARE:
        wanted = min(wanted, -model.b_max * ((share - _GUARD_SHARE) / (1.0 - _GUARD_SHARE)))
    if speed < STANDING and wanted < _START:
        wanted = min(wanted, -_START)
    return min(max(wanted, -model.b_max), model.a)


class BicycleMotion(Integrated):
    """
    A motion of the rear axle on a path: x' = v cos psi, y' = v sin psi, psi' = v tan(delta) / L.

    The heading is the path's at the rear axle and delta = atan(L kappa), so that there is no slip.
    The centre is ahead of the axle by the type's distance, so that it is on the path where that is
    straight. The speed tends to the wanted one within acceleration a and deceleration b. It is
    limited for bends (sqrt(a_lat / kappa)), by speed limits, and for the end if the object stays
    there. A reactive object follows a leader on its path by the IDM. It ignores others to the
    side, and crossing ones before they are in the way.

    :param spec: specification of the object.
    :param path: path of the rear axle.
    :param start: arc length of the centre at the beginning [m]
    :param wanted: (n,) wanted speed at each arc length of the path [m/s]
    """

    def __init__(self, spec: ObjectSpec, path: ObjectPath, start: float,
                 wanted: FloatArray) -> None:
        super().__init__(spec.start)
        self._spec, self._path, self._type = spec, path, spec.mover
        self._s = start
        # The curvature at the rear axle counts, behind the centre.
        curvature = np.interp(path.s - self._type.rear_to_center, path.s, np.abs(path.curvature))
        bend = np.sqrt(self._type.lateral / np.maximum(curvature, 1e-9))
        limit = np.minimum(np.minimum(wanted, bend), path.speed_limit)
        if spec.end == 'stay':
            limit[-1] = 0.0
        self._profile = SpeedEnvelope(path.s, limit, self._type.deceleration)
        self._model = IdmParameters(
            self._type.headway, self._type.distance, self._type.acceleration,
            self._type.deceleration, self._type.hardest)
        self._speed = self._profile.at(start) if spec.start == 0.0 else 0.0
        # There is no leader until the first decision.
        self._following = math.inf

    def decide(self, time_s: float, others: ObjectSurroundings) -> None:
        """Find the leader on the path, and the acceleration behind it."""
        if self._gone:
            return
        gap, speed = self._leader(others)
        if math.isinf(gap):
            self._following = math.inf
            return
        wanted = max(self._profile.at(self._s), STANDING)
        self._following = follow(self._model, self._speed, wanted, gap, speed)

    def _leader(self, others: ObjectSurroundings) -> tuple[float, float]:
        """Return gap and speed along the path of the nearest one ahead; infinite without one."""
        shape = self._type.shape
        front = self._s + 0.5 * shape.length
        look = self._speed**2 / (2.0 * self._type.deceleration) + _LOOK
        if not len(others.poses):
            return math.inf, 0.0
        seen = self._path.meet(others.poses[:, :2], self._s, front + look)
        long, wide = half_extents(others.lengths, others.widths, others.poses[:, 2] - seen.yaw)
        gaps = seen.s - long - front
        ahead = (seen.s > self._s) & (gaps < look) \
            & (np.abs(seen.d) < wide + 0.5 * shape.width + SIDE_MARGIN)
        if not ahead.any():
            return math.inf, 0.0
        first = int(np.argmin(np.where(ahead, gaps, np.inf)))
        vx, vy, _ = others.velocities[first].tolist()
        yaw = float(seen.yaw[first])
        return max(float(gaps[first]), 0.0), vx * math.cos(yaw) + vy * math.sin(yaw)

    def _advance(self, step: float) -> None:
        allowed = self._profile.at(self._s + self._speed * step)
        acceleration = (allowed - self._speed) / step
        acceleration = min(max(acceleration, -self._type.hardest), self._type.acceleration)
        acceleration = min(acceleration, self._following)
        speed = max(self._speed + acceleration * step, 0.0)
        self._s += 0.5 * (self._speed + speed) * step
        self._speed = speed
        end = self._path.length
        if self._spec.end == 'vanish':
            self._gone = self._s >= end
        elif self._s > end - _ARRIVED:
            self._s, self._speed = min(self._s, end), 0.0

    def state(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return the state of the centre, which is ahead of the rear axle."""
        if self._gone:
            return ABSENT, ABSENT
        ahead = self._type.rear_to_center
        x, y, yaw, curvature = self._path.pose(self._s - ahead)
        cos, sin = math.cos(yaw), math.sin(yaw)
        turning = self._speed * curvature
        return ((x + ahead * cos, y + ahead * sin, wrap_pi(yaw)),
                (self._speed * cos - turning * ahead * sin,
                 self._speed * sin + turning * ahead * cos, turning))


def check_bends(path: ObjectPath, mover: MoverType, name: str, where: str) -> None:
    """
    Refuse a path that a vehicle cannot steer along.

    :param name: type of the vehicle.
    :raises InputError: naming the place and the radius.
    """
    sharpest = int(np.argmax(np.abs(path.curvature)))
    curvature = abs(float(path.curvature[sharpest]))
    if curvature > mover.sharpest:
        x, y = path.points[sharpest].tolist()
        raise InputError(
            f'the path turns with a radius of {1.0 / curvature:.2g} m at ({x:.1f}, {y:.1f})',
            where, f'a {name} needs {1.0 / mover.sharpest:.2g} m: make the bend wider, or round '
                   'it with more way-points')
