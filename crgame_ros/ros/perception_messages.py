# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The results of an AV's perception in standard ROS types."""

from array import array
import math
from typing import Any

from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.messages.joint_messages import MAP
from crgame_ros.perception.perception import Perception
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import EXACT_VARIANCE, set_time
from nav_msgs.msg import Odometry
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan

Array = NDArray[np.float64]
# Indices of x, y and yaw in the 6 x 6 covariance of a pose.
POSE_PLACES = (0, 1, 5)


class LocalizationMessage:
    """
    The estimated pose and speed with their covariance.

    :param endpoints: of the node.
    :param av_id: the AV.
    """

    def __init__(self, endpoints: Endpoints, av_id: str) -> None:
        self._publisher = endpoints.publisher('/<av>/localization', av_id)
        self._message = Odometry(child_frame_id=f'{av_id}/base_link')
        self._message.header.frame_id = MAP

    def publish(self, stamp_ns: int, perception: Perception) -> None:
        """Publish the present estimate."""
        message, estimate = self._message, perception.estimate
        set_time(message.header.stamp, stamp_ns)
        pose, twist = message.pose, message.twist
        pose.pose.position.x, pose.pose.position.y = estimate.x, estimate.y
        pose.pose.orientation.z = math.sin(0.5 * estimate.yaw)
        pose.pose.orientation.w = math.cos(0.5 * estimate.yaw)
        twist.twist.linear.x, twist.twist.angular.z = estimate.speed, estimate.yaw_rate
        # Quantities that the filter does not estimate come from the world or the vehicle's own
        # sensors.
        known, covariance = np.diag([EXACT_VARIANCE] * 6), perception.covariance
        place = np.ix_(POSE_PLACES, POSE_PLACES)
        pose.covariance = _at_least(known, place, covariance[:3, :3])
        twist.covariance = _at_least(known, np.ix_((0,), (0,)), covariance[3:, 3:])
        self._publisher.publish(message)


def _at_least(known: Array, place: tuple[Any, ...], part: Array) -> Array:
    """Return a covariance (36) with the filter's part, bounded below by the exact variance."""
    covariance = known.copy()
    covariance[place] = part
    np.fill_diagonal(covariance, np.maximum(covariance.diagonal(), known.diagonal()))
    return covariance.ravel()


class ScanMessages:
    """
    The scans of the sensors: the hits of their rays.

    :param endpoints: of the node.
    :param av_id: the AV.
    """

    def __init__(self, endpoints: Endpoints, av_id: str) -> None:
        self._publisher = endpoints.publisher('/<av>/scan', av_id)
        self._av_id = av_id
        self._sent: dict[str, int] = {}

    def publish(self, scheduler: ScenarioScheduler, perception: Perception) -> None:
        """Publish every new scan."""
        for spec, n, scan in perception.scans:
            if self._sent.get(spec.name) == n:
                continue
            self._sent[spec.name] = n
            first, last = float(scan.angles[0]), float(scan.angles[-1])
            message = LaserScan(
                angle_min=first, angle_max=last,
                angle_increment=(last - first) / max(1, len(scan.angles) - 1),
                scan_time=1.0 / spec.rate, range_max=spec.horizon,
                ranges=array('f', scan.ranges.astype(np.float32).tobytes()))
            message.header.frame_id = f'{self._av_id}/{spec.name}'
            set_time(message.header.stamp, scheduler.stamp_ns(n))
            self._publisher.publish(message)
