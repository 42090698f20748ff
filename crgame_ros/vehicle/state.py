# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state of a driven vehicle: rear axle, frame map, SI units and radians."""

from enum import IntEnum
from typing import NamedTuple

from crgame_ros.geometry.reference_point import ahead
import numpy as np
from numpy.typing import NDArray

# Resolution of a wheel encoder: a slower vehicle has surely not moved.
ENCODER_REST = 0.01
# For planned states: planners end a stop with a rounding error, and a tracker must not mistake a
# plan that starts or ends gently for one at rest.
PLANNED_REST = 0.02
# For measured, recorded or driven speeds: nuPlan's bound for its kinds of contact. A slower motion
# is noise without a meaningful direction.
REST = 0.05
# For an agent that decides whether to go on: car-following laws approach 0 ever more slowly. So a
# slower agent with hardly any desired acceleration is held; it has halted.
STANDING = 0.1
# For other vehicles, as seen by an agent that waits for them or walks past: a creeping queue
# counts as standing too.
QUEUEING = 0.3


class VehicleState(NamedTuple):
    """
    State of a human's or autonomous vehicle at one time (CRG equations 3 and 5).

    :param x: rear-axle position, east [m]
    :param y: rear-axle position, north [m]
    :param yaw: heading, counter-clockwise from east [rad]
    :param speed: signed speed along the heading, negative in reverse [m/s]
    :param steering_angle: front-wheel steering angle, positive to the left [rad]
    :param acceleration: signed longitudinal acceleration [m/s^2]
    :param yaw_rate: [rad/s]
    :param steering_rate: rate of the front-wheel steering angle [rad/s]
    """

    x: float
    y: float
    yaw: float
    speed: float
    steering_angle: float = 0.0
    acceleration: float = 0.0
    yaw_rate: float = 0.0
    steering_rate: float = 0.0

    def center(self, rear_to_center: float) -> tuple[float, float]:
        """
        Return the position of the vehicle's centre.

        :param rear_to_center: distance l_r from the rear axle forward to the centre [m]
        :return: (x, y) of the centre in the same frame [m]
        """
        return ahead(self.x, self.y, self.yaw, rear_to_center)


class StateColumn(IntEnum):
    """Columns of an array of vehicle states; the order of `VehicleState`."""

    X = 0
    Y = 1
    YAW = 2
    SPEED = 3
    STEERING_ANGLE = 4
    ACCELERATION = 5
    YAW_RATE = 6
    STEERING_RATE = 7


STATE_WIDTH = len(StateColumn)


def pose_rates(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Return the rates of x, y and yaw of the rear axle.

    :param states: (N, 8) columns as in `StateColumn`.
    :return: (N, 3) [m/s, m/s, rad/s]
    """
    yaw, speed = states[:, StateColumn.YAW], states[:, StateColumn.SPEED]
    return np.column_stack((speed * np.cos(yaw), speed * np.sin(yaw),
                            states[:, StateColumn.YAW_RATE]))
