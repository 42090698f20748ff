# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The odometry of a driven vehicle for ROS tools."""

import math
import time

from crgame_ros.nodes.sim.outputs import VehicleOutputs
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest
import rclpy
from scipy.spatial.transform import Rotation

PATIENCE_S = 60.0


def test_odometry_is_exact_and_can_be_inverted(ros_domain: int) -> None:
    """
    The covariance of the simulation's own state is neither 0, which is singular, nor large.

    1e-9 is 0.03 mm: no filter can tell it from the truth, and each can divide by it.
    """
    rclpy.init(domain_id=ros_domain)
    node = rclpy.create_node('tester')
    try:
        endpoints = Endpoints(node)
        outputs = VehicleOutputs(endpoints, 'hv0')
        slot = endpoints.polled('/<v>/odom', 'hv0')
        state = VehicleState(3.0, -4.0, 2.5, -1.5, 0.1, 0.2, 0.3, 0.4)
        until_s = time.monotonic() + PATIENCE_S
        while not outputs.wanted:
            outputs.count_subscribers()
            assert time.monotonic() < until_s
        outputs.publish(state, 5_000_000_007)
        while (message := slot.pop()) is None:
            assert time.monotonic() < until_s
            time.sleep(0.001)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    assert (message.header.frame_id, message.child_frame_id) == ('map', 'hv0/base_link')
    turn = message.pose.pose.orientation
    assert Rotation.from_quat((turn.x, turn.y, turn.z, turn.w)).as_rotvec() == pytest.approx(
        (0.0, 0.0, 2.5))
    for part in (message.pose, message.twist):
        covariance = np.array(part.covariance).reshape(6, 6)
        assert np.array_equal(covariance, np.diag([1e-9] * 6))
        assert math.isfinite(np.linalg.inv(covariance).max())
