# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The index of a replay: one run's messages by simulation step, and its outline for plots."""

from array import array
from collections.abc import Callable, Iterable
from dataclasses import dataclass
import math
import struct

from crgame_ros.cockpit import frames
from crgame_ros.cockpit.message_frames import state_rows
from crgame_ros.cockpit.replay_tracks import RunTracks, TrackCollector
from crgame_ros.errors import InputError
from crgame_ros.game.documents import GameDocument
from crgame_ros.messages.cdr import header_stamp_ns
from crgame_ros.messages.joints import OBJECT_STATES_TOPIC, VEHICLES_TOPIC, WorldMessages
from crgame_ros.recording.epochs import Epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.standard_messages import TRAJECTORY
from crgame_ros.recording.storage import BagMessage
from crgame_ros.timing.cycle_rows import CYCLE_TOPIC, CycleTable
import numpy as np
from numpy.typing import NDArray

OCCUPANCY_TOPIC = '/occupancy'
# Number of messages between two reports of progress, so that reporting costs little.
_REPORT_EVERY = 500

IntArray = NDArray[np.int64]
# As the page keeps samples of a live run: 0.05 s apart, more if the recording is long.
SPACING_S = 0.05
MOST_SAMPLES = 24_000
_LENGTH = struct.Struct('<I')

FloatArray = NDArray[np.float64]


class Outline:
    """
    A sample of state and command every `stride` steps, in little memory.

    :param duration_s: of the whole recording [s]
    :ivar stride: simulation steps between two samples.
    """

    def __init__(self, run: Epoch, duration_s: float) -> None:
        self._run = run
        dt_s = run.game.scheduler.dt_s
        self.stride = max(1, round(SPACING_S / dt_s),
                          math.ceil(duration_s / dt_s / MOST_SAMPLES))
        self._world = WorldMessages(run.descriptions)
        self._states: dict[int, FloatArray] = {}
        self._commands: dict[int, FloatArray] = {}

    def wants(self, n: int) -> bool:
        """Return whether the state of a step is a sample."""
        return n % self.stride == 0

    def add_state(self, n: int, content: object) -> None:
        """
        Add a decoded message of `/vehicles/state`.

        :raises InputError: if it is another run's.
        """
        self._states[n] = self._world.vehicle_states(content)

    def add_commands(self, table: CycleTable) -> None:
        """Add the commands consumed in some cycles."""
        steps = table.column('n').astype(int)
        if (steps % self.stride == 0).any():
            for n, commands in zip(steps.tolist(), table.commands_of(self._world.vehicles),
                                   strict=True):
                if self.wants(n):
                    self._commands[n] = commands

    def encoded(self) -> bytes:
        """Return the samples as STATE frames, each after its length in bytes."""
        game = self._run.game
        return pack(frames.encode_state(
            frames.Place(game.epoch, n, game.scheduler.k(n), n * game.scheduler.dt_s),
            state_rows(states, self._commands.get(n))) for n, states in self._states.items())


def pack(frames_in_order: Iterable[bytes]) -> bytes:
    """Join frames, each after its length in bytes (little-endian, 32 bit)."""
    return b''.join(part for frame in frames_in_order
                    for part in (_LENGTH.pack(len(frame)), frame))


def perception_topics(game: GameDocument) -> dict[str, str]:
    """Return the types of the perception topics and of the map's topic, by topic name."""
    topics = {OCCUPANCY_TOPIC: 'nav_msgs/msg/OccupancyGrid'}
    for av in game.avs:
        if av.perception is not None:
            topics[f'/{av.id}/localization'] = 'nav_msgs/msg/Odometry'
            topics[f'/{av.id}/scan'] = 'sensor_msgs/msg/LaserScan'
    return topics


class Places:
    """The messages of a topic: their log times [ns], and steps of their first and last rows."""

    def __init__(self) -> None:
        self._log_ns, self._first, self._last = array('q'), array('q'), array('q')

    def add(self, log_ns: int, first: int, last: int | None = None) -> None:
        """Add one message."""
        self._log_ns.append(log_ns)
        self._first.append(first)
        self._last.append(first if last is None else last)

    def __len__(self) -> int:
        return len(self._log_ns)

    @property
    def newest(self) -> int:
        """Return the step of the message that was added last, -1 if there is none."""
        return self._last[-1] if self._last else -1

    @property
    def steps(self) -> IntArray:
        """Return the step of each message."""
        return np.array(self._first, dtype=np.int64)

    def span(self, low: int, high: int) -> tuple[int, int] | None:
        """Return the first and last log time of messages with low <= n < high; None if none."""
        if not self._log_ns:
            return None
        first, last = np.frombuffer(self._first, np.int64), np.frombuffer(self._last, np.int64)
        found = np.flatnonzero((last >= low) & (first < high))
        if not len(found):
            return None
        return self._log_ns[int(found[0])], self._log_ns[int(found[-1])]

    def before(self, step: int) -> int | None:
        """Return the log time of the last message of a step before this one; None if none."""
        found = np.flatnonzero(self.steps < step)
        return self._log_ns[int(found[-1])] if len(found) else None


@dataclass(frozen=True)
class RunIndex:
    """
    The index of one run of a recording, which allows reading in any order.

    :param run: its documents.
    :param places: messages by topic.
    :param tracks: its documents and marks over time.
    :param outline: the vehicles' motion over the whole run, for plots.
    """

    run: Epoch
    places: dict[str, Places]
    tracks: RunTracks
    outline: Outline

    @property
    def first_n(self) -> int:
        """Return the step of the first recorded state."""
        return int(self.places[VEHICLES_TOPIC].steps[0])

    @property
    def last_n(self) -> int:
        """Return the step of the last recorded state."""
        return self.places[VEHICLES_TOPIC].newest


def index_run(reader: BagReader, run: Epoch,
              progress: Callable[[float], None] | None = None) -> RunIndex:
    """
    Read a recording once and return its index, without keeping its states.

    :param progress: called now and then with the share that is done, 0 to 1.
    :raises InputError: if no state of the run is in it.
    """
    indexer = _Indexer(reader, run)
    span_ns = max(reader.end_ns - reader.start_ns, 1)
    for count, message in enumerate(reader.messages(indexer.topics)):
        try:
            indexer.add(message)
        except InputError:
            # A malformed message is skipped and does not end the replay.
            reader.foreign[message.topic] += 1
        if progress is not None and count % _REPORT_EVERY == 0:
            progress((message.log_time_ns - reader.start_ns) / span_ns)
    return indexer.finish()


class _Indexer:
    """A builder of the index that follows a recording in the order of log time."""

    def __init__(self, reader: BagReader, run: Epoch) -> None:
        self._reader = reader
        self._run = run
        avs = [av.id for av in run.game.avs]
        perceived = perception_topics(run.game)
        self._stamped = {OBJECT_STATES_TOPIC, *(f'/{av}/plan_request' for av in avs), *perceived}
        self._plans = {f'/{av}/plan' for av in avs}
        self._types = perceived
        self._states = Places()
        self._places = {topic: Places() for topic in (CYCLE_TOPIC, *self._stamped, *self._plans)}
        self._places[VEHICLES_TOPIC] = self._states
        self._collector = TrackCollector(run.game)
        self._outline = Outline(run, reader.duration_s)
        self._inside = self._after = False
        self.topics = (*self._places, *self._collector.topics)

    def add(self, message: BagMessage) -> None:
        topic, type_name, log_ns, data = message
        if topic == CYCLE_TOPIC:
            self._add_cycles(message)
        elif topic not in self._places:
            if not self._after:
                self._collector.add(self._reader.decode(message),
                                    self._states.newest if self._inside else None)
        elif type_name != self._types.get(topic, TRAJECTORY):
            self._reader.foreign[topic] += 1
        elif topic == OCCUPANCY_TOPIC:
            # Its stamp is not simulation time: it is shown from its arrival.
            from_ns = self._run.from_log_ns
            if not self._after and (from_ns is None or log_ns >= from_ns):
                self._places[topic].add(log_ns, self._states.newest)
        else:
            self._add_stamped(message, header_stamp_ns(data))

    def _add_stamped(self, message: BagMessage, stamp_ns: int) -> None:
        topic, log_ns = message.topic, message.log_time_ns
        if not self._run.holds(stamp_ns, log_ns):
            # States of another run: messages without a stamp belong to that run from here on.
            self._after = self._after or (topic == VEHICLES_TOPIC and self._inside)
            return
        n = self._run.game.scheduler.step_of_stamp(stamp_ns)
        places = self._places[topic]
        if topic == VEHICLES_TOPIC:
            self._inside = True
            if n > places.newest:
                places.add(log_ns, n)
                if self._outline.wants(n):
                    self._outline.add_state(n, self._reader.decode(message).message)
        elif topic in self._plans:
            # A plan is shown from the step at which it arrived.
            places.add(log_ns, max(n, self._states.newest))
        else:
            places.add(log_ns, n)

    def _add_cycles(self, message: BagMessage) -> None:
        content = self._reader.decode(message).message
        if self._after or len(content.layout.dim) != 2:
            return
        table = CycleTable.from_message(content.layout.dim[1].label, content.data)
        if not table.is_of(self._run.game.epoch):
            return
        steps = table.column('n')
        places = self._places[CYCLE_TOPIC]
        if self._run.from_log_ns is not None and message.log_time_ns < self._run.from_log_ns:
            return
        places.add(message.log_time_ns, int(steps[0]), int(steps[-1]))
        self._collector.add_resets(steps, table.column('resets'))
        self._outline.add_commands(table)

    def finish(self) -> RunIndex:
        if not len(self._states):
            raise InputError('no state of the run is in it', str(self._reader.path),
                             'record from before the start of the run')
        return RunIndex(self._run, self._places, self._collector.finish(self._states.steps),
                        self._outline)
