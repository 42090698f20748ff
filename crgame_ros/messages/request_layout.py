# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The assignment of a plan request's joints to vehicles and objects."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
import math
import struct

from crgame_ros.errors import InputError
from crgame_ros.messages.cdr import Reader
from crgame_ros.messages.joints import (
    JointSeries,
    object_joint_names,
    OBJECT_JOINTS,
    vehicle_joint_names,
    VEHICLE_JOINTS,
)
from crgame_ros.vehicle.lights import ALL_LIGHTS, Light
import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.intp]
_JOINT = '/lights'
JOINTS = len(VEHICLE_JOINTS)


@dataclass(frozen=True)
class RequestLayout:
    """
    The columns of the others in an AV's request; its own are the first four.

    :param ids: (T) of the others
    :param columns: (T, 3) their joints x, y and yaw
    :param where: the topic, for messages
    """

    ids: tuple[str, ...]
    columns: Index
    where: str

    @classmethod
    def from_names(cls, names: Sequence[str], av: str, where: str = '') -> 'RequestLayout':
        """
        Read joint names.

        :param av: the AV whose request it must be.
        :param where: the topic, for messages.
        :raises InputError: if it is another vehicle's, or one of the others lacks a joint.
        """
        where = where or f'/{av}/plan_request'
        own = vehicle_joint_names(av)
        if tuple(names[:len(own)]) != own:
            raise InputError('does not begin with ' + ', '.join(own), where)
        place = {name: index for index, name in enumerate(names)}
        ids = tuple(dict.fromkeys(name.rpartition('/')[0] for name in names[len(own):]))
        columns = []
        for object_id in ids:
            joints = object_joint_names(object_id)
            if not place.keys() >= {*joints}:
                raise InputError(f'object "{object_id[:40]}" lacks a joint', where,
                                 'name ' + ', '.join(joints)[:120])
            columns.append([place[joint] for joint in joints])
        return cls(ids, np.array(columns, dtype=np.intp).reshape(-1, len(OBJECT_JOINTS)), where)

    def indices(self, index: Mapping[str, int]) -> Index:
        """
        Return the index of each of the others (T).

        :raises InputError: if one of them has none.
        """
        for object_id in self.ids:
            if object_id not in index:
                raise InputError(f'object "{object_id[:40]}" is not described', self.where,
                                 'publish it on /scenario/objects first')
        return np.array([index[object_id] for object_id in self.ids], dtype=np.intp)

    def among(self, known: Container[str]) -> 'RequestLayout':
        """Return the layout of the known ones only."""
        kept = [number for number, object_id in enumerate(self.ids) if object_id in known]
        return RequestLayout(tuple(self.ids[number] for number in kept), self.columns[kept],
                             self.where)


def with_lights(series: JointSeries, lights: Mapping[str, float]) -> JointSeries:
    """
    Add the present lights of vehicles; future lights are unknown, which is NaN.

    :param series: a request without lights.
    :param lights: bits of `Light` by vehicle; NaN where they are not seen. Those of a vehicle that
        is not in the request are left out.
    """
    known = {name.rpartition('/')[0] for name in series.names}
    lights = {name: bits for name, bits in lights.items() if name in known}
    shape = (len(series.positions), len(lights))
    shown, nothing = np.full(shape, math.nan), np.full(shape, math.nan)
    shown[0] = [*lights.values()]
    return JointSeries(
        series.stamp_ns, (*series.names, *(name + _JOINT for name in lights)), series.times_ns,
        *(np.concatenate((array, new), axis=1) for array, new in (
            (series.positions, shown), (series.velocities, nothing),
            (series.accelerations, nothing))))


def without_lights(series: JointSeries) -> tuple[JointSeries, dict[str, float]]:
    """Split a request into the arguments of `with_lights`."""
    columns = light_columns(series.names)
    if not columns:
        return series, {}
    lights = {name: float(series.positions[0, column]) for name, column in columns.items()}
    kept = [column for column in range(len(series.names)) if column not in columns.values()]
    return JointSeries(
        series.stamp_ns, tuple(series.names[column] for column in kept), series.times_ns,
        *(array[:, kept] for array in (
            series.positions, series.velocities, series.accelerations))), lights


def light_columns(names: tuple[str, ...]) -> dict[str, int]:
    """Find the columns that hold lights, by vehicle."""
    return {name.removesuffix(_JOINT): column for column, name in enumerate(names)
            if name.endswith(_JOINT)}


def light_of(value: float) -> Light | None:
    """Read the position of a lights joint of any sender; None if it has no meaning."""
    return Light(int(value) & ALL_LIGHTS) if math.isfinite(value) else None


def request_head(data: bytes, where: str) -> JointSeries:
    """
    Read stamp and first vehicle of a request's point 0.

    :param data: a serialised trajectory_msgs/JointTrajectory.
    :param where: topic for messages.
    :return: one point of four joints
    :raises InputError: if it is something else.
    """
    try:
        reader = Reader(data)
        stamp_ns = reader.stamp_ns()
        reader.skip_text()
        names = reader.number()
        if names < JOINTS:
            raise ValueError('too few joints')
        own = tuple(reader.text() for _ in range(JOINTS))
        for _ in range(names - JOINTS):
            reader.skip_text()
        if not reader.number():
            raise ValueError('no points')
        rows = [np.array([reader.doubles(JOINTS)]) for _ in range(3)]
    except (ValueError, struct.error, UnicodeDecodeError) as error:
        raise InputError(f'cannot be read ({error})', where) from error
    return JointSeries(stamp_ns, own, np.zeros(1, dtype=np.int64), *rows)
