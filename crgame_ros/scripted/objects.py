# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The objects that a game adds to its scenario, in one run (FS II-A3)."""

from collections.abc import Sequence
import math
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.object_spec import MoverType, ObjectSpec
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.geometry.angles import wrap_pi, wrap_pi_array
from crgame_ros.geometry.curve import arc_length, nearest
from crgame_ros.geometry.outline import half_extents
from crgame_ros.geometry.reference_point import seen_from
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scripted.object_motion import (
    ABSENT,
    Integrated,
    ObjectMotion,
    ObjectSurroundings,
    Predetermined,
    Standstill,
)
from crgame_ros.scripted.object_particle import ParticleMotion
from crgame_ros.vehicle.idm_model import free_acceleration, IdmParameters, interaction
from crgame_ros.vehicle.state import STANDING
from crgame_ros.vehicle.stopping import SpeedEnvelope
from crgame_ros.waypoints.lanelets import graded, lane_of_chain, lanelet_chain
from crgame_ros.waypoints.waypoints import WaypointLane
import numpy as np
from numpy.typing import NDArray

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
FloatArray = NDArray[np.float64]
# Greatest length of an object's path beyond its first lanelet [m].
MAX_REACH = 5000.0
# Ratio of neighbouring way-point distances above which way-points are added.
PATH_RATIO = 1.5
# Spacing of samples; between them the arc length is linear in the station [m].
_SPACING = 0.25
# Gauss-Legendre points of the integral of |X'| between two samples.
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(3)


class Encounters(NamedTuple):
    """
    Bodies relative to a path, each (O,).

    :param s: arc length of the nearest sample of the path, corrected along it to the centre [m]
    :param d: lateral offset to the left [m]
    :param yaw: heading of the path there [rad]
    """

    s: FloatArray
    d: FloatArray
    yaw: FloatArray


class ObjectPath:
    """
    A way-point lane parametrised by its arc length, straight beyond both ends.

    :param lane: the lane; its stations differ from arc lengths.
    """

    def __init__(self, lane: WaypointLane) -> None:
        self._lane = lane
        count = max(2, math.ceil(lane.length / _SPACING) + 1)
        # The samples include the way-points, between which the curve is smooth.
        self._u: FloatArray = np.union1d(np.linspace(0.0, lane.length, count), lane.s)
        step = np.diff(self._u)
        nodes = self._u[:-1, None] + 0.5 * step[:, None] * (_GAUSS + 1.0)
        arcs = 0.5 * step * (self._speeds(nodes) @ _WEIGHTS)
        self.s: FloatArray = np.concatenate(([0.0], np.cumsum(arcs)))
        here = lane.at(self._u)
        self.curvature: FloatArray = here.curvature
        self.speed_limit: FloatArray = here.speed_limit
        self._poses: FloatArray = np.column_stack(here[:3])
        self.points: FloatArray = self._poses[:, :2]

    def _speeds(self, u: FloatArray) -> FloatArray:
        """Return |X'| at stations of any shape."""
        first = self._lane.tangents(u.reshape(-1))
        return np.hypot(first[:, 0], first[:, 1]).reshape(u.shape)

    @property
    def length(self) -> float:
        """Return the total arc length [m]."""
        return float(self.s[-1])

    def arc_lengths(self, stations: FloatArray) -> FloatArray:
        """Return the arc lengths [m] of stations of the lane [m]."""
        return np.interp(stations, self._u, self.s)

    def pose(self, s: float) -> tuple[float, float, float, float]:
        """Return x [m], y [m], yaw [rad] and curvature [1/m] at an arc length [m]."""
        here = self._lane.at(np.interp([s], self.s, self._u))
        x, y, yaw, curvature = (float(column[0]) for column in here[:4])
        beyond = s - min(max(s, 0.0), self.length)
        if beyond:
            x, y, curvature = x + beyond * math.cos(yaw), y + beyond * math.sin(yaw), 0.0
        return x, y, yaw, curvature

    def meet(self, points: FloatArray, low: float, high: float) -> Encounters:
        """
        Return bodies relative to a part of the path: a path may come back to the same place.

        :param points: (O, 2) centres [m]
        :param low: arc length at which the part begins [m]
        :param high: arc length at which it ends [m]
        """
        first, last = np.searchsorted(self.s, (low, high)).tolist()
        first, last = max(first - 1, 0), min(last + 1, len(self.s))
        row = first + nearest(points, self.points[first:last])
        along, d = seen_from(self._poses[row], points)
        return Encounters(self.s[row] + along, d,
                          wrap_pi_array(self._poses[row, 2] + self.curvature[row] * along))


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

    def decide(self, others: ObjectSurroundings) -> None:
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


class ScriptedObjects:
    """
    The scripted objects of a game, moved by scenario time steps.

    All objects react to the world of step k, then all move to k + 1. Therefore their order does
    not matter, and the same inputs give the same bits.

    :param network: network of the lanelets that objects may follow; None if there is none.
    :param time_step_s: Delta t_c [s]
    :param k0: scenario time step at which the run starts.
    :param where: file and key for messages.
    :ivar descriptions: one for each object, in order.
    :ivar states: of the objects at the current time step `k`, in read-only arrays.
    :raises InputError: if an object's lanelet or path cannot be used.
    """

    def __init__(self, specs: Sequence[ObjectSpec], network: RoadNetwork | None,
                 time_step_s: float, k0: int = 0, where: str = 'objects') -> None:
        self.descriptions: tuple[ObjectDescription, ...] = tuple(
            ObjectDescription(spec.id, spec.type,
                              Role.STATIC if spec.kind == 'static' else Role.SCRIPTED, spec.shape)
            for spec in specs)
        self._time_step_s, self._k0, self.k = time_step_s, k0, k0
        self._motions = [_motion(spec, network, time_step_s, f'{where}: {spec.id}')
                         for spec in specs]
        self._reactive = [index for index, spec in enumerate(specs) if spec.reactive]
        self._particles = np.array([spec.kind == 'particle' for spec in specs], dtype=bool)
        self._lengths = np.array([item.shape.length for item in self.descriptions])
        self._widths = np.array([item.shape.width for item in self.descriptions])
        self.states = self._gathered()

    def advance(self, k: int, others_poses: FloatArray, others_velocities: FloatArray,
                lengths: FloatArray, widths: FloatArray) -> None:
        """
        Move from time step k to k + 1.

        :param k: the current time step.
        :param others_poses: (O, 3) centres of all others at k; NaN where absent.
        :param others_velocities: (O, 3)
        :param lengths: (O,) lengths of the others [m]
        :param widths: (O,) [m]
        :raises ValueError: if k is not the current time step.
        """
        if k != self.k:
            raise ValueError(f'the objects are at time step {self.k}, not at {k}')
        time_s = (k - self._k0) * self._time_step_s
        if self._reactive:
            everything = ObjectSurroundings(
                np.concatenate((others_poses, self.states.poses)),
                np.concatenate((others_velocities, self.states.velocities)),
                np.concatenate((lengths, self._lengths)), np.concatenate((widths, self._widths)))
            present: NDArray[np.bool_] = np.isfinite(everything.poses[:, 0])
            for index in self._reactive:
                seen = present.copy()
                own = seen[len(others_poses):]
                own[index] = False
                if self._particles[index]:
                    # People yield to each other and are no obstacles.
                    own &= ~self._particles
                self._motions[index].decide(everything.chosen(seen))
        for motion in self._motions:
            motion.move(time_s, self._time_step_s)
        self.k = k + 1
        self.states = self._gathered()

    def _gathered(self) -> ObjectStates:
        both = np.array([motion.state() for motion in self._motions]).reshape(-1, 2, 3)
        both.flags.writeable = False
        return ObjectStates(both[:, 0], both[:, 1])


def _motion(spec: ObjectSpec, network: RoadNetwork | None, time_step_s: float,
            where: str) -> ObjectMotion:
    if spec.at is not None:
        return Standstill(spec.at)
    if spec.trajectory:
        return Predetermined(spec.timed_trajectory, spec.start, spec.end == 'stay', time_step_s)
    if spec.kind == 'particle':
        return ParticleMotion(spec)
    if spec.lanelet is not None:
        return _lane_motion(spec, spec.lanelet, network, where)
    return _path_motion(spec, where)


def _path_motion(spec: ObjectSpec, where: str) -> ObjectMotion:
    given = np.array(spec.path)
    corners = arc_length(given)
    stations = graded(corners, PATH_RATIO)
    x, y = (np.interp(stations, corners, column) for column in given.T)
    lane = WaypointLane(x, y, np.zeros(len(x)), np.full(len(x), np.inf))
    path = ObjectPath(lane)
    check_bends(path, spec.mover, spec.type, where)
    # Added way-points are on straight segments, so that stations of the given ones do not change.
    wanted = np.interp(path.s, path.arc_lengths(corners), spec.speeds) if spec.speeds \
        else np.full(len(path.s), spec.mover.speed)
    return BicycleMotion(spec, path, 0.0, wanted)


def _lane_motion(spec: ObjectSpec, lanelet: int, network: RoadNetwork | None,
                 where: str) -> ObjectMotion:
    if network is None or lanelet not in network.lanelet_ids:
        raise InputError(f'there is no lanelet {lanelet}', where,
                         'name a lanelet of the scenario')
    length = network.line(lanelet).length
    if spec.s > length:
        raise InputError(f'"s" is {spec.s:g}, but lanelet {lanelet} is {length:.1f} m long', where,
                         'give a smaller one')
    path = ObjectPath(lane_of_chain(network, lanelet_chain(network, lanelet, MAX_REACH)))
    return BicycleMotion(spec, path, spec.s, np.full(len(path.s), spec.mover.speed))
