# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""recorder_node: the recording of each run's topics into one MCAP bag, as raw messages."""

from collections import deque
from dataclasses import dataclass
from functools import partial
import math
from pathlib import Path
import time

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.documents import GAME, GameDocument, RUN_STATE
from crgame_ros.messages.cdr import header_stamp_ns
from crgame_ros.messages.contract import load_contract, Topic
from crgame_ros.paths import numbered
from crgame_ros.recording.exceptions import RecordingError
from crgame_ros.recording.metadata import TopicQos
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_folder import BAG, next_part, run_folder
from crgame_ros.recording.standard_messages import standard_types
from crgame_ros.recording.writer import BagWriter, LogClock
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription, relative
from crgame_ros.ros.heard_topics import OFFSET, RECORDED
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.number_parameters import fixed
from crgame_ros.ros.run_time import GameAwaited, RunTime, TimeCourse
from crgame_ros.ros.spinning import poll
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

PERIOD_S = 0.01
REPORT_S = 1.0
# Ten seconds of the busiest topic fit into the queue, in case the disk stalls.
QUEUE_DEPTH = 2000
# After a run's end, the last messages of other nodes are recorded for this long [s].
DRAIN_S = 0.3
# A run whose clock moves on by this much after its end was not over [ns].
GOES_ON_NS = 200_000_000
# A simulation that is silent for this long has ended or stands still [s].
SILENCE_S = 2.0
CLOCK_TOPIC = '/clock'
# Simulation and epoch of no run.
NO_RUN = ('', -1)
# A run waits for its bag at most this long; until it starts, the bag is reported so often [s].
AWAITED_S, AGAIN_S = 10.0, 0.2


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
        """Return whether late joiners get the latest message."""
        return self.topic.qos.durability == 'transient_local'


class RecorderNode(Node):
    """The node that writes serialised messages as they come; it opens a bag for each new game."""

    def __init__(self) -> None:
        super().__init__('recorder_node')
        self._directory = Path(fixed(
            self, 'directory', BAG, 'folder of the bag; those of later runs have its name and '
            'are in run_2, run_3, … beside it'))
        # It takes a quarter of a second: now, while other nodes start, not at the first message.
        standard_types()
        self._endpoints = Endpoints(self)
        self._topics: dict[str, RecordedTopic] = {}
        self._writer: BagWriter | None = None
        # The run whose bag is open or was last, and the one whose end was heard last.
        self._offset_ns, self._run, self._ended_run = 0, NO_RUN, NO_RUN
        self._ended_s: float | None = None
        self._closed: dict[str, int] | None = None
        # Simulation time at which the bag was closed [ns].
        self._closed_ns = 0
        self._game_text = b''
        # Topics with a message in this bag, and whether all of them have been reported.
        self._recorded: set[str] = set()
        self._recorded_told, self._recorded_told_s = True, -math.inf
        self._begun_s = -math.inf
        # When a message on /clock has come, and when one that moved time on.
        self._heard_s = self._moved_s = -math.inf
        self._report_s = 0.0
        self._time = RunTime()
        # Messages whose run is not certain yet, and messages that came before any run.
        self._held: list[tuple[RecordedTopic, bytes, int, int]] | None = None
        self._early: deque[tuple[RecordedTopic, bytes, int, int]] = deque(maxlen=QUEUE_DEPTH)
        self._awaited = GameAwaited(self, 'nothing is recorded')
        self._log_clock = LogClock(time.time_ns(), time.monotonic_ns())
        self._subscribe((), ())

    def _subscribe(self, humans: tuple[str, ...], avs: tuple[str, ...]) -> None:
        for topic in load_contract().topics.values():
            if not topic.record:
                continue
            for name in topic.names(humans, avs):
                if name in self._topics:
                    continue
                vehicle = '' if topic.placeholder is None else name.split('/')[1]
                slot = self._endpoints.polled(topic.name, vehicle, verify=True,
                                              depth=max(QUEUE_DEPTH, topic.qos.depth))
                self._topics[name] = RecordedTopic(topic, name, slot)

    def run(self, stop: StopFlag) -> None:
        """Record until asked to stop, then finish the file."""
        try:
            poll(self, stop, PERIOD_S, self._work)
        finally:
            self._close()

    def _work(self) -> None:
        # A new game comes after the last message of the previous run. The first message of its own
        # run comes once this node has opened a bag for it. So data are read first, then documents.
        if self._writer is not None:
            for recorded in list(self._topics.values()):
                if not recorded.latched:
                    self._write_waiting(recorded)
        else:
            self._write_waiting(self._topics[CLOCK_TOPIC])
        # The game is read last, so that a new bag begins with the documents that belong to it.
        latched = [recorded for recorded in self._topics.values() if recorded.latched]
        for recorded in sorted(latched, key=lambda item: item.name == GAME.topic):
            self._write_waiting(recorded)
        if self._writer is not None:
            try:
                self._writer.flush_if_due()
            except RecordingError as error:
                self._report_failure(error)
            self._close_at_end()
        if not self._recorded_told or self._is_awaited:
            self._publish_recorded()
        if time.monotonic() - self._report_s > REPORT_S:
            self._report_s = time.monotonic()
            self._report(self._writer)

    def _close_at_end(self) -> None:
        """Close the bag some time after the end of the run, unless the run goes on."""
        if self._ended_s is None:
            return
        # If others speak of runs, only a silent clock proves the end, even on a busy machine.
        drain_s = SILENCE_S if self._several_publish(RUN_STATE.topic) else DRAIN_S
        if time.monotonic() - self._ended_s <= drain_s:
            return
        if self._moved_s - self._ended_s > 0.5 * DRAIN_S:
            # The last cycles come just after the end; these come later.
            self._ended_s = None
            self._endpoints.refusals.note(
                RUN_STATE.topic, f'{RUN_STATE.topic}: the end of a run that goes on')
            return
        self._close()

    @property
    def _is_awaited(self) -> bool:
        """Return whether the simulation may wait for the bag, and is to be told of it again."""
        now_s = time.monotonic()
        return self._writer is not None and now_s - self._begun_s < AWAITED_S \
            and now_s - self._recorded_told_s > AGAIN_S \
            and self._endpoints.diagnostics.now_ns <= self._offset_ns

    def _publish_recorded(self) -> None:
        """Publish the topics whose messages arrive: a run begins when those of all nodes do."""
        self._recorded_told, self._recorded_told_s = True, time.monotonic()
        self._publish_status(DiagnosticStatus.OK, RECORDED, {
            OFFSET: self._offset_ns, **dict.fromkeys(sorted(self._recorded), 1)}, RECORDED)

    def _report(self, writer: BagWriter | None) -> None:
        """Publish the progress of the recording, or that it is complete."""
        if writer is None:
            if self._closed is not None:
                self._publish_status(DiagnosticStatus.OK, 'recorded', self._closed)
            return
        failed = writer.failed is not None
        self._publish_status(
            DiagnosticStatus.ERROR if failed else DiagnosticStatus.OK,
            str(writer.failed) if failed else f'recording into {writer.folder.name}',
            {'messages': writer.message_count, 'bytes': writer.bytes_written})

    def _publish_status(self, level: bytes, text: str, values: dict[str, int],
                        subject: str = 'recording') -> None:
        self._endpoints.diagnostics.publish(f'recorder_node: {subject}', level, text, values)

    def _write_waiting(self, recorded: RecordedTopic) -> None:
        for data, published_ns, received_ns in recorded.slot.waiting_timed():
            published_ns, received_ns = self._log_clock.times_ns(
                published_ns, received_ns, time.time_ns(), time.monotonic_ns())
            if recorded.latched:
                before, recorded.latest = recorded.latest, (data, published_ns, received_ns)
                if recorded.name == GAME.topic and data != self._game_text:
                    self._begin_bag(data)
                    if data != self._game_text:
                        # Refused: a later part begins with the game of the run.
                        recorded.latest = before
                    continue
                if recorded.name == RUN_STATE.topic:
                    self._note_end(data)
            elif recorded.name == CLOCK_TOPIC:
                self._heard_s = time.monotonic()
                stamp_ns = header_stamp_ns(data)
                if stamp_ns > self._endpoints.diagnostics.now_ns:
                    self._moved_s = self._heard_s
                self._endpoints.diagnostics.now_ns = stamp_ns
                self._follow(stamp_ns)
            self._write(recorded, data, published_ns, received_ns)

    def _follow(self, clock_ns: int) -> None:
        """Open another bag where time has run back: a recording is played again."""
        self._awaited.check(bool(self._game_text), True)
        course = self._time.follow(clock_ns)
        if course is TimeCourse.BEHIND:
            # Held until its run is certain.
            self._held = [] if self._held is None else self._held
            return
        held, self._held = self._held or [], None
        if course is TimeCourse.BACK and self._several_publish(CLOCK_TOPIC):
            self._endpoints.refusals.note(
                CLOCK_TOPIC, f'{CLOCK_TOPIC}: earlier times by another program')
        elif course is TimeCourse.BACK and self._game_text:
            self.get_logger().info('simulation time has jumped back: recording another run')
            self._ended_s = time.monotonic()
            self._begin_bag(self._game_text, again=True)
        elif course is TimeCourse.ON and self._writer is None and self._closed is not None \
                and clock_ns > self._closed_ns + GOES_ON_NS:
            self.get_logger().warning('the run goes on after its end: recording another part')
            self._ended_run = NO_RUN
            self._begin_bag(self._game_text)
        for item in held:
            self._write(*item)

    def _several_publish(self, topic: str) -> bool:
        """Return whether not only the simulation, or a player of recordings, publishes it."""
        return self.count_publishers(relative(topic)) > 1

    def _note_end(self, data: bytes) -> None:
        """Note the end of the run; a late message may report that of the previous run."""
        try:
            state = RUN_STATE.read(deserialize_message(data, String).data)
        except InputError as error:
            self._endpoints.refusals.note(RUN_STATE.topic, str(error))
            return
        run = state.simulation, state.epoch
        if state.state != 'ended':
            if run == self._ended_run:
                # A recording is played again.
                self._ended_run, self._ended_s = NO_RUN, None
            return
        self._ended_run = run
        if self._ended_s is None and run == self._run:
            # Of the clock, only what comes after this tells that the run goes on.
            self._write_waiting(self._topics[CLOCK_TOPIC])
            self._ended_s = time.monotonic()

    def _begin_bag(self, game_data: bytes, again: bool = False) -> None:
        """
        Open the bag of a new game, and write every latched message received so far.

        :param again: whether the same run is played once more.
        """
        try:
            # Parsed before the bag is closed: an invalid game must not end the recording.
            game = GAME.read(deserialize_message(game_data, String).data)
            offset_ns = game.scheduler.clock_offset_ns
            if self._goes_on and (offset_ns <= self._offset_ns
                                  or self._several_publish(GAME.topic)):
                self._endpoints.refusals.note(
                    GAME.topic, f'{GAME.topic}: another game of a run that goes on')
                return
            self._close()
            self._game_text, self._run = game_data, (game.simulation, game.epoch)
            # Set before the first cycle, so that reports on this recording do not count to the
            # previous run.
            self._endpoints.diagnostics.now_ns = offset_ns
            self._subscribe(tuple(item.id for item in game.humans),
                            tuple(item.id for item in game.avs))
            # Set before, too: a bag that cannot be made is not tried again with each clock.
            self._closed = None
            self._writer = BagWriter(self._folder_of(game, again), now_ns=time.monotonic_ns)
            # This node may come after the end; a recording may also be played again.
            over = self._run == self._ended_run and not again
            self._offset_ns, self._ended_s = offset_ns, time.monotonic() if over else None
            self._time = RunTime()
            self._recorded.clear()
            self._begun_s = time.monotonic()
            for recorded in self._topics.values():
                qos = recorded.topic.qos
                recorded.channel = self._writer.add_topic(
                    recorded.name, recorded.topic.type_name,
                    TopicQos(qos.depth, qos.reliability, qos.durability))
            self.get_logger().info(f'recording into {self._writer.folder}')
            now_ns = self._log_clock.now_ns(time.monotonic_ns())
            for recorded in self._topics.values():
                if recorded.latest is not None:
                    self._write(recorded, recorded.latest[0], recorded.latest[1], now_ns)
            while self._early:
                self._write(*self._early.popleft())
        except CrgameError as error:
            self._report_failure(error)

    @property
    def _goes_on(self) -> bool:
        """Return whether a run is being recorded and its simulation is still publishing."""
        return self._writer is not None and self._ended_s is None \
            and time.monotonic() - self._heard_s < SILENCE_S

    def _folder_of(self, game: GameDocument, again: bool) -> Path:
        """
        Return the bag's folder: a part of an earlier one that holds the beginning of the same run.

        The recorder may have been started again; a restarted simulation counts its runs from the
        first again.
        """
        wanted = run_folder(self._directory.parent, game.epoch) / self._directory.name
        for folder in numbered(wanted):
            if not folder.exists():
                break
            if game.simulation and not again and _simulation_in(folder) in (game.simulation, None):
                return next_part(folder)
        return folder

    def _write(self, recorded: RecordedTopic, data: bytes, published_ns: int,
               received_ns: int) -> None:
        if self._held is not None:
            self._held.append((recorded, data, published_ns, received_ns))
            return
        if self._writer is None and recorded.name == CLOCK_TOPIC:
            # Received early; it belongs to the next bag.
            self._early.append((recorded, data, published_ns, received_ns))
        if self._writer is None or self._writer.failed is not None:
            return
        try:
            self._writer.write(recorded.channel, data, received_ns, published_ns)
            if recorded.name not in self._recorded:
                self._recorded.add(recorded.name)
                self._recorded_told = False
        except RecordingError as error:
            self._report_failure(error)

    def _report_failure(self, error: CrgameError) -> None:
        """Report that recording has failed; the run goes on."""
        self.get_logger().error(str(error))
        self._publish_status(DiagnosticStatus.ERROR, str(error), {})

    def _close(self) -> None:
        if self._writer is None:
            return
        writer, self._writer = self._writer, None
        self._closed_ns = self._endpoints.diagnostics.now_ns
        try:
            writer.close()
        except RecordingError as error:
            self._report_failure(error)
            return
        if writer.failed is None:
            self._closed = {'messages': writer.message_count, 'bytes': writer.bytes_written,
                            'closed': True}
            self._report(None)
            self.get_logger().info(f'{writer.message_count} messages in {writer.folder}')


def _simulation_in(bag: Path) -> str | None:
    """Return the simulation whose run is in a bag; None if it has not come that far."""
    try:
        with BagReader(bag) as reader:
            for _, game in reader.documents(GAME):
                return game.simulation
    except InputError:
        pass
    return None


main = partial(run_node, RecorderNode)

if __name__ == '__main__':
    main()
