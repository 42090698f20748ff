# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the streams of other instruments from a recording, on the run's clock."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
import math
from pathlib import Path
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.instruments.run_clock import clock_drift, corrected_s, run_times_s
from crgame_ros.messages.instrument_samples import (
    InstrumentStream,
    read_samples,
    SAMPLES_TOPIC,
    STREAMS,
    TEXTS,
    TIME_COLUMNS,
)
from crgame_ros.recording.epochs import read_epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_cycles import cycle_tables, table_of
from crgame_ros.timing.cycle_rows import CYCLE_TOPIC
import numpy as np
from numpy.typing import NDArray

# The list of streams is recorded at most so much later than a stream's first sample [ns].
_LATE_NS = 1_000_000_000
_CONNECTION, _SENT, _OFFSET, _UNCERTAINTY = range(len(TIME_COLUMNS) - 1)

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class RecordedStream:
    """
    The samples of a stream during a run, in the order of their arrival.

    :param id: its name, with the id of its device where another stream has the same name.
    :param stream: its description.
    :param times_s: (R) on the run's clock; NaN where LSL has not measured the sender's clock [s]
    :param steady_s: (R) on the steady clock of the machine that recorded [s]
    :param sent_s: (R) as stamped, on the sender's clock [s]
    :param uncertainty_s: (R) of the relation of these two clocks [s]
    :param values: (R, C) numbers; (R, 0) of a stream of texts.
    :param texts: of each sample, by channel; empty of a stream of numbers.
    :param drift: of the sender's clock against this machine's [s/s]; NaN if it is not known.
    """

    id: str  # noqa: A003
    stream: InstrumentStream
    times_s: FloatArray
    steady_s: FloatArray
    sent_s: FloatArray
    uncertainty_s: FloatArray
    values: FloatArray
    texts: tuple[tuple[str, ...], ...]
    drift: float


class _Batch(NamedTuple):
    """Samples of a message: as in `TIME_COLUMNS`, and numbers or texts."""

    times: FloatArray
    values: FloatArray
    texts: tuple[tuple[str, ...], ...]


class _Lists:
    """The recorded lists of streams, with their log times [ns]."""

    def __init__(self, reader: BagReader) -> None:
        self._found: list[tuple[int, dict[int, InstrumentStream]]] = [
            (log_ns, {stream.number: stream for stream in document.streams})
            for log_ns, document in reader.documents(STREAMS)]

    def of(self, number: int, log_ns: int) -> InstrumentStream | None:
        """Return the stream of a message; a node that was started again numbers anew."""
        known = [(at_ns, streams[number]) for at_ns, streams in self._found if number in streams]
        before = [stream for at_ns, stream in known if at_ns <= log_ns + _LATE_NS]
        return before[-1] if before else known[0][1] if known else None

    def last(self, key: tuple[str, ...]) -> InstrumentStream:
        """Return the newest description of a stream."""
        return next(stream for _, streams in reversed(self._found)
                    for stream in streams.values() if _key(stream) == key)


def read_streams(path: Path, epoch: int | None = None) -> tuple[RecordedStream, ...]:
    """
    Read the streams of one run; empty without any, or if no cycle tells the steady clock.

    Samples from before the run's start and after its end are kept.

    :param epoch: which run, where a recording holds several; None for the last.
    :raises InputError: if there is no such run in it.
    """
    with BagReader(path, parts=True) as reader:
        if not reader.holds(STREAMS.topic) or CYCLE_TOPIC not in reader.topics:
            return ()
        game = read_epoch(reader, epoch).game
        starts, from_s, until_s = _clock(reader, game.epoch)
        if not len(starts):
            return ()
        lists = _Lists(reader)
        batches: dict[tuple[str, ...], list[_Batch]] = defaultdict(list)
        for stream, batch in _batches(reader, lists):
            last = lists.last(_key(stream))
            # Of one that came back with other channels, only the samples of these are one table.
            if (stream.channels, _has_texts(stream)) == (last.channels, _has_texts(last)):
                batches[_key(stream)].append(batch)
    found = []
    names = [key[0] for key in batches]
    for key, parts in batches.items():
        stream = lists.last(key)
        recorded = _joined(stream, parts, starts, game.scheduler.dt_s, names.count(key[0]) > 1)
        found.append(_within(recorded, from_s, until_s))
    return tuple(recorded for recorded in found if len(recorded.sent_s))


def _key(stream: InstrumentStream) -> tuple[str, ...]:
    return stream.name, stream.type, stream.source_id, stream.host


def _has_texts(stream: InstrumentStream) -> bool:
    return stream.format == 'string'


def _clock(reader: BagReader, epoch: int) -> tuple[FloatArray, float, float]:
    """Return the starts of a run's cycles, and between which times no other run was [s]."""
    tables = cycle_tables(reader)
    starts = table_of(tables, epoch, reader).steady_rows()
    from_s, until_s = -math.inf, math.inf
    for table in tables if len(starts) else ():
        others_s = table.steady_rows()[:, 1]
        if table.epoch == epoch or not len(others_s):
            continue
        if others_s[-1] < starts[0, 1]:
            from_s = max(from_s, others_s[-1])
        elif others_s[0] > starts[-1, 1]:
            until_s = min(until_s, others_s[0])
    return starts, from_s, until_s


def _batches(reader: BagReader, lists: _Lists) -> Iterator[tuple[InstrumentStream, _Batch]]:
    """Yield the samples of streams that are listed; others are of foreign publishers."""
    for topic, _, log_ns, message in reader.readable([SAMPLES_TOPIC, TEXTS.topic]):
        try:
            if topic == SAMPLES_TOPIC:
                samples = read_samples(message.layout.dim[1].label, message.data)
                if samples is None:
                    continue
                number, batch = samples.stream, _Batch(samples.times, samples.values, ())
                width = samples.values.shape[1]
            else:
                texts = TEXTS.read(str(message.data))
                if not texts.rows:
                    continue
                number, batch = texts.stream, _Batch(
                    np.array(texts.rows, dtype=np.float64), np.empty((len(texts.rows), 0)),
                    texts.texts)
                width = len(texts.texts[0])
        except (InputError, IndexError):
            reader.foreign[topic] += 1
            continue
        stream = lists.of(number, log_ns)
        if stream is not None and width == len(stream.channels) \
                and _has_texts(stream) == (topic == TEXTS.topic):
            yield stream, batch


def _joined(stream: InstrumentStream, parts: list[_Batch], starts: FloatArray, dt_s: float,
            named_twice: bool) -> RecordedStream:
    times = np.concatenate([part.times for part in parts])
    connections = times[:, _CONNECTION].astype(np.int64)
    sent_s, offsets_s = times[:, _SENT], times[:, _OFFSET]
    steady_s = corrected_s(connections, sent_s, offsets_s)
    return RecordedStream(
        f'{stream.name} ({stream.source_id})' if named_twice else stream.name, stream,
        run_times_s(steady_s, starts, dt_s), steady_s, sent_s, times[:, _UNCERTAINTY],
        np.concatenate([part.values for part in parts]),
        tuple(row for part in parts for row in part.texts),
        clock_drift(connections, sent_s, offsets_s))


def _within(recorded: RecordedStream, from_s: float, until_s: float) -> RecordedStream:
    """Return the samples that belong to no other run; those without a time belong to all."""
    steady_s = recorded.steady_s
    mine = ~((steady_s <= from_s) | (steady_s >= until_s))
    if mine.all():
        return recorded
    return RecordedStream(
        recorded.id, recorded.stream, recorded.times_s[mine], steady_s[mine],
        recorded.sent_s[mine], recorded.uncertainty_s[mine], recorded.values[mine],
        tuple(row for row, kept in zip(recorded.texts, mine.tolist(), strict=True) if kept)
        if recorded.texts else (), recorded.drift)
