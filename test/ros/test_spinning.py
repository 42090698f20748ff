# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The loops of nodes, over DDS."""

from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.node_main import StopFlag
from crgame_ros.ros.spinning import PromptNode, spin_promptly
from live_peer import Peer
import rclpy
from ros_domains import own_domain_id
from std_msgs.msg import String

COUNT = 50


def test_a_prompt_node_runs_callbacks_and_leaves_polled_messages_alone() -> None:
    """An executor that knows no callback groups must not take what the node reads itself."""
    domain, sent = own_domain_id(), [str(n) for n in range(COUNT)]
    rclpy.init(domain_id=domain)
    node, stop, received = PromptNode('prompt'), StopFlag(), list[str]()
    with Peer(domain) as peer:
        endpoints = Endpoints(node)
        polled = endpoints.polled('/trigger', depth=COUNT)

        def receive(message: String) -> None:
            received.append(message.data)
            stop.requested = received == sent
            if not stop.requested:
                publisher.publish(String(data=sent[len(received)]))

        kept = endpoints.subscription('/trigger', receive)
        publisher = peer.publisher('/trigger')
        peer.wait_until(lambda: publisher.get_subscription_count() == 2, 'both subscriptions')
        publisher.publish(String(data=sent[0]))
        spin_promptly(node, stop)
        assert [message.data for message in iter(polled.pop, None)] == sent
        node.destroy_subscription(kept)
    node.destroy_node()
    rclpy.try_shutdown()
