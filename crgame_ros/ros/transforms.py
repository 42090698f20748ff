# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The frames of the messages: map to <v>/base_link, and from there to the sensors."""

from collections.abc import Iterable, Sequence
import math

from crgame_ros.game.driven_vehicle import DrivenAv
from crgame_ros.messages.contract import load_contract
from crgame_ros.messages.joint_messages import MAP
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import to_time
from geometry_msgs.msg import TransformStamped


def transform(parent: str, child: str, pose: Iterable[float], stamp_ns: int) -> TransformStamped:
    """
    Return the pose of a frame in another one.

    :param pose: x, y [m] and yaw [rad] of `child` in `parent`
    """
    x, y, yaw = pose
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = parent
    message.header.stamp = to_time(stamp_ns)
    message.transform.translation.x, message.transform.translation.y = x, y
    message.transform.rotation.z = math.sin(0.5 * yaw)
    message.transform.rotation.w = math.cos(0.5 * yaw)
    return message


def vehicle_transforms(vehicle_ids: Sequence[str], poses: Iterable[Iterable[float]],
                       stamp_ns: int) -> list[TransformStamped]:
    """Return the pose of each rear axle, `<v>/base_link`: x, y [m] and yaw [rad] in map."""
    return [transform(MAP, f'{vehicle}/base_link', pose, stamp_ns)
            for vehicle, pose in zip(vehicle_ids, poses, strict=True)]


def sensor_transforms(avs: Iterable[DrivenAv], stamp_ns: int) -> list[TransformStamped]:
    """
    Return the pose of each AV's sensors, `<av>/<sensor>`, on its `base_link`.

    :param avs: of the game document.
    """
    return [transform(f'{av.id}/base_link', f'{av.id}/{sensor.name}',
                      sensor.mount(av.vehicle.rear_to_center, av.vehicle.length), stamp_ns)
            for av in avs if av.perception is not None for sensor in av.perception.sensors]


class Transforms:
    """
    The topics `/tf` and `/tf_static`, where `tf2_msgs` is installed.

    It is in every ROS installation, but not among the wheels.

    :param endpoints: of the node.
    """

    def __init__(self, endpoints: Endpoints) -> None:
        topics = load_contract().topics
        self.available = topics['/tf'].available
        if self.available:
            from tf2_msgs.msg import TFMessage
            self._message = TFMessage
            self._moving = endpoints.publisher('/tf')
            self._fixed = endpoints.publisher('/tf_static')

    @property
    def wanted(self) -> bool:
        """Return whether there are subscribers."""
        return self.available and self._moving.get_subscription_count() > 0

    def place_sensors(self, avs: Iterable[DrivenAv], stamp_ns: int) -> None:
        """Publish the mounting of a game's sensors, latched."""
        if self.available:
            self._fixed.publish(self._message(transforms=sensor_transforms(avs, stamp_ns)))

    def place_vehicles(self, vehicle_ids: Sequence[str], poses: Iterable[Iterable[float]],
                       stamp_ns: int) -> None:
        """Publish the vehicles' poses if there are subscribers; see `vehicle_transforms`."""
        if self.wanted:
            self._moving.publish(self._message(
                transforms=vehicle_transforms(vehicle_ids, poses, stamp_ns)))
