# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Incoming messages from any peer: bounded, decoded and checked by the contract."""

from collections.abc import Callable, Mapping
import importlib
import math
import time
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError
from crgame_ros.messages.contract import Topic
from crgame_ros.messages.status_values import printable
from crgame_ros.ros.diagnostics import complain, Diagnostics
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from rclpy.node import Node
from rclpy.serialization import deserialize_message

if TYPE_CHECKING:  # Messages are decoded here that this process never receives otherwise.
    from builtin_interfaces.msg import Time
    from nav_msgs.msg import OccupancyGrid, Odometry
    from numpy.typing import NDArray
    from sensor_msgs.msg import Joy, LaserScan
    from std_msgs.msg import Float64MultiArray
    from trajectory_msgs.msg import JointTrajectory

# Largest position, speed and acceleration [m], [m/s], [m/s^2]; no stamp or time is below 0.
LARGEST = 1e9
# Time between reports of refusals [s], and the greatest length of their reasons.
REPORT_S = 1.0
LONGEST_REASON = 300


def message_type(type_name: str) -> object:
    """Import a message or service type from its name package/msg/Type."""
    package, kind, name = type_name.split('/')
    return getattr(importlib.import_module(f'{package}.{kind}'), name)


class MessageValidator:
    """
    The validator of one topic's messages.

    :param topic: its row in the contract.
    :param name: of the topic in this run.
    """

    def __init__(self, topic: Topic, name: str) -> None:
        self.name = name
        self._topic = topic
        self._type = message_type(topic.type_name)
        self._check = CHECKS.get(topic.type_name)

    def bound(self, data: bytes) -> bytes:
        """
        Check the length of a serialised message before it is decoded.

        :raises InputError: if it is longer than the contract allows.
        """
        if len(data) > self._topic.max_bytes:
            raise InputError(f'a message of {len(data)} bytes, at most {self._topic.max_bytes} '
                             'are read', self.name)
        return data

    def verify(self, data: bytes) -> bytes:
        """
        Check that a serialised message is one of the topic's type.

        :raises InputError: if it is none.
        """
        self._decode(data)
        return data

    def _decode(self, data: bytes) -> object:
        self.bound(data)
        try:
            return deserialize_message(data, self._type)
        except Exception as error:
            # The middleware may raise anything for bytes that are no such message.
            raise InputError(f'is no {self._topic.type_name} ({type(error).__name__})',
                             self.name) from error

    def read(self, data: bytes) -> object:
        """
        Decode a serialised message.

        :raises InputError: if it is not of the topic's type, or violates the contract.
        """
        message = self._decode(data)
        if self._check is not None:
            try:
                self._check(message, self._topic)
            except ValueError as error:
                raise InputError(str(error), self.name) from error
        return message


def _check_trajectory(message: 'JointTrajectory', topic: Topic) -> None:
    least, most = topic.points
    points, joints = message.points, len(message.joint_names)
    if not least <= len(points) <= most:
        raise ValueError(f'has {len(points)} points for {least} to {most}')
    _check_stamp(message.header.stamp)
    for index, point in enumerate(points):
        for values, needed in ((point.positions, True), (point.velocities, True),
                               (point.accelerations, topic.finite)):
            if len(values) == joints or not (needed or len(values)):
                continue
            raise ValueError(f'point {index} has {len(values)} numbers for {joints} joints')
        if point.time_from_start.sec < 0:
            raise ValueError(f'point {index} is before the stamp')
    # All rows at once: a check of each row costs more than that of its numbers.
    _check_numbers(np.frombuffer(b''.join(
        values for point in points for values in (point.positions, point.velocities))),
        topic.finite)
    _check_numbers(np.frombuffer(b''.join(point.accelerations for point in points)), False)


def _check_numbers(values: 'NDArray[np.float64]', finite: bool) -> None:
    """Check that numbers have plausible magnitudes; NaN means absent where it is allowed."""
    if not len(values):
        return
    size = np.abs(values)
    # Written so that NaN fails the first comparison.
    good = (size <= LARGEST).all() if finite else not (size > LARGEST).any()
    if not good:
        worst = values[int(np.argmax(~(size <= LARGEST)))]
        raise ValueError(f'{worst:g} is out of range or not a number')


def _check_stamp(stamp: 'Time') -> None:
    if stamp.sec < 0:
        raise ValueError(f'the stamp is {stamp.sec} s')


def _check_joy(message: 'Joy', _topic: Topic) -> None:
    if not all(math.isfinite(value) for value in message.axes):
        raise ValueError('an axis is no finite number')
    _check_stamp(message.header.stamp)


def _check_table(message: 'Float64MultiArray', _topic: Topic) -> None:
    sizes = [dim.size for dim in message.layout.dim]
    if len(sizes) != 2 or sizes[0] * sizes[1] != len(message.data) or not len(message.data):
        raise ValueError(f'has {len(message.data)} numbers in a layout of {sizes}')


def _check_grid(message: 'OccupancyGrid', _topic: Topic) -> None:
    info = message.info
    if info.width * info.height != len(message.data):
        raise ValueError(f'has {len(message.data)} cells for {info.height} x {info.width}')
    place = (info.resolution, info.origin.position.x, info.origin.position.y)
    if len(message.data) and not (info.resolution > 0.0 and all(
            math.isfinite(value) for value in place)):
        raise ValueError('has no resolution and origin')


def _check_scan(message: 'LaserScan', _topic: Topic) -> None:
    _check_stamp(message.header.stamp)
    if not all(math.isfinite(value) for value in (
            message.angle_min, message.angle_max, message.angle_increment, message.range_max)):
        raise ValueError('has no finite angles and horizon')


def _check_odometry(message: 'Odometry', _topic: Topic) -> None:
    _check_stamp(message.header.stamp)
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    _check_numbers(np.array([place.x, place.y, turn.z, turn.w, message.twist.twist.linear.x]),
                   False)


CHECKS: Mapping[str, Callable[[object, Topic], None]] = {
    'trajectory_msgs/msg/JointTrajectory': _check_trajectory,
    'sensor_msgs/msg/Joy': _check_joy,
    'sensor_msgs/msg/LaserScan': _check_scan,
    'std_msgs/msg/Float64MultiArray': _check_table,
    'nav_msgs/msg/OccupancyGrid': _check_grid,
    'nav_msgs/msg/Odometry': _check_odometry,
}


class Refusals:
    """The counts of a node's refusals by topic, published on /diagnostics."""

    def __init__(self, node: Node, diagnostics: Diagnostics) -> None:
        self._node = node
        self._diagnostics = diagnostics
        self.counts: dict[str, int] = {}
        self._told_s = -math.inf

    def note(self, where: str, reason: str) -> None:
        """Count a refusal, log one line a minute, and publish at most one status a second."""
        self.counts[where] = self.counts.get(where, 0) + 1
        text = printable(reason)[:LONGEST_REASON]
        complain(self._node, where, f'refused: {text}')
        now_s = time.monotonic()
        if now_s - self._told_s < REPORT_S:
            return
        self._told_s = now_s
        self._diagnostics.publish(f'{self._node.get_name()}: messages refused',
                                  DiagnosticStatus.WARN, text, self.counts)
