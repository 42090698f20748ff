# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node that waits for the odometry of the step in which a vehicle's wheels turn."""

import time
from typing import Any

LIMIT_S = 1.0


class OdometryProbe:
    """Notes when the odometry of each step of hv0 arrives, and how its front wheels turn in it."""

    def __init__(self) -> None:
        from nav_msgs.msg import Odometry
        import rclpy
        from rclpy.experimental import EventsExecutor
        from sensor_msgs.msg import JointState
        self.node = rclpy.create_node('odometry_probe')
        self._executor = EventsExecutor()
        self._executor.add_node(self.node)
        self._arrived: dict[int, float] = {}
        self._rates: dict[int, float] = {}
        self._kept = [
            self.node.create_subscription(Odometry, '/hv0/odom', self._on_odom, 10),
            self.node.create_subscription(JointState, '/hv0/joint_states', self._on_joint, 10)]

    def _on_odom(self, message: Any) -> None:
        stamp = message.header.stamp
        self._arrived[stamp.sec * 10**9 + stamp.nanosec] = time.time()

    def _on_joint(self, message: Any) -> None:
        stamp = message.header.stamp
        self._rates[stamp.sec * 10**9 + stamp.nanosec] = message.velocity[0]

    def listen(self, seconds: float) -> None:
        """Receive messages for a while, and drop them."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self._executor.spin_once(timeout_sec=0.002)
        self._arrived.clear()
        self._rates.clear()

    def wait_for_step(self) -> None:
        """Wait for the odometry of another step."""
        known, until_s = len(self._arrived), time.monotonic() + LIMIT_S
        while len(self._arrived) == known and time.monotonic() < until_s:
            self._executor.spin_once(timeout_sec=0.05)

    def wait_for_turn(self, direction: float) -> tuple[int, float] | None:
        """
        Wait for the first step whose wheels turn to one side.

        :param direction: 1 to the left, -1 to the right.
        :return: its stamp [ns] and when its odometry arrived [s since 1970]; None after a second
        """
        until_s = time.monotonic() + LIMIT_S
        while time.monotonic() < until_s:
            self._executor.spin_once(timeout_sec=0.05)
            for stamp in sorted(self._rates):
                if self._rates[stamp] * direction > 0.0 and stamp in self._arrived:
                    return stamp, self._arrived[stamp]
        return None

    def close(self) -> None:
        """Leave the graph."""
        self.node.destroy_node()
