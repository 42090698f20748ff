# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Detection of a simulation of another machine or user in the same namespace."""

import time

from crgame_ros.errors import InputError
from crgame_ros.ros.endpoints import Endpoints
from rclpy.node import Node

# Time to wait for a simulation's state, which is published every second [s].
ALIVE_S = 6.0


def refuse_another(node: Node, until_s: float) -> None:
    """
    Check that no other simulation publishes here: two on the same topics would mix.

    On this machine a lock ensures that (`namespace_lock`); this check covers other machines and
    users.

    :param node: in the namespace in question.
    :param until_s: until when others may be discovered, on the steady clock.
    :raises InputError: if another one publishes.
    """
    endpoints = Endpoints(node)
    while time.monotonic() < until_s and not node.count_publishers('clock'):
        time.sleep(0.02)
    if not node.count_publishers('clock'):
        return
    # A process killed a moment ago is still listed; a live one publishes every second.
    heard = endpoints.polled('/diagnostics')
    until_s = time.monotonic() + ALIVE_S
    while time.monotonic() < until_s:
        message = heard.pop()
        statuses = [] if message is None else message.status
        if any(item.name == 'sim_node: run' for item in statuses):
            raise InputError(
                f'another simulation runs in namespace {node.get_namespace()} of this ROS domain',
                'sim_node', 'end it, or start this one in a namespace (--namespace, '
                '-r __ns:=/exp2) or with another ROS_DOMAIN_ID')
        if message is None:
            time.sleep(0.01)
    endpoints.release(heard)
