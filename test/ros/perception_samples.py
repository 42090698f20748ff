# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A game whose AV perceives, and messages with its perception."""

from array import array
from dataclasses import replace
from pathlib import Path
from typing import Any

from cockpit_graph import OFFSET_NS
from crgame_ros.cli import main
from crgame_ros.game.game import load_game
from crgame_ros.game.perception_spec import PerceptionSpec, SensorSpec
from crgame_ros.ros.messages import to_time
from crgame_ros.simulation.setup import build_setup, Setup
from live_support import CUT_IN
from nav_msgs.msg import OccupancyGrid, Odometry
import numpy as np
from sensor_msgs.msg import LaserScan


def perceiving_setup(folder: Path) -> Setup:
    """
    Load the cut-in game, with an AV that perceives by two sensors, and a map.

    :param folder: where the map is made.
    """
    game = load_game(CUT_IN)
    assert main(['rasterize', str(game.scenario), str(folder / 'map')]) == 0
    perception = PerceptionSpec(sensors=(SensorSpec('front'), SensorSpec('rear', yaw=np.pi)))
    return build_setup(replace(game, avs=(replace(game.avs[0], perception=perception),),
                               occupancy=folder / 'map' / 'map.yaml'))


def scan(sensor: str, n: int, **fields: Any) -> LaserScan:
    """Make a scan of av0 at step n: three rays over 120 degrees, the last of them into nothing."""
    values = {'angle_min': -1.0, 'angle_max': 1.0, 'angle_increment': 1.0, 'range_max': 80.0,
              'scan_time': 0.1, 'ranges': array('f', [4.0, 5.5, float('inf')])} | fields
    message = LaserScan(**values)
    message.header.frame_id = f'av0/{sensor}'
    message.header.stamp = to_time(OFFSET_NS + n * 10_000_000)
    return message


def estimate(n: int, yaw: float) -> Odometry:
    """Make an estimate at step n."""
    message = Odometry()
    message.header.stamp = to_time(OFFSET_NS + n * 10_000_000)
    pose = message.pose.pose
    pose.position.x, pose.position.y = 12.5, -1.25
    pose.orientation.z, pose.orientation.w = np.sin(0.5 * yaw), np.cos(0.5 * yaw)
    message.twist.twist.linear.x, message.twist.twist.angular.z = 9.0, 0.05
    message.pose.covariance = np.arange(36.0)
    return message


def grid(width: int, height: int, cells: list[int]) -> OccupancyGrid:
    """Make a map of cells of half a metre."""
    message = OccupancyGrid(data=array('b', cells))
    message.info.resolution = 0.5
    message.info.width, message.info.height = width, height
    message.info.origin.position.x, message.info.origin.position.y = 10.0, -20.0
    message.info.origin.orientation.w = 1.0
    return message
