# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion between core types and standard messages."""

from array import array
from collections.abc import Sequence

from builtin_interfaces.msg import Duration, Time
from crgame_ros.errors import InputError
from crgame_ros.messages.joints import JointSeries, MAP
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.lights import Light, lights_of, OF_DRIVERS
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Joy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

# Variance of exact states in covariances: far below the simulation's resolution, but not 0, which
# filters cannot invert and some read as "unknown" [m^2], [rad^2], …
EXACT_VARIANCE = 1e-9
NS_PER_S = 1_000_000_000


def to_time(stamp_ns: int) -> Time:
    """Return a stamp [ns] as a message."""
    return Time(sec=stamp_ns // NS_PER_S, nanosec=stamp_ns % NS_PER_S)


def from_time(stamp: Time) -> int:
    """Return a message's stamp in nanoseconds."""
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


class StateMessage:
    """A JointTrajectory of one point, built once and refilled in place."""

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
        """Set the stamp and return the message."""
        set_time(self.message.header.stamp, stamp_ns)
        return self.message


class SeriesMessage:
    """
    A JointTrajectory of many points, built once and refilled in place.

    Building a new one costs 10 µs per point, refilling 1 µs.

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

    @classmethod
    def for_series(cls, series: JointSeries, before: 'SeriesMessage | None') -> 'SeriesMessage':
        """Return the previous message, or a new one if the series has other joints or points."""
        if before is not None and before._names == series.names \
                and len(before._views) == len(series.times_ns):
            return before
        return cls(series.names, series.times_ns)

    def fill(self, series: JointSeries) -> JointTrajectory:
        """Refill the message from a series of the same joints and times, and return it."""
        set_time(self.message.header.stamp, series.stamp_ns)
        for index, (positions, velocities, accelerations) in enumerate(self._views):
            positions[:] = series.positions[index]
            velocities[:] = series.velocities[index]
            accelerations[:] = series.accelerations[index]
        return self.message


def to_joy(command: DriverCommand, stamp_ns: int, source: str) -> Joy:
    """
    Return a driver's command as a message (contract: /<v>/driver_command).

    :param source: of the command, as /seats names it.
    """
    message = Joy(axes=array('f', (command.throttle, command.brake, command.steering)),
                  buttons=array('i', (
                      int(command.reverse),
                      *(int(bool(command.lights & bit)) for bit in Light if bit & OF_DRIVERS),
                      int(command.put_back))))
    message.header.frame_id = source
    message.header.stamp = to_time(stamp_ns)
    return message


def from_joy(message: Joy, where: str) -> DriverCommand:
    """
    Read a driver's command; functions without a button are off.

    :raises InputError: if axes or buttons are missing.
    """
    if len(message.axes) < 3 or len(message.buttons) < 1:
        raise InputError(f'has {len(message.axes)} axes and {len(message.buttons)} buttons', where,
                         'give axes throttle, brake, steering and the button reverse')
    throttle, brake, steering = message.axes[:3]
    reverse, left, right, horn, put_back = (*message.buttons, 0, 0, 0, 0)[:5]
    return DriverCommand(throttle, brake, steering, bool(reverse),
                         lights_of(left, right, horn), bool(put_back)).rounded()
