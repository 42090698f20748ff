# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The objects that a game adds to its scenario, in one run (FS II-A3)."""

from collections.abc import Sequence

from crgame_ros.errors import InputError
from crgame_ros.game.object_spec import ObjectSpec
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.geometry.curve import arc_length
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scripted.object_bicycle import BicycleMotion, check_bends
from crgame_ros.scripted.object_motion import (
    ObjectMotion,
    ObjectSurroundings,
    Predetermined,
    Standstill,
)
from crgame_ros.scripted.object_particle import ParticleMotion
from crgame_ros.scripted.object_path import ObjectPath
from crgame_ros.waypoints.lanelets import graded, lane_of_chain, lanelet_chain
from crgame_ros.waypoints.waypoints import WaypointLane
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Greatest length of an object's path beyond its first lanelet [m].
MAX_REACH = 5000.0
# Ratio of neighbouring way-point distances above which way-points are added.
PATH_RATIO = 1.5


class ScriptedObjects:
    """
    The scripted objects of a game, moved by scenario time steps.

    All objects react to the world of step k, then all move to k + 1. Therefore their order does
    not matter, and the same inputs give the same bits.

    :param specs: specifications of the objects.
    :param network: network of the lanelets that objects may follow; None if there is none.
    :param time_step_s: Delta t_c [s]
    :param k0: scenario time step at which the run starts.
    :param where: file and key for messages.
    :ivar descriptions: one for each object, in order.
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
        self._states = self._gathered()

    @property
    def states(self) -> ObjectStates:
        """Return the objects' states at the current time step `k`; read-only."""
        return self._states

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
                np.concatenate((others_poses, self._states.poses)),
                np.concatenate((others_velocities, self._states.velocities)),
                np.concatenate((lengths, self._lengths)), np.concatenate((widths, self._widths)))
            present: NDArray[np.bool_] = np.isfinite(everything.poses[:, 0])
            for index in self._reactive:
                seen = present.copy()
                own = seen[len(others_poses):]
                own[index] = False
                if self._particles[index]:
                    # People yield to each other and are no obstacles.
                    own &= ~self._particles
                self._motions[index].decide(time_s, everything.chosen(seen))
        for motion in self._motions:
            motion.move(time_s, self._time_step_s)
        self.k = k + 1
        self._states = self._gathered()

    def _gathered(self) -> ObjectStates:
        both = np.array([motion.state() for motion in self._motions]).reshape(-1, 2, 3)
        both.flags.writeable = False
        return ObjectStates(both[:, 0], both[:, 1])


def _motion(spec: ObjectSpec, network: RoadNetwork | None, time_step_s: float,
            where: str) -> ObjectMotion:
    if spec.at is not None:
        return Standstill(spec.at)
    if spec.trajectory:
        return Predetermined(spec.trajectory, spec.start, spec.end == 'stay', time_step_s)
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
