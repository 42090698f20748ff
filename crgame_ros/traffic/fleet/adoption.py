# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded obstacles that become agents."""

from dataclasses import dataclass

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.traffic.lanes.lane_graph import FloatArray, heading_difference
import numpy as np

ADOPTED_TYPES = frozenset({'car', 'truck', 'bus', 'motorcycle', 'bicycle', 'taxi',
                           'priorityVehicle'})
# An obstacle that covers less than this in the whole recording is parked [m].
PARKED = 2.0
# An obstacle whose heading differs from its lane's by more than this is not driving on it [rad].
ASTRAY = 0.8


@dataclass(frozen=True)
class Adopted:
    """
    A recorded obstacle that is to become an agent.

    :param description: of the obstacle.
    :param first_k: scenario time step of its first pose.
    :param poses: (n, 3) of its centre at each time step from there on [m, rad]
    :param velocities: (n, 3) [m/s, rad/s]
    """

    description: ObjectDescription
    first_k: int
    poses: FloatArray
    velocities: FloatArray


def adoptable(description: ObjectDescription, poses: FloatArray, network: RoadNetwork) -> bool:
    """
    Return whether a recorded obstacle can become an agent.

    Vehicles and cyclists can if they move and drive along a lane for cars at some time.
    Pedestrians, parked and static obstacles cannot.

    :param poses: (n, 3) of its centre over the recording; NaN where absent [m, rad]
    """
    poses = poses[np.isfinite(poses).all(axis=1)]
    if description.role is not Role.RECORDED or description.type not in ADOPTED_TYPES:
        return False
    if len(poses) < 2 or np.hypot(*np.ptp(poses[:, :2], axis=0)) < PARKED:
        return False
    lanes = network.lanelets_at(poses)
    return any(fits(network, int(lane), pose) for lane, pose in
               zip(lanes, poses, strict=True) if lane >= 0)


def fits(network: RoadNetwork, lane: int, pose: FloatArray) -> bool:
    """Return whether a pose is that of a vehicle that drives along a lane for cars."""
    lanelet = network.lanelet_ids[lane]
    if not network.is_drivable(lanelet):
        return False
    s, _ = network.locate(lanelet, float(pose[0]), float(pose[1]))
    yaw = network.pose_on(lanelet, s)[2]
    return bool(abs(heading_difference(pose[2:3], np.array([yaw]))[0]) < ASTRAY)
