# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Noticing that a simulation of another machine, or of another user, runs in our namespace."""

import time

from crgame_ros.errors import InputError
from crgame_ros.ros.endpoints import Endpoints
from rclpy.node import Node

# A simulation says how it goes once a second, whatever it does [s].
ALIVE_S = 6.0


def refuse_another(node: Node, until_s: float) -> None:
    """
    Check that no other simulation speaks here: two on the same topics would mix everything.

    On this machine a lock tells (`namespace_lock`); this is about other machines, and other users.

    :param node: in the namespace in question.
    :param until_s: how long others may take to be discovered, by the steady clock.
    :raises InputError: if one does.
    """
    endpoints = Endpoints(node)
    while time.monotonic() < until_s and not node.count_publishers('clock'):
        time.sleep(0.02)
    if not node.count_publishers('clock'):
        return
    # Who was killed a moment ago is still listed: whoever lives says so every second.
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
