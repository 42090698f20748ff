# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loops of nodes: with an executor, or polling."""

from collections.abc import Callable
import time

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from crgame_ros.ros.node_main import StopFlag

# A waiting executor doesn't see a signal: look at the flag so often [s].
LOOK_S = 0.1


def spin(node: Node, stop: StopFlag) -> None:
    """Run a node's callbacks until asked to stop."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not stop.requested:
        executor.spin_once(timeout_sec=LOOK_S)
    executor.remove_node(node)


def poll(node: Node, stop: StopFlag, period_s: float, work: Callable[[], None]) -> None:
    """
    Call `work` periodically until asked to stop, and once more then.

    Parameters and services of the node are served now and then.

    :param period_s: pause between two calls [s]
    """
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    served_s = time.monotonic()
    while not stop.requested:
        work()
        if time.monotonic() - served_s > LOOK_S:
            executor.spin_once(timeout_sec=0)
            served_s = time.monotonic()
        time.sleep(period_s)
    work()
    executor.remove_node(node)
