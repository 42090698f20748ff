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


def test_a_flood_does_not_hold_up_who_reads_it() -> None:
    """What comes while the waiting messages are read is read the next time."""
    depth = 3
    with Peer(own_domain_id()) as reader:
        polled = Endpoints(reader.node).polled('/trigger', depth=depth)
        publisher = reader.publisher('/trigger')

        def send(text: str) -> None:
            publisher.publish(String(data=text))
            assert publisher.wait_for_all_acked()

        send('0')
        read: list[str] = []
        for message in polled.waiting():
            read.append(message.data)
            send(str(len(read)))
            assert len(read) <= depth
        assert read == ['0', '1', '2'] and polled.latest().data == '3'
