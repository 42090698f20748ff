# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Log lines about what fails again and again: one line a minute for each kind."""

import time
from weakref import WeakKeyDictionary

from rclpy.node import Node

# Time between two lines about one kind of failure [s].
PERIOD_S = 60.0
# Kinds with lines of their own; senders can make up any number of kinds.
MOST_KINDS = 50
OTHERS = 'others'

# Of each node and kind: the time of the last line [s], and the failures since then.
_TOLD: WeakKeyDictionary[Node, dict[str, tuple[float, int]]] = WeakKeyDictionary()


def complain(node: Node, kind: str, text: str, *, failed: bool = False) -> None:
    """
    Log a failure, unless one of its kind was logged within the last minute; the next line counts.

    :param kind: what these failures have in common, as the place where they happen.
    :param failed: log an error instead of a warning.
    """
    told = _TOLD.setdefault(node, {})
    if kind not in told and len(told) >= MOST_KINDS:
        kind = OTHERS
    now_s = time.monotonic()
    since_s, more = told.get(kind, (-PERIOD_S, 0))
    if now_s - since_s < PERIOD_S:
        told[kind] = since_s, more + 1
        return
    told[kind] = now_s, 0
    line = f'{text} ({more} more since the last such line)' if more else text
    # rclpy wants one severity for each line of code that logs.
    if failed:
        node.get_logger().error(line)
    else:
        node.get_logger().warning(line)
