# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the messages of a recording from MCAP files, or from SQLite or compressed files."""

from bisect import bisect_left
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.recording.mcap_file import McapFile, Segment
from crgame_ros.recording.metadata import BagTopic, parse_qos, TopicQos
from crgame_ros.recording.schemas import is_foreign
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader

_FOREVER_NS = 2 ** 64


class BagMessage(NamedTuple):
    """A recorded message: `data` is CDR with its header, the log time is in ns."""

    topic: str
    type_name: str
    log_time_ns: int
    data: bytes


class McapStorage:
    """
    The messages of the MCAP files of one recording, finished or not.

    :ivar topics: the recorded topics, in order of their names.
    :ivar start_ns: log time of the first message [ns], 0 without messages.
    :ivar end_ns: log time of the last message [ns], 0 without messages.
    :ivar damages: damage that does not prevent reading.

    :raises InputError: if a file is not an MCAP file, or a file without summary is damaged inside.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._files = [McapFile(path) for path in paths]
        self.damages = tuple(
            f'{file.path.name}: what it says of its content contradicts itself, so all of it was '
            'read; `crgame recover` mends it' if file.contradicts else
            f'{file.path.name} was not finished or is damaged ({file.useless_bytes} bytes are of '
            'no use); `crgame recover` finishes it'
            for file in self._files if not file.complete)
        tallies = [file.tally() for file in self._files]
        filled = [tally for tally in tallies if tally.counts]
        self.start_ns = min((tally.start_ns for tally in filled), default=0)
        self.end_ns = max((tally.end_ns for tally in filled), default=0)
        self.topics = merge_topics(
            BagTopic(channel.topic, _schema_name(file, channel.schema_id),
                     tally.counts.get(number, 0),
                     parse_qos(channel.metadata.get('offered_qos_profiles'),
                               f'{file.path}, {channel.topic}'),
                     channel.metadata.get('topic_type_hash', ''))
            for file, tally in zip(self._files, tallies, strict=True)
            for number, channel in file.channels.items())

    def messages(self, topics: Collection[str] | None, start_ns: int | None,
                 end_ns: int | None) -> Iterator[BagMessage]:
        """
        Yield the messages of these topics, or of all, in order of log time.

        Only the chunks that may hold them are read.

        :param start_ns: earliest log time [ns]; None for no limit.
        :param end_ns: log time before which to stop [ns]; None for no limit.
        """
        first_ns = 0 if start_ns is None else start_ns
        last_ns = _FOREVER_NS if end_ns is None else end_ns - 1
        for message in self._ordered(topics, first_ns, last_ns):
            if first_ns <= message.log_time_ns <= last_ns:
                yield message

    def _ordered(self, topics: Collection[str] | None, first_ns: int,
                 last_ns: int) -> Iterator[BagMessage]:
        order: list[tuple[McapFile, Segment]] = sorted(
            ((file, segment) for file in self._files for segment in file.segments
             if segment.start_ns <= last_ns and segment.end_ns >= first_ns),
            key=lambda pair: pair[1].start_ns)
        held: list[BagMessage] = []
        for file, segment in order:
            # Messages earlier than this segment's start are earlier than all that follow.
            ready = bisect_left(held, segment.start_ns, key=lambda message: message.log_time_ns)
            yield from held[:ready]
            held = held[ready:] + list(self._select(file, segment, topics))
            held.sort(key=lambda message: message.log_time_ns)
        yield from held

    @staticmethod
    def _select(file: McapFile, segment: Segment,
                topics: Collection[str] | None) -> Iterator[BagMessage]:
        others = set() if topics is None else {
            number for number, channel in file.channels.items() if channel.topic not in topics}
        if segment.channels is not None and segment.channels <= others:
            return
        names: dict[int, tuple[str, str]] = {}
        for number, _, log_time_ns, _, data in file.messages(segment, others):
            if number not in names:
                if number not in file.channels:
                    raise InputError(f'a message on the unknown channel {number}', str(file.path),
                                     'the file is damaged; record again')
                channel = file.channels[number]
                names[number] = (channel.topic, _schema_name(file, channel.schema_id))
            yield BagMessage(*names[number], log_time_ns, data)

    def definition(self, type_name: str) -> str:
        """Return the stored `ros2msg` definition of a type, empty where there is none."""
        for file in self._files:
            for schema in file.schemas.values():
                if schema.name == type_name and schema.encoding == 'ros2msg':
                    return schema.data.decode('utf-8', 'replace')
        return ''

    def close(self) -> None:
        """Do nothing: files are open only while a chunk is read."""


def _schema_name(file: McapFile, schema_id: int) -> str:
    return file.schemas[schema_id].name if schema_id in file.schemas else ''


def merge_topics(topics: Iterable[BagTopic]) -> tuple[BagTopic, ...]:
    """Join the channels of one topic: several publishers, or several files."""
    merged: dict[str, BagTopic] = {}
    for topic in topics:
        known = merged.get(topic.name, topic)
        if is_foreign(topic.name, known.type_name):
            # A foreign publisher may have been first on a topic; the contract's type counts.
            known = replace(known, type_name=topic.type_name, type_hash=topic.type_hash)
        count = topic.message_count + (known.message_count if topic.name in merged else 0)
        qos = tuple(dict.fromkeys(known.qos + topic.qos))
        merged[topic.name] = BagTopic(topic.name, known.type_name, count, qos, known.type_hash)
    return tuple(merged[name] for name in sorted(merged))


class RosbagsStorage:
    """
    The messages of SQLite recordings, or of recordings that rosbag2 compressed by file or message.

    Attributes and methods are those of `McapStorage`.

    :param path: the folder with its `metadata.yaml`, or a bare `.db3` file.
    :raises InputError: if it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.damages: tuple[str, ...] = ()
        with self._explained():
            self._reader = Reader(path)
            self._reader.open()
            self._connections = list(self._reader.connections)
            filled = self._reader.message_count > 0
            self.start_ns = self._reader.start_time if filled else 0
            # rosbags counts the end as the first instant after the last message.
            self.end_ns = self._reader.end_time - 1 if filled else 0
        self.topics = merge_topics(
            # Metadata may hold other types than text.
            BagTopic(str(connection.topic), str(connection.msgtype), connection.msgcount,
                     _qos_of(connection), str(connection.digest or ''))
            for connection in self._connections)

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except InputError:
            raise
        except Exception as error:  # rosbags raises whatever its code stumbles over
            raise InputError(f'cannot be read ({error or type(error).__name__})',
                             str(self._path), 'write its metadata.yaml again with '
                             '`crgame recover`, or check it with `ros2 bag info`') from error

    def messages(self, topics: Collection[str] | None, start_ns: int | None,
                 end_ns: int | None) -> Iterator[BagMessage]:
        """Yield the messages of these topics, or of all, in order of log time."""
        wanted = [c for c in self._connections if topics is None or c.topic in topics]
        if not wanted:
            return
        with self._explained():
            for connection, log_time_ns, data in self._reader.messages(wanted, start_ns,
                                                                       end_ns):
                yield BagMessage(str(connection.topic), str(connection.msgtype), log_time_ns,
                                 bytes(data))

    def definition(self, type_name: str) -> str:
        """Return the stored `ros2msg` definition of a type, empty where there is none."""
        return next((c.msgdef.data for c in self._connections
                     if c.msgtype == type_name and c.msgdef.format.name == 'MSG'), '')

    def close(self) -> None:
        """Close the database."""
        self._reader.close()


def _qos_of(connection: Connection) -> tuple[TopicQos, ...]:
    return tuple(TopicQos(qos.depth, qos.reliability.name.lower(), qos.durability.name.lower())
                 for qos in getattr(connection.ext, 'offered_qos_profiles', ()))
