# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One planner is followed where several answer; its publisher is known by its id."""

from collections.abc import Iterator
import time

from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.one_planner import OnePlanner
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from ros_domains import own_domain_id
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

OWN, LEFT, MINE = '/planner_node_av0', '/left_over', '/my_planner'
A, B, C = b'a', b'b', b'c'


def _answers(planner: OnePlanner, *said: tuple[bytes, int]) -> str:
    """Return which answers are taken, as one letter each, `-` for one that is not."""
    return ''.join(publisher.decode() if planner.refusal(publisher, stamp_ns) is None else '-'
                   for publisher, stamp_ns in said)


@pytest.mark.parametrize('own, first', [(True, 'b'), (False, 'a')])
def test_the_first_one_stays(own: bool, first: str) -> None:
    """The node of the game's own planner, or of others whoever answered first."""
    planner = OnePlanner(lambda: {A: LEFT, B: OWN}, own)
    assert _answers(planner, *((who, at) for at in range(5) for who in (A, B))) == ''.join(
        who if who == first else '-' for _ in range(5) for who in 'ab')


def test_another_name_takes_over_after_two_requests_left_open() -> None:
    """It must have answered them alone: many answers to one request do not count."""
    planner = OnePlanner(lambda: {A: MINE, B: LEFT}, False)
    assert _answers(planner, (A, 0), (B, 1), (B, 1), (B, 1), (A, 1), (B, 2), (B, 3)) == 'a---a-b'
    # The first one comes back: now it is the other.
    assert _answers(planner, (A, 4), (B, 4), (A, 5), (B, 5)) == '-b-b'


def test_a_restarted_planner_is_followed_at_once() -> None:
    """Of the same name, and later than the one that was killed, which is still listed."""
    planner = OnePlanner(lambda: {A: OWN, B: OWN}, True)
    assert _answers(planner, (A, 0), (A, 1), (B, 2), (B, 3)) == 'aabb'
    # It was not killed: the earlier one stays.
    assert _answers(planner, (A, 4), (B, 4), (A, 5), (B, 5)) == 'a-a-'


def test_a_planner_that_has_gone_is_replaced_at_once() -> None:
    """Whatever the name of the next one is."""
    listed = {A: MINE, B: LEFT}
    planner = OnePlanner(lambda: listed, False)
    assert _answers(planner, (A, 0), (B, 0)) == 'a-'
    del listed[A]
    assert _answers(planner, (B, 1)) == 'b'


def test_the_reason_names_both() -> None:
    """A person sees which program to end."""
    planner = OnePlanner(lambda: {A: OWN, B: LEFT}, True)
    assert planner.refusal(A, 0) is None
    assert planner.refusal(B, 0) == f'of another planner: {LEFT} answers besides {OWN}'


@pytest.fixture
def nodes() -> Iterator[list[Node]]:
    """Make three nodes in a domain of their own."""
    context = Context()
    rclpy.init(context=context, domain_id=own_domain_id())
    made = [Node(name, context=context) for name in ('reader', 'first', 'second')]
    yield made
    for node in made:
        node.destroy_node()
    rclpy.try_shutdown(context=context)


def test_each_message_tells_its_publisher(nodes: list[Node]) -> None:
    """As DDS delivers it: the id is the one that the graph lists for the node."""
    slot = Endpoints(nodes[0]).polled('/<av>/plan', 'av0', depth=100, sent=True)
    publishers = [Endpoints(node).publisher('/<av>/plan', 'av0') for node in nodes[1:]]
    endpoints = Endpoints(nodes[0])
    for _ in range(1000):
        listed = endpoints.publishers(slot)
        if len(listed) == 2 and all(item.get_subscription_count() for item in publishers):
            break
        time.sleep(0.02)
    assert set(listed.values()) == {'/first', '/second'}
    heard = []
    for index in (0, 1, 1, 0):
        publishers[index].publish(JointTrajectory(
            joint_names=['av0/x', 'av0/y', 'av0/yaw', 'av0/steering'],
            points=[JointTrajectoryPoint(positions=[float(index)] * 4, velocities=[0.0] * 4,
                                         accelerations=[0.0] * 4)]))
        message = None
        while message is None:
            message = slot.pop()
        heard.append((listed[slot.publisher], message.points[0].positions[0]))
    assert heard == [('/first', 0.0), ('/second', 1.0), ('/second', 1.0), ('/first', 0.0)]
    assert slot.pop() is None
