# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes a recording: serialised messages, as they arrive, to MCAP in a rosbag2 folder."""

from collections.abc import Callable
from contextlib import suppress
import os
from pathlib import Path
from types import TracebackType
from typing import Any, cast, IO, Self

from crgame_ros.errors import InputError
from crgame_ros.recording.exceptions import RecordingError
from crgame_ros.recording.metadata import (
    BagFile,
    BagMetadata,
    BagTopic,
    METADATA_FILE,
    qos_text,
    TopicQos,
    write_metadata,
)
from crgame_ros.recording.schemas import type_schema
from mcap.writer import CompressionType, Writer

# A file is some 5 % larger than with 0.9 s.
FLUSH_INTERVAL_NS = 400_000_000
# The writer keeps an index of each chunk in memory. A chunk holds more than the busiest flush
# interval, so the index grows with the number of flushes, not of messages.
CHUNK_BYTES = 4 << 20
# Messages are read by then after their reception, if the recorder keeps up [ns].
RECENT_NS = 1_000_000_000
# The system clock has been set if it differs by more than this from where it was [ns].
SET_NS = 100_000_000


class _UnbufferedFile:
    """A file whose writes reach the operating system completely before they return."""

    def __init__(self, path: Path) -> None:
        self._file = path.open('xb', buffering=0)
        self._position = 0

    def write(self, data: bytes) -> int:
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest):]
        self._position += len(data)
        return len(data)

    def tell(self) -> int:
        return self._position

    def flush(self) -> None:
        """Do nothing: nothing is buffered."""

    def sync(self) -> None:
        os.fsync(self._file.fileno())

    def close(self) -> None:
        self._file.close()


class BagWriter:
    """
    Writes `<folder>/<folder name>_0.mcap` and, when closed, `<folder>/metadata.yaml`.

    The first message later than `FLUSH_INTERVAL_NS` after the previous flush causes the next one.
    A killed recorder therefore loses at most its last 0.4 s, if it also calls `flush_if_due` at
    intervals for the time without messages. An unfinished recording has no `metadata.yaml`. Not
    thread-safe.

    :param folder: created, with its parents; must not hold a recording of that name yet.
    :param now_ns: steady clock that decides when to flush [ns].
    :raises InputError: if the folder already holds a recording.
    :raises RecordingError: if the file cannot be created.
    """

    def __init__(self, folder: Path, *, now_ns: Callable[[], int]) -> None:
        self.folder = folder
        self.path = folder / f'{folder.resolve().name}_0.mcap'
        self.failed: RecordingError | None = None
        self.refused = 0
        self._now_ns = now_ns
        self._flushed_ns = now_ns()
        self._closed = False
        self._topics: dict[int, tuple[str, str, TopicQos]] = {}
        self._counts: dict[int, int] = {}
        self._schemas: dict[str, int] = {}
        self._start_ns = self._end_ns = 0
        self.message_count = 0
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if (folder / METADATA_FILE).exists():
                raise FileExistsError
            self._stream = _UnbufferedFile(self.path)
            self._mcap: Any = Writer(cast(IO[Any], self._stream), chunk_size=CHUNK_BYTES,
                                     compression=CompressionType.ZSTD)
            self._mcap.start('ros2')
        except FileExistsError as error:
            raise InputError('a recording is there already', str(self.path),
                             'choose another folder') from error
        except OSError as error:
            raise RecordingError(self.path, f'cannot record: {error.strerror}',
                                 'choose a folder that can be written') from error

    @property
    def bytes_written(self) -> int:
        """Return the size of the file so far [bytes]."""
        return self._stream.tell()

    def add_topic(self, name: str, type_name: str, qos: TopicQos) -> int:
        """
        Announce a topic before its first message.

        :param name: topic, such as `/clock`.
        :param type_name: such as `nav_msgs/msg/Odometry`.
        :param qos: the publisher's offer; a replay offers the same.
        :returns: the channel to write its messages to.
        :raises InputError: if it is no type of ROS 2 Jazzy.
        :raises RecordingError: if the recording has failed.
        """
        if self.failed is not None:
            raise self.failed
        definition, digest = type_schema(type_name)
        try:
            if type_name not in self._schemas:
                self._schemas[type_name] = self._mcap.register_schema(
                    type_name, 'ros2msg', definition.encode())
            channel: int = self._mcap.register_channel(
                name, 'cdr', self._schemas[type_name],
                {'offered_qos_profiles': qos_text([qos]), 'topic_type_hash': digest})
        except OSError as error:
            raise self._fail(error) from error
        self._topics[channel] = (name, type_name, qos)
        self._counts[channel] = 0
        return channel

    def write(self, channel: int, data: bytes, log_time_ns: int,
              publish_time_ns: int | None = None) -> None:
        """
        Store one message; after a failure, only count it in `refused`.

        :param channel: from `add_topic`.
        :param data: the message as serialised by the middleware (CDR with its header).
        :param log_time_ns: when it was received, not negative [ns].
        :param publish_time_ns: when it was sent, by default the same [ns].
        :raises RecordingError: if writing fails; raised once, and the recording then ends.
        """
        if self.failed is not None:
            self.refused += 1
            return
        if self._closed or log_time_ns < 0:
            raise ValueError('the writer is closed' if self._closed else 'negative time')
        sequence = self._counts[channel]
        # The clock of the sender may be wrong, and the file has no negative times.
        sent_ns = log_time_ns if publish_time_ns is None else max(0, publish_time_ns)
        if self.message_count == 0:
            self._start_ns = self._end_ns = log_time_ns
        self._start_ns = min(self._start_ns, log_time_ns)
        self._end_ns = max(self._end_ns, log_time_ns)
        self._counts[channel] = sequence + 1
        self.message_count += 1
        try:
            self._mcap.add_message(channel, log_time_ns, data, sent_ns, sequence)
        except OSError as error:
            raise self._fail(error) from error
        self.flush_if_due()

    def flush_if_due(self) -> None:
        """
        Flush if the last flush is more than `FLUSH_INTERVAL_NS` ago.

        :raises RecordingError: as `write`.
        """
        if self._now_ns() - self._flushed_ns >= FLUSH_INTERVAL_NS:
            self.flush()

    def flush(self) -> None:
        """
        Write every message so far to the operating system.

        :raises RecordingError: as `write`.
        """
        if self.failed is not None or self._closed:
            return
        self._flushed_ns = self._now_ns()
        try:
            self._mcap.flush()
        except OSError as error:
            raise self._fail(error) from error

    def close(self) -> None:
        """
        Finish the file and write `metadata.yaml`; do nothing after a failure or a second time.

        :raises RecordingError: as `write`.
        """
        if self.failed is not None or self._closed:
            return
        try:
            self._mcap.finish()
            # Metadata marks a complete recording, so the data must be on the disk before it.
            self._stream.sync()
            self._stream.close()
            write_metadata(self.folder, self._metadata())
        except OSError as error:
            raise self._fail(error) from error
        self._closed = True

    def _metadata(self) -> BagMetadata:
        topics = tuple(BagTopic(name, type_name, self._counts[channel], (qos,),
                                type_schema(type_name)[1])
                       for channel, (name, type_name, qos) in self._topics.items())
        file = BagFile(self.path.name, self._start_ns, self._end_ns, self.message_count)
        return BagMetadata('mcap', (file,), topics)

    def _fail(self, error: OSError) -> RecordingError:
        self.failed = RecordingError(
            self.path, f'recording stopped: {error.strerror}',
            'free some space; what was stored reads, and `crgame recover` finishes the file')
        # Closing a file on a failing disk may fail again; the first error is the one to report.
        with suppress(OSError):
            self._stream.close()
        return self.failed

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


class LogClock:
    """
    The times at which messages are logged, as if nobody had set the system clock.

    :param wall_ns: system time now [ns since 1970]
    :param steady_ns: the steady clock now [ns]
    """

    def __init__(self, wall_ns: int, steady_ns: int) -> None:
        self._begun_ns = wall_ns - steady_ns
        # By how much the system clock has been set since: now, and before it was set last.
        self._set_by_ns = self._before_ns = 0

    def now_ns(self, steady_ns: int) -> int:
        """Return the time now, as if nobody had set the system clock [ns since 1970]."""
        return self._begun_ns + steady_ns

    def times_ns(self, published_ns: int, received_ns: int, wall_ns: int,
                 steady_ns: int) -> tuple[int, int]:
        """
        Return the times of publication and reception that are to be logged [ns since 1970].

        :param wall_ns: system time now [ns since 1970]
        :param steady_ns: the steady clock now [ns]
        """
        now_ns = self.now_ns(steady_ns)
        # This process may be interrupted for a moment between two looks at clocks.
        if abs(wall_ns - now_ns - self._set_by_ns) > SET_NS:
            self._before_ns, self._set_by_ns = self._set_by_ns, wall_ns - now_ns
        set_by_ns = self._set_by_ns
        # A message that is read just after the clock was set was received before.
        if not self._is_recent(received_ns - set_by_ns, now_ns) \
                and self._is_recent(received_ns - self._before_ns, now_ns):
            set_by_ns = self._before_ns
        logged_ns = min(received_ns - set_by_ns, now_ns)
        return min(published_ns - set_by_ns, logged_ns), logged_ns

    @staticmethod
    def _is_recent(time_ns: int, now_ns: int) -> bool:
        return now_ns - RECENT_NS <= time_ns <= now_ns
