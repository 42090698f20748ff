# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loops of nodes: with an executor, or polling."""

from collections.abc import Callable, Iterator
from pathlib import Path
import time
import traceback

from crgame_ros.ros.diagnostics import complain
from crgame_ros.ros.endpoints import PolledGroup
from crgame_ros.ros.node_main import StopFlag
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.subscription import Subscription

# A waiting executor does not notice a signal: the flag is polled at this period [s].
LOOK_S = 0.1


class PromptNode(Node):
    """A node for `spin_promptly`, which may still poll some of its subscriptions."""

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """Yield what an executor may run: one that knows no groups would run polled ones, too."""
        for subscription in super().subscriptions:
            if not isinstance(subscription.callback_group, PolledGroup):
                yield subscription


def attempt(node: Node, work: Callable[[], None]) -> None:
    """
    Do a piece of work, and log one line a minute if it fails.

    An unforeseen error in a received message must cost only that message, not the node.
    """
    try:
        work()
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f'{Path(last.filename).name}:{last.lineno}'
        complain(node, place, f'{type(error).__name__} at {place}: {error}'[:500], failed=True)


def serve(node: Node, executor: Executor, timeout_s: float) -> None:
    """
    Run the next callback of a node, if there is one or one comes in time.

    A callback that fails costs only its own request.

    :param timeout_s: longest wait [s]
    """
    attempt(node, lambda: executor.spin_once(timeout_sec=timeout_s))


def spin(node: Node, stop: StopFlag) -> None:
    """Run a node's callbacks until asked to stop."""
    _spin(node, stop, SingleThreadedExecutor())


def spin_promptly(node: PromptNode, stop: StopFlag) -> None:
    """
    Run each callback of a node as soon as its message has come, until asked to stop.

    rclpy's events executor costs 70 µs per message, the ordinary one 260 µs. It knows no callback
    groups, so it is for PromptNodes alone. An older rclpy without it uses the ordinary one.
    """
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        spin(node, stop)
    else:
        _spin(node, stop, EventsExecutor())


def _spin(node: Node, stop: StopFlag, executor: Executor) -> None:
    executor.add_node(node)
    while not stop.requested:
        serve(node, executor, LOOK_S)
    executor.remove_node(node)


def poll(node: Node, stop: StopFlag, period_s: float, work: Callable[[], None]) -> None:
    """
    Call `work` periodically until asked to stop, and once more then.

    Parameters and services of the node are served at intervals.

    :param period_s: pause between two calls [s]
    """
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    served_s = time.monotonic()
    while not stop.requested:
        attempt(node, work)
        if time.monotonic() - served_s > LOOK_S:
            serve(node, executor, 0.0)
            served_s = time.monotonic()
        time.sleep(period_s)
    attempt(node, work)
    executor.remove_node(node)
