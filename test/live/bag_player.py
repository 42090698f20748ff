# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plays a recording as `ros2 bag play` does: the same bytes, pace and QoS."""

from collections.abc import Collection
from pathlib import Path
import time

from crgame_ros.messages.contract import load_contract
from crgame_ros.recording.reader import BagReader
from crgame_ros.ros.endpoints import Endpoints
import rclpy
from rclpy.context import Context


class BagPlayer:
    """
    Publishes what was recorded of a game with hv0 and av0.

    :param bag: the recording.
    :param domain: of the graph that it is played to.
    :param without: topics that are not played: those that the listening nodes publish.
    """

    def __init__(self, bag: Path, domain: int, without: Collection[str]) -> None:
        with BagReader(bag) as reader:
            self._messages = [message for message in reader.messages()
                              if message.topic not in without]
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node('player', context=self._context)
        endpoints = Endpoints(self._node)
        names = {name: (topic.name, '' if topic.placeholder is None else name.split('/')[1])
                 for topic in load_contract().topics.values()
                 for name in topic.names(('hv0',), ('av0',))}
        self.publishers = {topic: endpoints.publisher(*names[topic])
                           for topic in {message.topic for message in self._messages}}

    @property
    def start_s(self) -> float:
        """When the run began to move, from the start of the recording [s]: after its documents."""
        cycle_ns = next(message.log_time_ns for message in self._messages
                        if message.topic == '/timing/cycle')
        return (cycle_ns - self._messages[0].log_time_ns) * 1e-9

    def play(self, start_offset_s: float = 0.0) -> None:
        """Publish all that was logged so long after the start of the recording, or later."""
        first_ns = self._messages[0].log_time_ns + round(start_offset_s * 1e9)
        begin_ns = time.monotonic_ns()
        for message in self._messages:
            if message.log_time_ns < first_ns:
                continue
            wait_ns = message.log_time_ns - first_ns - (time.monotonic_ns() - begin_ns)
            if wait_ns > 0:
                time.sleep(wait_ns * 1e-9)
            self.publishers[message.topic].publish(message.data)

    def close(self) -> None:
        """Leave the graph."""
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)
