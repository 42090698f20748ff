# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What nodes report of themselves: statuses in one form, and log lines of repeated failures."""

from collections.abc import Mapping
from weakref import WeakKeyDictionary

from crgame_ros.each_minute import EachMinute
from crgame_ros.messages.status_values import Status
from crgame_ros.ros.messages import to_time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.publisher import Publisher

_TOLD: WeakKeyDictionary[Node, EachMinute] = WeakKeyDictionary()


class Diagnostics:
    """
    The statuses of one node, stamped with simulation time.

    `hardware_id` is the full name of the publishing node, with its namespace.
    """

    def __init__(self, node: Node, publisher: Publisher) -> None:
        self.publisher = publisher
        self._hardware_id = node.get_fully_qualified_name()
        # Latest simulation time that the node has received [ns]; 0 means none, as in ROS.
        self.now_ns = 0

    def array_of(self, status: Status, stamp_ns: int | None = None) -> DiagnosticArray:
        """
        Build a message of one status.

        :param stamp_ns: simulation time of the status; the latest that the node has received where
            None [ns]
        """
        if stamp_ns is not None:
            self.now_ns = stamp_ns
        message = DiagnosticArray(status=[DiagnosticStatus(
            level=bytes([status.level]), name=status.name, message=status.text,
            hardware_id=self._hardware_id,
            values=[KeyValue(key=key, value=value) for key, value in status.values.items()])])
        message.header.stamp = to_time(self.now_ns)
        return message

    def publish(self, name: str, level: bytes, text: str, values: Mapping[str, object],
                stamp_ns: int | None = None) -> None:
        """
        Publish one status on `/diagnostics`.

        :param name: node and subject, `<node>: <subject>`.
        :param level: OK, WARN or ERROR.
        :param stamp_ns: as of `array_of`.
        """
        self.publish_status(Status.of(name, level[0], text, values), stamp_ns)

    def publish_status(self, status: Status, stamp_ns: int | None = None) -> None:
        """Publish one status on `/diagnostics`; parameters as of `array_of`."""
        self.publisher.publish(self.array_of(status, stamp_ns))


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
