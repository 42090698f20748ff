# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion between core types and standard messages."""

from array import array
from collections.abc import Sequence

from builtin_interfaces.msg import Duration, Time
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Joy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from crgame_ros.driver.command import DriverCommand
from crgame_ros.errors import InputError
from crgame_ros.planner.joints import JointSeries

MAP = 'map'
NS_PER_S = 1_000_000_000


def to_time(stamp_ns: int) -> Time:
    """Give a stamp [ns] as a message."""
    return Time(sec=stamp_ns // NS_PER_S, nanosec=stamp_ns % NS_PER_S)


def from_time(stamp: Time) -> int:
    """Give a message's stamp in nanoseconds."""
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)


def set_time(stamp: Time, stamp_ns: int) -> None:
    """Refill a stamp in place."""
    stamp.sec, stamp.nanosec = divmod(stamp_ns, NS_PER_S)


def to_joint_trajectory(series: JointSeries) -> JointTrajectory:
    """Build a message from a joint series."""
    message = JointTrajectory(joint_names=list(series.names))
    message.header.frame_id = MAP
    message.header.stamp = to_time(series.stamp_ns)
    points = []
    for index, time_ns in enumerate(series.times_ns.tolist()):
        points.append(JointTrajectoryPoint(
            positions=array('d', series.positions[index].tobytes()),
            velocities=array('d', series.velocities[index].tobytes()),
            accelerations=array('d', series.accelerations[index].tobytes()),
            time_from_start=Duration(sec=time_ns // NS_PER_S, nanosec=time_ns % NS_PER_S)))
    message.points = points
    return message


def from_joint_trajectory(message: JointTrajectory, where: str) -> JointSeries:
    """
    Read a message from anyone as a joint series; accelerations may be left out (NaN).

    :param where: topic name for messages.
    :raises InputError: if a point doesn't give every joint, or a frame other than map is named.
    """
    if message.header.frame_id not in (MAP, ''):
        raise InputError(f'frame "{message.header.frame_id}" is not {MAP}', where)
    points: Sequence[JointTrajectoryPoint] = message.points
    joints = len(message.joint_names)
    times_ns = np.array([point.time_from_start.sec * NS_PER_S + point.time_from_start.nanosec
                         for point in points], dtype=np.int64)
    return JointSeries(
        from_time(message.header.stamp), tuple(message.joint_names), times_ns,
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


class StateMessage:
    """
    A JointTrajectory of one point, built once and refilled in place.

    :param names: joint names.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.message = JointTrajectory(joint_names=list(names))
        self.message.header.frame_id = MAP
        zeros = [0.0] * len(names)
        point = JointTrajectoryPoint(positions=array('d', zeros), velocities=array('d', zeros),
                                     accelerations=array('d', zeros))
        self.message.points = [point]
        # Views of the arrays' memory: filling them fills the message.
        self.positions = np.frombuffer(point.positions)
        self.velocities = np.frombuffer(point.velocities)
        self.accelerations = np.frombuffer(point.accelerations)

    def stamp(self, stamp_ns: int) -> JointTrajectory:
        """Set the stamp and give the message."""
        set_time(self.message.header.stamp, stamp_ns)
        return self.message


class SeriesMessage:
    """
    A JointTrajectory of many points, built once and refilled in place.

    Building one anew costs 10 µs a point, refilling 1 µs.

    :param names: joint names.
    :param times_ns: (P) time from the stamp of each point [ns]
    """

    def __init__(self, names: Sequence[str], times_ns: NDArray[np.int64]) -> None:
        self._names = tuple(names)
        nowhere = np.full((len(times_ns), len(names)), np.nan)
        self.message = to_joint_trajectory(
            JointSeries(0, tuple(names), times_ns, nowhere, nowhere, nowhere))
        self._views = [
            tuple(np.frombuffer(values) for values in (
                point.positions, point.velocities, point.accelerations))
            for point in self.message.points]

    def fits(self, series: JointSeries) -> bool:
        """Tell whether a series has this message's joints and number of points."""
        return len(self._views) == len(series.times_ns) and self._names == series.names

    def fill(self, series: JointSeries) -> JointTrajectory:
        """Take a series of the same joints and times over, and give the message."""
        set_time(self.message.header.stamp, series.stamp_ns)
        for index, (positions, velocities, accelerations) in enumerate(self._views):
            positions[:] = series.positions[index]
            velocities[:] = series.velocities[index]
            accelerations[:] = series.accelerations[index]
        return self.message


def to_joy(command: DriverCommand, stamp_ns: int, source: str) -> Joy:
    """
    Give a driver's command as a message (contract: /<v>/driver_command).

    :param source: who speaks, as /seats names it.
    """
    message = Joy(axes=array('f', (command.throttle, command.brake, command.steering)),
                  buttons=array('i', (int(command.reverse),)))
    message.header.frame_id = source
    message.header.stamp = to_time(stamp_ns)
    return message


def from_joy(message: Joy, where: str) -> DriverCommand:
    """
    Read a driver's command.

    :raises InputError: if axes or buttons are missing.
    """
    if len(message.axes) < 3 or len(message.buttons) < 1:
        raise InputError(f'has {len(message.axes)} axes and {len(message.buttons)} buttons', where,
                         'give axes throttle, brake, steering and the button reverse')
    throttle, brake, steering = message.axes[:3]
    return DriverCommand(throttle, brake, steering, bool(message.buttons[0])).rounded()
