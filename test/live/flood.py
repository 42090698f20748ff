# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A process that publishes unrequested plans, commands and agents, hundreds of each a second.

    python test/live/flood.py SECONDS, in the ROS domain of a graph
"""

import sys
import time

from builtin_interfaces.msg import Time
from crgame_ros.ros.endpoints import Endpoints
import rclpy
from sensor_msgs.msg import Joy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

# Of each kind, fifty times a second: more would cost the graph its processor, too.
BURST = 10
# No tick of any run.
STAMP = Time(sec=1_000_000, nanosec=7)


def main() -> None:
    """Publish the messages."""
    until_s = time.monotonic() + float(sys.argv[1])
    rclpy.init()
    node = rclpy.create_node('flood')
    endpoints = Endpoints(node)
    trajectory = JointTrajectory(
        joint_names=[f'av0/{joint}' for joint in ('x', 'y', 'yaw', 'steering')],
        points=[JointTrajectoryPoint(positions=[0.0] * 4, velocities=[0.0] * 4)] * 30)
    trajectory.header.stamp = STAMP
    command = Joy(axes=[0.0, 1.0, 0.0])
    command.header.stamp, command.header.frame_id = STAMP, 'ghost'
    sent = ((endpoints.publisher('/<av>/plan', 'av0'), trajectory),
            (endpoints.publisher('/traffic/agents'), trajectory),
            (endpoints.publisher('/<v>/driver_command', 'hv0'), command))
    while not all(publisher.get_subscription_count() for publisher, _ in sent):
        time.sleep(0.05)
    while time.monotonic() < until_s:
        for publisher, message in sent:
            for _ in range(BURST):
                publisher.publish(message)
        time.sleep(0.02)
    rclpy.shutdown()


if __name__ == '__main__':
    main()
