# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Log lines of nodes about what fails again and again."""

from weakref import WeakKeyDictionary

from crgame_ros.each_minute import EachMinute
from rclpy.node import Node

_TOLD: WeakKeyDictionary[Node, EachMinute] = WeakKeyDictionary()


def complain(node: Node, kind: str, text: str, *, failed: bool = False) -> None:
    """
    Log a failure, at most once a minute for each kind of a node's failures.

    :param kind: as of `EachMinute.line`.
    :param failed: log an error instead of a warning.
    """
    line = _TOLD.setdefault(node, EachMinute()).line(kind, text)
    if line is None:
        return
    # rclpy wants one severity for each line of code that logs.
    if failed:
        node.get_logger().error(line)
    else:
        node.get_logger().warning(line)
