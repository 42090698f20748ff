# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages to record, serialised by a library that is not under test."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
CYCLE_LABEL = 'epoch,n,k,e_n'


class Samples:
    """Builds messages and serialises them with rosbags."""

    def __init__(self) -> None:
        self.store = get_typestore(Stores.ROS2_JAZZY)

    def make(self, type_name: str, *fields: Any) -> Any:
        """Make a message object from its fields in their order."""
        return self.store.types[type_name](*fields)

    def encode(self, type_name: str, *fields: Any) -> bytes:
        """Serialise a message made from its fields in their order."""
        return bytes(self.store.serialize_cdr(self.make(type_name, *fields), type_name))

    def string(self, text: str) -> bytes:
        """Serialise a std_msgs/msg/String."""
        return self.encode('std_msgs/msg/String', text)

    def clock(self, time_ns: int) -> bytes:
        """Serialise a rosgraph_msgs/msg/Clock."""
        time = self.make('builtin_interfaces/msg/Time', *divmod(time_ns, 1_000_000_000))
        return self.encode('rosgraph_msgs/msg/Clock', time)

    def trajectory(self, joints: int, points: int, base: float = 0.0) -> bytes:
        """Serialise a JointTrajectory whose positions count up from `base` at each point."""
        header = self.make('std_msgs/msg/Header',
                           self.make('builtin_interfaces/msg/Time', 3, 4), 'map')
        values = base + np.arange(float(joints))
        rows = [self.make('trajectory_msgs/msg/JointTrajectoryPoint', values + i, values * 2,
                          values * 3, np.zeros(0),
                          self.make('builtin_interfaces/msg/Duration', 0, i * 100))
                for i in range(points)]
        return self.encode(TRAJECTORY, header, [f'av{i}/x' for i in range(joints)], rows)

    def cycles(self, rows: Sequence[tuple[int, int]], label: str = CYCLE_LABEL) -> bytes:
        """Serialise /timing/cycle from pairs (epoch, n)."""
        columns = len(label.split(','))
        table = np.zeros((len(rows), columns))
        table[:, :2] = rows
        dimension = 'std_msgs/msg/MultiArrayDimension'
        layout = self.make('std_msgs/msg/MultiArrayLayout', [
            self.make(dimension, 'cycles', len(rows), table.size),
            self.make(dimension, label, columns, columns)], 0)
        return self.encode('std_msgs/msg/Float64MultiArray', layout, table.ravel())


@pytest.fixture(scope='session')
def samples() -> Samples:
    """Return the maker of messages."""
    return Samples()
