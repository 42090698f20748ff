# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The head of a plan request equals what rclpy's own decoder reads."""

from crgame_ros.errors import InputError
from crgame_ros.messages.joints import from_joint_trajectory, JointSeries
from crgame_ros.messages.request_layout import request_head
from crgame_ros.ros.messages import to_joint_trajectory
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory


def request(objects: int, av: str = 'av0') -> JointSeries:
    """Make a request of an AV and so many objects, whose names have all lengths."""
    names = [f'{av}/{joint}' for joint in ('x', 'y', 'yaw', 'steering')]
    names += [f'{"o" * (1 + index % 9)}{index}/x' for index in range(objects)]
    generator = np.random.default_rng(objects)
    rows = [generator.normal(size=(31, len(names))) for _ in range(3)]
    return JointSeries(12_345_678_901, tuple(names), np.arange(31) * 100_000_000, *rows)


@pytest.mark.parametrize('objects', range(9))
@pytest.mark.parametrize('av', ['av0', 'av12'])
def test_head_is_that_of_the_message(objects: int, av: str) -> None:
    """Whatever the alignment is: stamp, the AV's names and its joints in point 0, bit for bit."""
    message = to_joint_trajectory(request(objects, av))
    data, whole = serialize_message(message), from_joint_trajectory(message, 'x')
    head = request_head(data, '/av0/plan_request')
    assert head.stamp_ns == whole.stamp_ns and head.names == whole.names[:4]
    for name in ('positions', 'velocities', 'accelerations'):
        np.testing.assert_array_equal(getattr(head, name), getattr(whole, name)[:1, :4])


def test_accelerations_may_be_left_out() -> None:
    """Requests from outside have none."""
    message = to_joint_trajectory(request(3))
    for point in message.points:
        point.accelerations = []
    head = request_head(serialize_message(message), 'x')
    assert np.isnan(head.accelerations).all() and np.isfinite(head.velocities).all()


@pytest.mark.parametrize('data', [
    b'', b'\x00\x01\x00\x00', b'\x00\x00\x00\x00' + 100 * b'\x01', 300 * b'\xff',
    serialize_message(String(data='x' * 100)), serialize_message(JointTrajectory()),
    serialize_message(to_joint_trajectory(request(5)))[:150],
    serialize_message(JointTrajectory(joint_names=['a', 'b', 'c', 'd']))],
    ids=['empty', 'header', 'big endian', 'noise', 'text', 'nothing', 'cut', 'no points'])
def test_anything_else_is_refused(data: bytes) -> None:
    """It is refused in one line, never by an exception of another kind."""
    with pytest.raises(InputError, match='/av0/plan_request: cannot be read'):
        request_head(data, '/av0/plan_request')
