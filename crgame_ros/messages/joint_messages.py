# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Reading `trajectory_msgs/JointTrajectory` messages, whichever library has decoded them.

Messages of a live run and of a recording have the same attributes.
"""

from collections.abc import Sequence
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.joints import JointSeries
import numpy as np
from numpy.typing import NDArray

MAP = 'map'
NS_PER_S = 1_000_000_000

FloatArray = NDArray[np.float64]


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
