# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Trajectories as flat joint arrays, the core's image of JointTrajectory, and states in them.

Both runners pass requests and plans through these functions, so that a planner gets the same bits
in process and over DDS. A driven vehicle is the joints x, y, yaw and steering of its rear axle,
any other object x, y and yaw of its centre; absence is NaN (`msg_defs/interfaces.yaml`).

Messages of a live run and of a recording have the same attributes.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
import math
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectDescription, ObjectStates
from crgame_ros.geometry.reference_point import joined
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.plan import Plan
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray

VEHICLE_JOINTS = ('x', 'y', 'yaw', 'steering')
OBJECT_JOINTS = ('x', 'y', 'yaw')
MAP = 'map'
NS_PER_S = 1_000_000_000

FloatArray = NDArray[np.float64]
VEHICLES_TOPIC = '/vehicles/state'
TICK_STATES_TOPIC = '/vehicles/tick_state'
OBJECT_STATES_TOPIC = '/traffic/objects'


@dataclass(frozen=True)
class JointSeries:
    """
    A stamped series of P points over J joints.

    :param stamp_ns: simulation time of the first point [ns]
    :param names: (J) `<id>/x` …
    :param times_ns: (P) time from the stamp [ns]
    :param positions: (P, J) [m] and [rad]
    :param velocities: (P, J) derivatives of the positions [m/s] and [rad/s]
    :param accelerations: (P, J) second derivatives [m/s^2] and [rad/s^2]
    """

    stamp_ns: int
    names: tuple[str, ...]
    times_ns: NDArray[np.int64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    accelerations: NDArray[np.float64]


def without_absent(series: JointSeries, vehicles: int) -> JointSeries:
    """
    Return the series without objects that are absent at all points, usually most of them.

    :param series: of driven vehicles, which are all kept, followed by objects.
    :param vehicles: number of driven vehicles.
    """
    width = len(VEHICLE_JOINTS) * vehicles
    joints = len(OBJECT_JOINTS)
    here = np.isfinite(series.positions[:, width::joints]).any(axis=0)
    if here.all():
        return series
    columns = np.concatenate((np.arange(width), width + np.flatnonzero(np.repeat(here, joints))))
    return JointSeries(series.stamp_ns, tuple(series.names[i] for i in columns.tolist()),
                       series.times_ns, *(values.take(columns, axis=1) for values in (
                           series.positions, series.velocities, series.accelerations)))


def vehicle_joint_names(vehicle_id: str) -> tuple[str, ...]:
    """Return the names of a driven vehicle's joints."""
    return tuple(f'{vehicle_id}/{joint}' for joint in VEHICLE_JOINTS)


def object_joint_names(object_id: str) -> tuple[str, ...]:
    """Return the names of the joints of an object that is no driven vehicle."""
    return tuple(f'{object_id}/{joint}' for joint in OBJECT_JOINTS)


def vehicle_to_joints(
    state: VehicleState,
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """
    Return a vehicle's joint positions, velocities and accelerations (4 each).

    The angular accelerations are not part of the model and stay NaN.
    """
    cos, sin = math.cos(state.yaw), math.sin(state.yaw)
    return (
        (state.x, state.y, state.yaw, state.steering_angle),
        (state.speed * cos, state.speed * sin, state.yaw_rate, state.steering_rate),
        (state.acceleration * cos - state.speed * state.yaw_rate * sin,
         state.acceleration * sin + state.speed * state.yaw_rate * cos, math.nan, math.nan))


def vehicles_from_joints(
    positions: NDArray[np.float64], velocities: NDArray[np.float64],
    accelerations: NDArray[np.float64],
) -> NDArray[np.float64]:
    """
    Return vehicle states from joints; the inverse of `vehicle_to_joints` up to rounding.

    :param positions: (..., 4) x, y, yaw, steering
    :param velocities: (..., 4)
    :param accelerations: (..., 4); only x and y are used
    :return: (..., 8) states, columns as in `StateColumn`
    """
    states = np.empty((*positions.shape[:-1], STATE_WIDTH))
    cos, sin = np.cos(positions[..., 2]), np.sin(positions[..., 2])
    states[..., StateColumn.X:StateColumn.YAW + 1] = positions[..., :3]
    states[..., StateColumn.SPEED] = velocities[..., 0] * cos + velocities[..., 1] * sin
    states[..., StateColumn.STEERING_ANGLE] = positions[..., 3]
    states[..., StateColumn.ACCELERATION] = (
        accelerations[..., 0] * cos + accelerations[..., 1] * sin)
    states[..., StateColumn.YAW_RATE] = velocities[..., 2]
    states[..., StateColumn.STEERING_RATE] = velocities[..., 3]
    return states


def plan_to_joints(plan: Plan, vehicle_id: str, time_step_ns: int) -> JointSeries:
    """
    Return a plan as joints.

    :param time_step_ns: Delta t_c [ns]
    """
    states = plan.states
    cos, sin = np.cos(states[:, StateColumn.YAW]), np.sin(states[:, StateColumn.YAW])
    speed, yaw_rate = states[:, StateColumn.SPEED], states[:, StateColumn.YAW_RATE]
    acceleration = states[:, StateColumn.ACCELERATION]
    positions = states[:, (StateColumn.X, StateColumn.Y, StateColumn.YAW,
                           StateColumn.STEERING_ANGLE)]
    velocities = joined(speed * cos, speed * sin, yaw_rate, states[:, StateColumn.STEERING_RATE])
    nowhere = np.array(np.nan)
    accelerations = joined(acceleration * cos - speed * yaw_rate * sin,
                           acceleration * sin + speed * yaw_rate * cos, nowhere, nowhere)
    times_ns = np.arange(len(states), dtype=np.int64) * time_step_ns
    return JointSeries(plan.stamp_ns, vehicle_joint_names(vehicle_id), times_ns,
                       positions, velocities, accelerations)


def plan_from_joints(series: JointSeries, vehicle_id: str, time_step_ns: int) -> Plan:
    """
    Read a plan from joints of any sender; accelerations may be left out (NaN).

    :param vehicle_id: the AV that the plan must be for.
    :param time_step_ns: Delta t_c [ns], the grid that the points must be on.
    :raises InputError: naming what is wrong: joints, empty, lengths, grid.
    """
    where = f'/{vehicle_id}/plan'
    if series.names != vehicle_joint_names(vehicle_id):
        raise InputError('joint_names are ' + ', '.join(series.names)[:200], where,
                         'name ' + ', '.join(vehicle_joint_names(vehicle_id)))
    if not len(series.times_ns):
        raise InputError('has no points', where)
    grid = np.arange(len(series.times_ns), dtype=np.int64) * time_step_ns
    if np.abs(series.times_ns - grid).max() > time_step_ns // 100:
        raise InputError('time_from_start is off the grid', where,
                         f'space the points {time_step_ns / 1e9:g} s apart, the first at 0')
    states = vehicles_from_joints(series.positions, series.velocities, series.accelerations)
    column = states[:, StateColumn.ACCELERATION]
    if np.isnan(series.accelerations).all() and len(states) > 1:
        # Missing accelerations follow from the speeds.
        column[:] = np.gradient(states[:, StateColumn.SPEED], time_step_ns * 1e-9)
    return Plan(series.stamp_ns, states)


def from_joint_trajectory(message: Any, where: str) -> JointSeries:
    """
    Read a message from any sender as a joint series; accelerations may be left out (NaN).

    :param where: topic name for messages.
    :raises InputError: if a point lacks a joint, or a frame other than map is named.
    """
    if message.header.frame_id not in (MAP, ''):
        raise InputError(f'frame "{message.header.frame_id}" is not {MAP}', where)
    points = message.points
    joints = len(message.joint_names)
    times_ns = np.array([point.time_from_start.sec * NS_PER_S + point.time_from_start.nanosec
                         for point in points], dtype=np.int64)
    return JointSeries(
        stamp_of(message), tuple(message.joint_names), times_ns,
        _rows([point.positions for point in points], joints, 'positions', where),
        _rows([point.velocities for point in points], joints, 'velocities', where),
        _rows([point.accelerations for point in points], joints, 'accelerations', where))


def _rows(rows: Sequence[Sequence[float]], joints: int, name: str,
          where: str) -> NDArray[np.float64]:
    values = np.full((len(rows), joints), np.nan)
    for index, row in enumerate(rows):
        if len(row) == joints:
            values[index] = row
        elif len(row) or name != 'accelerations':
            raise InputError(f'point {index} has {len(row)} {name} for {joints} joints', where,
                             'give one for each joint')
    return values


class JointReader:
    """
    A reader of single-point messages that name the same joints in any order.

    The messages are those of `trajectory_msgs/JointTrajectory`, live or out of a recording.

    :param wanted: names of the joints, in the order of the result.
    :param where: topic, for messages.
    """

    def __init__(self, wanted: Sequence[str], where: str) -> None:
        self._wanted = list(wanted)
        self._where = where
        self._orders: dict[tuple[str, ...], list[int]] = {}

    def read(self, message: Any) -> FloatArray:
        """
        Return (3, joints) positions, velocities and accelerations.

        :raises InputError: if a joint is missing, or one of another object is present.
        """
        names = message.joint_names
        rows = [] if not message.points else [
            message.points[0].positions, message.points[0].velocities,
            message.points[0].accelerations]
        if [len(row) for row in rows] != [len(names)] * 3:
            raise InputError('a point does not give every joint', self._where,
                             'give one position, velocity and acceleration for each')
        point = np.array([np.asarray(row, dtype=np.float64) for row in rows])
        return point if names == self._wanted else point[:, self.order(names)]

    def order(self, names: Sequence[str]) -> list[int]:
        """
        Return the indices of the joints in a message.

        :raises InputError: as `read`.
        """
        key = tuple(names)
        if key not in self._orders:
            place = {name: index for index, name in enumerate(key)}
            for name in self._wanted:
                if name not in place:
                    raise InputError(f'does not name the joint {name}', self._where,
                                     'name the joints as msg_defs/interfaces.yaml has them')
            if len(place) > len(self._wanted):
                other = next(name for name in key if name not in self._wanted)
                raise InputError(f'names the joint {other[:60]} of a vehicle that is not in '
                                 'the game', self._where)
            # Runs always send the same names; other senders may send any, so only one order is
            # kept.
            self._orders = {key: [place[name] for name in self._wanted]}
        return self._orders[key]


def joints_of(topic: str, ids: Iterable[str]) -> list[str]:
    """Return the joint names of vehicles or objects, by the topic that holds them."""
    names = object_joint_names if topic == OBJECT_STATES_TOPIC else vehicle_joint_names
    return [name for item in ids for name in names(item)]


class WorldMessages:
    """
    A reader of the states of one run's vehicles and objects.

    :ivar vehicles: ids of the V driven vehicles, in order.
    :ivar objects: ids of the M others, in order.
    """

    def __init__(self, descriptions: Iterable[ObjectDescription]) -> None:
        known = tuple(descriptions)
        self.vehicles = tuple(item.id for item in known if item.role.is_ego)
        self.objects = tuple(item.id for item in known if not item.role.is_ego)
        self._vehicles = JointReader(joints_of(VEHICLES_TOPIC, self.vehicles), VEHICLES_TOPIC)
        self._objects = JointReader(joints_of(OBJECT_STATES_TOPIC, self.objects),
                                    OBJECT_STATES_TOPIC)

    def vehicle_joints(self, message: object) -> FloatArray:
        """
        Return (3, V, 4) positions, velocities and accelerations of the vehicles' joints.

        :raises InputError: if the message is another run's.
        """
        return self._vehicles.read(message).reshape(3, -1, len(VEHICLE_JOINTS))

    def vehicle_states(self, message: object) -> FloatArray:
        """
        Return (V, 8) states, columns as in `StateColumn`.

        :raises InputError: if the message is another run's.
        """
        return vehicles_from_joints(*self.vehicle_joints(message))

    def object_states(self, message: object) -> ObjectStates:
        """
        Return the objects' states.

        :raises InputError: if the message is another run's.
        """
        point = self._objects.read(message).reshape(3, -1, len(OBJECT_JOINTS))
        return ObjectStates(point[0], point[1])
