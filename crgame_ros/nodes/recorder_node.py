# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""recorder_node: every recorded topic of the contract, raw, into MCAP; one bag a run."""

from dataclasses import dataclass
from pathlib import Path
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from crgame_ros.errors import CrgameError
from crgame_ros.recording.exceptions import RecordingError
from crgame_ros.recording.metadata import TopicQos
from crgame_ros.recording.run_folder import run_folder
from crgame_ros.recording.writer import BagWriter
from crgame_ros.ros.contract import load_contract, Topic
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.ros.messages import from_time
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.spinning import poll
from crgame_ros.simulation.documents import GAME_TOPIC, parse_game_document

PERIOD_S = 0.01
REPORT_S = 1.0
# Ten seconds of the busiest topic fit into the queue, should the disk stall.
QUEUE_DEPTH = 2000
DIAGNOSTICS_TOPIC = '/diagnostics'
# After a run has ended, what the others said last is taken in [s].
DRAIN_S = 0.3


@dataclass
class RecordedTopic:
    """One subscribed topic, its place in the bag and, if latched, its latest message."""

    topic: Topic
    name: str
    slot: PolledSubscription
    channel: int = -1
    latest: tuple[bytes, int, int] | None = None

    @property
    def latched(self) -> bool:
        """Whether late joiners get the latest message."""
        return self.topic.qos.durability == 'transient_local'


class RecorderNode(Node):
    """Takes serialised messages as they come; opens a new bag with each new game."""

    def __init__(self) -> None:
        super().__init__('recorder_node')
        self._directory = Path(self.declare_parameter(
            'directory', 'bag', ParameterDescriptor(
                description='folder of the bag; those of later runs have its name and are in '
                'run_2, run_3, … beside it',
                read_only=True)).value)
        self._endpoints = Endpoints(self)
        self._diagnostics = self._endpoints.publisher('/diagnostics')
        self._topics: dict[str, RecordedTopic] = {}
        self._writer: BagWriter | None = None
        self._offset_ns = 0
        self._ended_s: float | None = None
        self._closed: dict[str, int] | None = None
        self._game_text = b''
        self._report_s = 0.0
        self._subscribe((), ())

    def _subscribe(self, humans: tuple[str, ...], avs: tuple[str, ...]) -> None:
        for topic in load_contract().topics.values():
            if not topic.record:
                continue
            for name in topic.names(humans, avs):
                if name in self._topics:
                    continue
                vehicle = '' if topic.placeholder is None else name.split('/')[1]
                slot = self._endpoints.polled(topic.name, vehicle, raw=True,
                                              depth=max(QUEUE_DEPTH, topic.qos.depth))
                self._topics[name] = RecordedTopic(topic, name, slot)

    def run(self, stop: StopFlag) -> None:
        """Record until asked to stop, then finish the file."""
        try:
            poll(self, stop, PERIOD_S, self._work)
        finally:
            self._close()

    def _work(self) -> None:
        # A new game comes after the last message of the run before it, and well before the first
        # message of its own run: data first, then documents.
        if self._writer is not None:
            for recorded in list(self._topics.values()):
                if not recorded.latched:
                    self._take(recorded)
        # The game comes last of them: a new bag then begins with the documents that belong to it.
        latched = [recorded for recorded in self._topics.values() if recorded.latched]
        for recorded in sorted(latched, key=lambda item: item.name == GAME_TOPIC):
            self._take(recorded)
        if self._writer is not None:
            try:
                self._writer.flush_if_due()
            except RecordingError as error:
                self._tell(error)
            if self._ended_s is not None and time.monotonic() - self._ended_s > DRAIN_S:
                self._close()
        if time.monotonic() - self._report_s > REPORT_S:
            self._report_s = time.monotonic()
            self._report(self._writer)

    def _report(self, writer: BagWriter | None) -> None:
        """Tell how the recording is going, or that it is done."""
        if writer is None:
            if self._closed is not None:
                self._publish_status(DiagnosticStatus.OK, 'recorded', self._closed)
            return
        failed = writer.failed is not None
        self._publish_status(
            DiagnosticStatus.ERROR if failed else DiagnosticStatus.OK,
            str(writer.failed) if failed else f'recording into {writer.folder.name}',
            {'messages': writer.message_count, 'bytes': writer.bytes_written})

    def _publish_status(self, level: bytes, text: str, values: dict[str, int]) -> None:
        status = DiagnosticStatus(level=level, name='recorder_node: recording', message=text)
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        self._diagnostics.publish(DiagnosticArray(status=[status]))

    def _take(self, recorded: RecordedTopic) -> None:
        while (taken := recorded.slot.take_timed()) is not None:
            data, published_ns, received_ns = taken
            if recorded.latched:
                recorded.latest = (data, published_ns, received_ns)
                if recorded.name == GAME_TOPIC and data != self._game_text:
                    self._begin_bag(data)
                    continue
            elif recorded.name == DIAGNOSTICS_TOPIC and b'sim_node: run' in data \
                    and b'ended' in data:
                self._take_end(data)
            self._write(recorded, data, published_ns, received_ns)

    def _take_end(self, data: bytes) -> None:
        """Note that the run has ended; an end that is told late may be that of the run before."""
        message: DiagnosticArray = deserialize_message(data, DiagnosticArray)
        if self._ended_s is None and from_time(message.header.stamp) >= self._offset_ns \
                and any(item.name == 'sim_node: run' and item.message == 'ended'
                        for item in message.status):
            self._ended_s = time.monotonic()

    def _begin_bag(self, game_data: bytes) -> None:
        """Open the bag of a new game, with every latched message that is already there."""
        self._game_text = game_data
        try:
            # Before the bag is closed: what is no game must not end its recording.
            game = parse_game_document(deserialize_message(game_data, String).data)
            self._close()
            self._subscribe(tuple(entry['id'] for entry in game.humans),
                            tuple(entry['id'] for entry in game.avs))
            self._writer = BagWriter(self._folder_of(game.epoch), now_ns=time.monotonic_ns)
            self._offset_ns, self._ended_s = game.scheduler.clock_offset_ns, None
            self._closed = None
            for recorded in self._topics.values():
                qos = recorded.topic.qos
                recorded.channel = self._writer.add_topic(
                    recorded.name, recorded.topic.type_name,
                    TopicQos(qos.depth, qos.reliability, qos.durability))
            self.get_logger().info(f'recording into {self._writer.folder}')
            now_ns = time.time_ns()
            for recorded in self._topics.values():
                if recorded.latest is not None:
                    self._write(recorded, recorded.latest[0], recorded.latest[1], now_ns)
        except CrgameError as error:
            self._tell(error)

    def _folder_of(self, epoch: int) -> Path:
        """Choose a folder; a simulation that was started again begins with the first run anew."""
        folder = wanted = run_folder(self._directory.parent, epoch) / self._directory.name
        number = 1
        while folder.exists():
            number += 1
            folder = wanted.with_name(f'{wanted.name}_{number}')
        return folder

    def _write(self, recorded: RecordedTopic, data: bytes, published_ns: int,
               received_ns: int) -> None:
        if self._writer is None or self._writer.failed is not None:
            return
        try:
            self._writer.write(recorded.channel, data, received_ns, published_ns)
        except RecordingError as error:
            self._tell(error)

    def _tell(self, error: CrgameError) -> None:
        """Say that recording has failed; driving goes on."""
        self.get_logger().error(str(error))
        self._publish_status(DiagnosticStatus.ERROR, str(error), {})

    def _close(self) -> None:
        if self._writer is None:
            return
        writer, self._writer = self._writer, None
        try:
            writer.close()
        except RecordingError as error:
            self._tell(error)
            return
        if writer.failed is None:
            self._closed = {'messages': writer.message_count, 'bytes': writer.bytes_written,
                            'closed': True}
            self._report(None)
            self.get_logger().info(f'{writer.message_count} messages in {writer.folder}')


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(RecorderNode, args)


if __name__ == '__main__':
    main()
