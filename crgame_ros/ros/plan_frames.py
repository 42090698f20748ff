# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plans and plan requests of anybody as rows of the cockpit's frames."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from trajectory_msgs.msg import JointTrajectory

from crgame_ros.cockpit.frames import PLAN_COLUMNS
from crgame_ros.errors import InputError
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.ros.messages import from_joint_trajectory
from crgame_ros.vehicle.state import StateColumn

# Of a plan or a prediction: more would hold up everything else.
MAX_POINTS = 1000


def plan_rows(message: JointTrajectory, transform: RigidTransform) -> NDArray[np.float64]:
    """
    Give the points (P, 5) of a plan: x, y, yaw, speed, time after its stamp.

    :param transform: of the AV.
    :raises InputError: if there are too many points, or one lacks a pose or a velocity.
    """
    _check_length(message)
    rows = np.empty((len(message.points), PLAN_COLUMNS))
    for row, point in zip(rows, message.points, strict=True):
        if len(point.positions) < 3 or len(point.velocities) < 2:
            raise InputError('has a point without pose or velocity', 'plan')
        x, y, yaw = point.positions[:3]
        vx, vy = point.velocities[:2]
        time_from_start = point.time_from_start
        row[:] = (x, y, yaw, vx * np.cos(yaw) + vy * np.sin(yaw),
                  time_from_start.sec + 1e-9 * time_from_start.nanosec)
    rows[:, :3] = transform.to_simulation(rows[:, :3])
    return rows


def predicted(message: JointTrajectory, columns: Mapping[str, int], av: str,
              transform: RigidTransform) -> tuple[list[int], NDArray[np.float64]]:
    """
    Give who is predicted in a plan request, as columns (Q), and their poses (Q, P, 3).

    :param columns: of everything that can appear, by id.
    :param av: who asks, and is left out.
    :param transform: of the AV.
    :raises InputError: if points are missing or do not give every joint.
    """
    _check_length(message)
    joints = [name.rpartition('/') for name in message.joint_names]
    starts = [(start, columns[name]) for start, (name, _, joint) in enumerate(joints)
              if joint == 'x' and name != av and name in columns]
    positions = from_joint_trajectory(message, 'plan request').positions
    if not len(positions) or any(start + 3 > len(joints) for start, _ in starts):
        raise InputError('has joints or points missing', 'plan request')
    futures = np.array([positions[:, start:start + 3] for start, _ in starts])
    futures = transform.to_simulation(futures.reshape(len(starts), len(positions), 3))
    present = np.isfinite(futures[:, 0, StateColumn.X])
    return [column for (_, column), here in zip(starts, present, strict=True) if here], \
        futures[present]


def _check_length(message: JointTrajectory) -> None:
    if len(message.points) > MAX_POINTS:
        raise InputError(f'has {len(message.points)} points', 'plan or plan request',
                         f'give at most {MAX_POINTS}')
