# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading recordings: our own, those of `ros2 bag record`, and what a killed recorder left."""

from collections import deque
from collections.abc import Collection, Iterator
from pathlib import Path
import struct
from types import TracebackType
from typing import Any, Literal, NamedTuple, Self

from rosbags.serde import SerdeError
from rosbags.typesys import get_types_from_msg, get_typestore, Stores, TypesysError

from crgame_ros.errors import InputError
from crgame_ros.recording.metadata import METADATA_FILE, read_metadata
from crgame_ros.recording.storage import BagMessage, McapStorage, RosbagsStorage, Storage

_HEADER_BYTES = 4
_NS_PER_S = 1_000_000_000
_BIG_ENDIAN, _LITTLE_ENDIAN = b'\x00\x00', b'\x00\x01'
_SUFFIXES = {'.mcap': 'mcap', '.db3': 'sqlite3'}


class DecodedMessage(NamedTuple):
    """
    A recorded message with its content.

    `message` has the attributes of the ROS message (sequences of numbers are numpy arrays, times
    have `sec` and `nanosec`); the log time is in ns.
    """

    topic: str
    type_name: str
    log_time_ns: int
    message: Any


class BagReader:
    """
    A recording, opened for reading.

    :param path: a folder (with `metadata.yaml`, or with a single file), a `.mcap` or `.db3` file.
    :ivar files: the files that hold the messages.
    :ivar storage: `mcap` or `sqlite3`.
    :ivar topics: what was recorded, by name.
    :ivar start_ns: log time of the first message [ns], 0 in an empty recording.
    :ivar end_ns: log time of the last message [ns], 0 in an empty recording.
    :ivar notices: what is wrong with the recording although it can be read.
    :raises InputError: if there is no recording or it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        notices: tuple[str, ...] = ()
        if not path.exists():
            raise InputError('no such file or folder', str(path), 'give a recording')
        if path.is_dir() and (path / METADATA_FILE).is_file():
            self.files, self.storage, compressed = _listed_files(path)
        else:
            self.files, self.storage, compressed = (_single_file(path),), '', False
            self.storage = _SUFFIXES[self.files[0].suffix]
            if path.is_dir():
                notices = (f'{METADATA_FILE} is missing; `crgame recover` writes it',)
        self._storage: Storage
        if self.storage == 'mcap' and not compressed:
            self._storage = McapStorage(self.files)
        else:
            bare = not (path / METADATA_FILE).is_file()
            self._storage = RosbagsStorage(self.files[0] if bare else path)
        self.topics = {topic.name: topic for topic in self._storage.topics}
        self.start_ns, self.end_ns = self._storage.start_ns, self._storage.end_ns
        self.notices = self._storage.damages + notices
        self._types = get_typestore(Stores.ROS2_JAZZY)

    @property
    def complete(self) -> bool:
        """Return whether the recorder finished its work; see `notices` where not."""
        return not self.notices

    @property
    def message_count(self) -> int:
        """Return the number of messages of all topics."""
        return sum(topic.message_count for topic in self.topics.values())

    def messages(self, topics: Collection[str] | None = None, start_ns: int | None = None,
                 end_ns: int | None = None) -> Iterator[BagMessage]:
        """
        Yield the messages as they were serialised, in the order of their log time.

        :param topics: only these; names that were not recorded yield nothing. None for all.
        :param start_ns: none that was logged earlier [ns]; None for no limit.
        :param end_ns: none that was logged then or later [ns]; None for no limit.
        :raises InputError: if the recording is damaged inside.
        """
        return self._storage.messages(None if topics is None else frozenset(topics), start_ns,
                                      end_ns)

    def decoded(self, topics: Collection[str] | None = None, start_ns: int | None = None,
                end_ns: int | None = None) -> Iterator[DecodedMessage]:
        """
        Yield the messages with their content, in the order of their log time.

        :param topics: as in `messages`, like the limits.
        :raises InputError: as `messages`, or if a message does not fit its type.
        """
        for message in self.messages(topics, start_ns, end_ns):
            yield self.decode(message)

    def decode(self, message: BagMessage) -> DecodedMessage:
        """
        Give a message with its content.

        :raises InputError: if it does not fit its type.
        """
        topic, type_name, log_time_ns, data = message
        return DecodedMessage(topic, type_name, log_time_ns,
                              self._deserialize(topic, type_name, data))

    def latched(self, topic: str) -> DecodedMessage | None:
        """
        Return the last message of a topic, which a late subscriber of a latched one would get.

        :raises InputError: as `decoded`.
        """
        newest = deque(self.messages([topic]), maxlen=1)
        for message in newest:
            return self.decode(message)
        return None

    def _deserialize(self, topic: str, type_name: str, data: bytes) -> Any:
        try:
            if type_name not in self._types.fielddefs:
                self._learn(topic, type_name)
            codec = self._types.get_msgdef(type_name)
            decode = {_BIG_ENDIAN: codec.deserialize_cdr_be,
                      _LITTLE_ENDIAN: codec.deserialize_cdr_le}[data[:2]]
            message, end = decode(data[_HEADER_BYTES:], 0, codec.cls, self._types)
            # The middleware may reserve more than a message needs; the rest means nothing.
            if end + _HEADER_BYTES > len(data):
                raise ValueError(f'it needs {end + _HEADER_BYTES} bytes and has {len(data)}')
            return message
        except (SerdeError, TypesysError, struct.error, ValueError, LookupError) as error:
            raise InputError(f'a message of {topic} is no {type_name} ({error})', str(self.path),
                             'the recording is damaged; record again') from error

    def _learn(self, topic: str, type_name: str) -> None:
        """Take the definition of a type that is none of the standard ones from the recording."""
        definition = self._storage.definition(type_name)
        if not definition:
            raise InputError(f'{topic} has the type {type_name}, which is not known and which the '
                             'recording does not define', str(self.path),
                             'leave this topic out, or record in MCAP storage')
        found = get_types_from_msg(definition, type_name)
        self._types.register({name: fields for name, fields in found.items()
                              if name not in self._types.fielddefs})

    def close(self) -> None:
        """Let go of the files."""
        self._storage.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


def header_stamp_ns(data: bytes) -> int:
    """
    Give the stamp of a serialised message that begins with a std_msgs/Header [ns].

    :param data: CDR with its header.
    """
    order: Literal['big', 'little'] = 'big' if data[:2] == _BIG_ENDIAN else 'little'
    seconds = int.from_bytes(data[_HEADER_BYTES:_HEADER_BYTES + 4], order, signed=True)
    return seconds * _NS_PER_S + int.from_bytes(data[_HEADER_BYTES + 4:_HEADER_BYTES + 8], order)


def _listed_files(folder: Path) -> tuple[tuple[Path, ...], str, bool]:
    """Return the files that the metadata of a folder names, their storage, if compressed."""
    metadata = read_metadata(folder)
    where = str(folder / METADATA_FILE)
    if metadata.storage not in _SUFFIXES.values():
        raise InputError(f'unknown storage {metadata.storage!r}', where,
                         'convert it with `ros2 bag convert` to mcap or sqlite3')
    if not metadata.files:
        raise InputError('it names no files', where, 'write it again with `crgame recover`')
    paths = tuple(folder / file.name for file in metadata.files)
    for path in paths:
        if not path.is_file():
            raise InputError('the file is missing', str(path),
                             f'{METADATA_FILE} names it: put it back, or recover what is there')
    return paths, metadata.storage, metadata.compression_mode in ('file', 'message')


def _single_file(path: Path) -> Path:
    """Return the file to read where there is no metadata."""
    if path.is_file():
        candidates = [path]
    else:
        candidates = sorted(p for p in path.iterdir() if p.is_file() and p.suffix in _SUFFIXES)
        if not candidates:
            raise InputError('no recording in this folder', str(path),
                             'give the folder that holds a .mcap or .db3 file')
    if len(candidates) > 1:
        raise InputError(f'{len(candidates)} files but no {METADATA_FILE}', str(path),
                         'name one of the files, or write it with `ros2 bag reindex`')
    if candidates[0].suffix not in _SUFFIXES:
        raise InputError('not a recording', str(path), 'give a folder, a .mcap or a .db3 file')
    return candidates[0]
