# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The others of a run at any of its steps and beyond its end, and predictions of one of them."""

from crgame_ros.geometry.reference_point import shifted, shifted_velocities
from crgame_ros.simulation.contacts import Motions
from crgame_ros.vehicle.state import pose_rates, REST, StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def poses_at(motions: Motions, steps: IntArray) -> FloatArray:
    """
    Return the poses of all centres at simulation steps (T, V + M, 3); NaN where absent.

    After the run's last step, everybody goes on as fast as in it, straight ahead.

    :param steps: (T), 0 at least.
    """
    rows = _rows(motions, steps)
    since_s = (steps - motions.object_ns[rows]) * motions.scheduler.dt_s
    turning_s = since_s - _beyond_s(motions, steps)
    elapsed_s = np.stack((since_s, since_s, turning_s), axis=-1)
    others = motions.object_poses[rows] + motions.object_velocities[rows] * elapsed_s[:, None]
    return np.concatenate((driven_poses_at(motions, steps), others), axis=1)


def driven_poses_at(motions: Motions, steps: IntArray) -> FloatArray:
    """Return the poses of the driven vehicles' centres as `poses_at` (T, V, 3)."""
    states = motions.vehicle_states[np.minimum(steps, len(motions.vehicle_states) - 1)]
    offsets = np.array([item.rear_to_center for item in motions.descriptions[:states.shape[1]]])
    return shifted(states[..., :3], offsets + states[..., StateColumn.SPEED]
                   * _beyond_s(motions, steps)[:, None])


def _beyond_s(motions: Motions, steps: IntArray) -> FloatArray:
    """Return the times from the end of the run to later steps [s]."""
    beyond = np.maximum(steps - (len(motions.vehicle_states) - 1), 0)
    return np.asarray(beyond * motions.scheduler.dt_s)


def _rows(motions: Motions, steps: IntArray) -> IntArray:
    return np.maximum(np.searchsorted(motions.object_ns, steps, side='right') - 1, 0)


def velocities_of(motions: Motions, column: int, steps: IntArray) -> FloatArray:
    """
    Return the derivatives of a centre's poses at simulation steps of the run (T, 3).

    :param column: of the body among the descriptions.
    """
    driven = motions.vehicle_states.shape[1]
    if column >= driven:
        return np.asarray(motions.object_velocities[_rows(motions, steps), column - driven])
    states = motions.vehicle_states[steps, column]
    return shifted_velocities(states[:, StateColumn.YAW], pose_rates(states),
                              motions.descriptions[column].rear_to_center)


def predicted(poses: FloatArray, velocities: FloatArray, dt_s: float,
              ahead_s: FloatArray) -> FloatArray:
    """
    Predict a body from each of its poses, at constant velocity and with its present changes.

    The second prediction keeps turn rate and acceleration; it does not go backwards after a halt.
    The acceleration is the one that begins at the pose: brake lights tell it at once.

    :param poses: (K, 3) of its centre at successive times.
    :param velocities: (K + 1, 3) their derivatives, and those one time later.
    :param dt_s: between these times [s]
    :param ahead_s: (P) equidistant times to predict, from 0 [s]
    :return: (2, K, P, 3) poses by either prediction.
    """
    velocity, after = velocities[:-1], velocities[1:]
    speed, next_speed = (np.hypot(each[:, 0], each[:, 1]) for each in (velocity, after))
    heading = np.where((speed > REST)[:, None], velocity, after)
    straight = poses[:, None] + ahead_s[:, None] * (velocity * (1.0, 1.0, 0.0))[:, None]
    pace = np.maximum(speed[:, None] + ((next_speed - speed) / dt_s)[:, None] * ahead_s, 0.0)
    turn = velocity[:, 2:] * ahead_s
    course = np.arctan2(heading[:, 1], heading[:, 0])[:, None] + turn
    # Over each interval, the mean of both ends.
    way = 0.5 * (pace[:, 1:] + pace[:, :-1]) * (ahead_s[1] - ahead_s[0])
    middle = 0.5 * (course[:, 1:] + course[:, :-1])
    changing = np.empty_like(straight)
    changing[..., :2] = poses[:, None, :2]
    changing[:, 1:, 0] += np.cumsum(way * np.cos(middle), axis=1)
    changing[:, 1:, 1] += np.cumsum(way * np.sin(middle), axis=1)
    changing[..., 2] = poses[:, 2:] + turn
    return np.stack((straight, changing))
