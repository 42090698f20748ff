# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two processes that exchange messages, for `crgame doctor` to check DDS on this machine."""

import json
import statistics
import sys
import time

from crgame_ros.ros.environment import listening_beyond_loopback, prepare_environment

PROBE_TOPIC = 'crgame_doctor'
PROBE_MESSAGES = 20
DISCOVERY_TIMEOUT_S = 15.0


def talk() -> None:
    """Publish the steady clock's time until terminated: the other process of the exchange."""
    import rclpy
    from std_msgs.msg import Int64

    rclpy.init()
    node = rclpy.create_node('crgame_doctor_talker')
    publisher = node.create_publisher(Int64, PROBE_TOPIC, 1)
    deadline = time.monotonic() + DISCOVERY_TIMEOUT_S
    while rclpy.ok() and time.monotonic() < deadline:
        publisher.publish(Int64(data=time.monotonic_ns()))
        time.sleep(0.02)
    node.destroy_node()
    rclpy.try_shutdown()


def listen() -> None:
    """Print as JSON when the first message came, the median delay and the open ports."""
    import rclpy
    from std_msgs.msg import Int64

    rclpy.init()
    started_ns = time.monotonic_ns()
    node = rclpy.create_node('crgame_doctor_listener')
    sent_ns, received_ns = [], []

    def receive(message: Int64) -> None:
        received_ns.append(time.monotonic_ns())
        sent_ns.append(message.data)

    node.create_subscription(Int64, PROBE_TOPIC, receive, 1)
    while (len(sent_ns) < PROBE_MESSAGES
           and time.monotonic_ns() - started_ns < DISCOVERY_TIMEOUT_S * 1e9):
        rclpy.spin_once(node, timeout_sec=0.1)
    beyond = listening_beyond_loopback()
    node.destroy_node()
    rclpy.try_shutdown()
    if len(sent_ns) < PROBE_MESSAGES:
        sys.exit(f'{len(sent_ns)} messages from another process in {DISCOVERY_TIMEOUT_S:.0f} s')
    delays_us = [(end - start) * 1e-3 for start, end in zip(sent_ns, received_ns, strict=True)]
    print(json.dumps({'first_s': (received_ns[0] - started_ns) * 1e-9,
                      'median_us': statistics.median(delays_us), 'beyond_loopback': beyond}))


def main() -> None:
    """Run one of the two, as the command line says: talk or listen."""
    prepare_environment()
    {'talk': talk, 'listen': listen}[sys.argv[1]]()


if __name__ == '__main__':
    main()
