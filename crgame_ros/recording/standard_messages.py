# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Standard messages as bytes, without ROS: the same that rclpy makes of the nodes' messages."""

from collections.abc import Sequence
from functools import cache
from typing import Any

from crgame_ros.messages.joints import JointSeries, MAP, NS_PER_S
from crgame_ros.messages.status_values import Status
import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import get_typestore, Stores
from rosbags.typesys.store import Typestore

CLOCK, TEXT = 'rosgraph_msgs/msg/Clock', 'std_msgs/msg/String'
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
TABLE, STATUS = 'std_msgs/msg/Float64MultiArray', 'diagnostic_msgs/msg/DiagnosticArray'
_NO_EFFORT = np.empty(0)

FloatArray = NDArray[np.float64]


@cache
def standard_types() -> Typestore:
    """Return the types of ROS 2 Jazzy, whose code is generated once for all recordings."""
    return get_typestore(Stores.ROS2_JAZZY)


def _make(type_name: str, *fields: Any) -> Any:
    """Make a message of its fields in their order."""
    return standard_types().types[type_name](*fields)


def _serialised(message: object, type_name: str) -> bytes:
    return bytes(standard_types().serialize_cdr(message, type_name))


def _time(stamp_ns: int, type_name: str = 'builtin_interfaces/msg/Time') -> Any:
    return _make(type_name, *divmod(stamp_ns, NS_PER_S))


def text_bytes(text: str) -> bytes:
    """Return a String."""
    return _serialised(_make(TEXT, text), TEXT)


def clock_bytes(stamp_ns: int) -> bytes:
    """Return a Clock at a simulation time [ns]."""
    return _serialised(_make(CLOCK, _time(stamp_ns)), CLOCK)


def trajectory_bytes(series: JointSeries) -> bytes:
    """Return a JointTrajectory in the frame `map`."""
    points = [_make('trajectory_msgs/msg/JointTrajectoryPoint', *rows, _NO_EFFORT,
                    _time(time_ns, 'builtin_interfaces/msg/Duration'))
              for *rows, time_ns in zip(*map(np.ascontiguousarray, (
                  series.positions, series.velocities, series.accelerations)),
                  series.times_ns.tolist(), strict=True)]
    header = _make('std_msgs/msg/Header', _time(series.stamp_ns), MAP)
    return _serialised(_make(TRAJECTORY, header, list(series.names), points), TRAJECTORY)


def table_bytes(label: str, columns: str, rows: Sequence[float]) -> bytes:
    """
    Return a labelled Float64MultiArray.

    :param label: of its first dimension.
    :param columns: their names, separated by commas: the label of its second dimension.
    :param rows: all rows, flattened.
    """
    width, values = columns.count(',') + 1, np.array(rows, dtype=np.float64)
    dimension = 'std_msgs/msg/MultiArrayDimension'
    layout = _make('std_msgs/msg/MultiArrayLayout', [
        _make(dimension, label, len(values) // width, len(values)),
        _make(dimension, columns, width, width)], 0)
    return _serialised(_make(TABLE, layout, values), TABLE)


def status_bytes(status: Status, stamp_ns: int, sender: str) -> bytes:
    """
    Return a DiagnosticArray of one status.

    :param stamp_ns: simulation time of the status [ns]
    :param sender: full name of the node.
    """
    values = [_make('diagnostic_msgs/msg/KeyValue', key, value)
              for key, value in status.values.items()]
    header = _make('std_msgs/msg/Header', _time(stamp_ns), '')
    return _serialised(_make(STATUS, header, [
        _make('diagnostic_msgs/msg/DiagnosticStatus', status.level, status.name, status.text,
              sender, values)]), STATUS)
