# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Trajectories as flat joint arrays: the core's image of trajectory_msgs/JointTrajectory.

Both runners pass requests and plans through these functions, so that a planner sees the same
bits in process and over DDS. A driven vehicle is the joints x, y, yaw and steering of its rear
axle, any other object x, y and yaw of its centre; absence is NaN (`msg_defs/interfaces.yaml`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

VEHICLE_JOINTS = ('x', 'y', 'yaw', 'steering')
OBJECT_JOINTS = ('x', 'y', 'yaw')


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


def vehicle_joint_names(vehicle_id: str) -> tuple[str, ...]:
    """Name the joints of a driven vehicle."""
    return tuple(f'{vehicle_id}/{joint}' for joint in VEHICLE_JOINTS)


def object_joint_names(object_id: str) -> tuple[str, ...]:
    """Name the joints of an object that is no driven vehicle."""
    return tuple(f'{object_id}/{joint}' for joint in OBJECT_JOINTS)
