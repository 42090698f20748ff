# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Chunks of a recorded run, as the frames that a live page would have been sent."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

from crgame_ros.cockpit.frames import Place
from crgame_ros.cockpit.message_frames import Frame, MessageFrames
from crgame_ros.cockpit.replay_index import OCCUPANCY_TOPIC, pack, perception_topics, RunIndex
from crgame_ros.errors import InputError
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.joints import OBJECT_STATES_TOPIC, VEHICLES_TOPIC
from crgame_ros.recording.reader import BagReader, DecodedMessage
from crgame_ros.recording.run_cycles import CYCLE_TOPIC
from crgame_ros.timing.cycle_rows import CycleTable
import numpy as np
from numpy.typing import NDArray

CHUNK_S = 5.0
# How far before a chunk the last scan of each sensor is searched for [ns].
CARRIED_NS = 1_000_000_000
# Objects and predictions of a step precede its state; plans that arrived in it follow.
_BEFORE, _STATE, _AFTER = range(3)

FloatArray = NDArray[np.float64]


class _Entry(NamedTuple):
    """A frame with its sort key in the chunk."""

    n: int
    order: int
    sequence: int
    frame: bytes


class ChunkBuilder:
    """
    A builder of chunks of `chunk_s` from the first recorded state on.

    A chunk begins with the frames in force before it (objects, predictions, plans), so that it
    can be shown without the chunk before. Its other frames are in the order of arrival.

    :ivar chunk_s: length of a chunk [s]: whole scenario steps, about 5 s.
    :ivar count: number of chunks.
    """

    def __init__(self, reader: BagReader, index: RunIndex) -> None:
        self._reader = reader
        self._index = index
        run = index.run
        self._epoch = run.game.epoch
        self._scheduler = scheduler = run.game.scheduler
        ticks = max(1, round(CHUNK_S / scheduler.time_step_s))
        self._steps = ticks * scheduler.steps_per_tick
        self.chunk_s = self._steps * scheduler.dt_s
        self.count = (index.last_n - index.first_n) // self._steps + 1
        self._vehicles = run.vehicle_ids
        self._frames = MessageFrames(run.game, run.descriptions)
        avs = [av.id for av in run.game.avs]
        self._plans = {f'/{av}/plan' for av in avs}
        self._scans = {f'/{av}/scan' for av in self._frames.mounts.avs}
        # Functions that make frames of each topic's messages, in the order of carrying over.
        self._makers: dict[str, Callable[[Place, object], list[Frame | None]]] = {
            OBJECT_STATES_TOPIC: _single(self._frames.objects)}
        for av in avs:
            self._makers[f'/{av}/plan_request'] = partial(self._planner_view, av)
        for av in avs:
            self._makers[f'/{av}/plan'] = _single(self._frames.plan, av)
        for topic in perception_topics(run.game):
            kind = topic.rpartition('/')[2]
            make = {'occupancy': _single(self._frames.occupancy),
                    'localization': _single(self._frames.estimate, topic.split('/')[1]),
                    'scan': _single(self._frames.scan, topic.split('/')[1])}
            self._makers[topic] = make[kind]

    def build(self, number: int) -> bytes:
        """
        Return one chunk: frames, each after its length in bytes (little-endian, 32 bit).

        :param number: 0 to `count` - 1.
        :raises InputError: if there is no such chunk, or the recording is damaged in it.
        """
        if not 0 <= number < self.count:
            raise InputError(f'no chunk {number} in it', str(self._reader.path),
                             f'there are {self.count}')
        low = self._index.first_n + number * self._steps
        entries = [*self._carried(low), *self._within(low, low + self._steps)]
        entries.sort(key=lambda entry: entry[:3])
        return pack(entry.frame for entry in entries)

    def _carried(self, low: int) -> Iterator[_Entry]:
        """Yield the frames in force before step `low`."""
        self._frames.forget()
        for topic in self._makers:
            log_ns = self._index.places[topic].before(low)
            if log_ns is None:
                continue
            if topic in self._scans:
                yield from self._carried_scans(topic, log_ns, low)
                continue
            for message in self._reader.readable([topic], log_ns, log_ns + 1):
                if topic == OCCUPANCY_TOPIC \
                        or self._index.run.holds(stamp_of(message.message), log_ns):
                    for frame in self._frames_of(message, low):
                        yield _Entry(low, _BEFORE, -1, frame)

    def _carried_scans(self, topic: str, last_ns: int, low: int) -> Iterator[_Entry]:
        """Yield the last scan of each sensor of a topic, which the sensors share."""
        newest: dict[str, bytes] = {}
        for message in self._reader.readable([VEHICLES_TOPIC, topic], last_ns - CARRIED_NS,
                                             last_ns + 1):
            content = message.message
            if not self._index.run.holds(stamp_of(content), message.log_time_ns):
                continue
            if message.topic == VEHICLES_TOPIC:
                self._states_of(content)
            else:
                for frame in self._frames_of(message, low):
                    newest[str(content.header.frame_id)] = frame
        for frame in newest.values():
            yield _Entry(low, _BEFORE, -1, frame)

    def _states_of(self, content: object) -> FloatArray | None:
        """Return the states of the vehicles; None if the message is malformed."""
        try:
            return self._frames.states(content)
        except InputError:
            return None

    def _within(self, low: int, high: int) -> list[_Entry]:
        """Read the frames from step `low` up to, not including, step `high`."""
        spans = [span for topic, places in self._index.places.items()
                 if (span := places.span(low, high)) is not None]
        if not spans:
            return []
        from_ns, to_ns = min(span[0] for span in spans), max(span[1] for span in spans)
        found: list[_Entry] = []
        states: list[tuple[int, int, FloatArray]] = []
        commands: dict[int, FloatArray] = {}
        newest = self._step_before(low)
        run, scheduler = self._index.run, self._scheduler
        for message in self._reader.readable(self._index.places, from_ns, to_ns + 1):
            topic, _, log_ns, content = message
            if topic == CYCLE_TOPIC:
                self._read_commands(content, commands)
                continue
            if topic == OCCUPANCY_TOPIC:
                if low <= newest < high:
                    found += [_Entry(newest, _AFTER, len(found), frame)
                              for frame in self._frames_of(message, newest)]
                continue
            stamp_ns = stamp_of(content)
            if not run.holds(stamp_ns, log_ns):
                continue
            n = scheduler.step_of_stamp(stamp_ns)
            if topic == VEHICLES_TOPIC:
                if n <= newest:
                    continue
                rows = self._states_of(content)
                if rows is None:
                    continue
                newest = n
                if low <= n < high:
                    states.append((n, len(states), rows))
            else:
                seen = max(n, newest) if topic in self._plans else n
                for frame in self._frames_of(message, n) if low <= seen < high else ():
                    found.append(_Entry(seen, _AFTER if topic in self._plans else _BEFORE,
                                        len(found), frame))
        found += [_Entry(n, _STATE, number, self._frames.state(
            self._frames.place(n), rows, commands.get(n)).data) for n, number, rows in states]
        return found

    def _step_before(self, low: int) -> int:
        """Return the step of the state before step `low`, -1 if there is none."""
        steps = self._index.places[VEHICLES_TOPIC].steps
        place = int(np.searchsorted(steps, low))
        return int(steps[place - 1]) if place else -1

    def _read_commands(self, content: Any, commands: dict[int, FloatArray]) -> None:
        """Read the commands that each vehicle consumed, by step: (V, 4); none if malformed."""
        if len(content.layout.dim) != 2:
            return
        try:
            table = CycleTable.from_message(content.layout.dim[1].label, content.data)
        except InputError:
            return
        if table.is_of(self._epoch):
            commands.update(zip(table.column('n').astype(int).tolist(),
                                table.commands_of(self._vehicles), strict=True))

    def _frames_of(self, message: DecodedMessage, n: int) -> list[bytes]:
        """
        Return the frames of a message; none if it is malformed.

        A malformed message must not keep the rest of the run from being shown.

        :param n: the step from which a map is shown; all else is shown at its stamp.
        """
        topic, content = message.topic, message.message
        place = self._frames.place(n) if topic == OCCUPANCY_TOPIC \
            else self._frames.place_of(content)
        try:
            made = [] if place is None else self._makers[topic](place, content)
        except InputError:
            return []
        return [frame.data for frame in made if frame is not None]

    def _planner_view(self, av: str, place: Place, content: object) -> list[Frame | None]:
        """Return the frames of a request to an AV's planner."""
        return [self._frames.prediction(place, av, content),
                self._frames.seen(place, av, content)]


def _single(make: Callable[..., Frame | None],
            *av: str) -> Callable[[Place, object], list[Frame | None]]:
    """Return a function that makes at most one frame of a message, optionally for a given AV."""
    return lambda place, content: [make(place, *av, content)]
