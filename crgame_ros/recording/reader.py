# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads recordings: our own, those of `ros2 bag record`, and those of killed recorders."""

from collections import Counter, deque
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
import struct
from types import TracebackType
from typing import Any, NamedTuple, Self, TypeVar

from crgame_ros.errors import InputError
from crgame_ros.messages.cdr import BIG_ENDIAN, HEADER_BYTES, LITTLE_ENDIAN
from crgame_ros.recording.mcap_file import McapFile
from crgame_ros.recording.metadata import METADATA_FILE, read_metadata
from crgame_ros.recording.run_folder import parts_of
from crgame_ros.recording.schemas import is_foreign
from crgame_ros.recording.standard_messages import standard_types
from crgame_ros.recording.storage import BagMessage, McapStorage, RosbagsStorage
from crgame_ros.schema.json_documents import JsonDocument
from rosbags.serde import SerdeError
from rosbags.typesys import get_types_from_msg, get_typestore, Stores, TypesysError

T = TypeVar('T')

_WATCHED_EVERY = 1000
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
    :param parts: also read the folders in which a restarted recorder continued.
    :param progress: called at intervals with the share that has been read, 0 to 1.
    :ivar files: the files that hold the messages.
    :ivar storage: `mcap` or `sqlite3`.
    :ivar topics: the recorded topics, by name.
    :ivar start_ns: log time of the first message [ns], 0 in an empty recording.
    :ivar end_ns: log time of the last message [ns], 0 in an empty recording.
    :ivar notices: damage of the recording that does not prevent reading.
    :raises InputError: if there is no recording or it cannot be read.
    """

    def __init__(self, path: Path, parts: bool = False,
                 progress: Callable[[float], object] | None = None) -> None:
        self.path = path
        self._progress = progress
        notices: tuple[str, ...] = ()
        if not path.exists():
            raise InputError('no such file or folder', str(path), 'give a recording')
        family = parts_of(path) if parts and path.is_dir() else [path]
        if len(family) > 1:
            self.files, notices = _files_of(family)
            self.storage, compressed = 'mcap', False
        elif path.is_dir() and (path / METADATA_FILE).is_file():
            self.files, self.storage, compressed = _listed_files(path)
        else:
            self.files, self.storage, compressed = (_single_file(path),), '', False
            self.storage = _SUFFIXES[self.files[0].suffix]
            if path.is_dir():
                notices = (f'{METADATA_FILE} is missing; `crgame recover` writes it',)
        self._storage: McapStorage | RosbagsStorage
        if self.storage == 'mcap' and not compressed:
            self._storage = McapStorage(self.files)
        else:
            bare = not (path / METADATA_FILE).is_file()
            self._storage = RosbagsStorage(self.files[0] if bare else path)
        self.topics = {topic.name: topic for topic in self._storage.topics}
        self.start_ns, self.end_ns = self._storage.start_ns, self._storage.end_ns
        self.notices = self._storage.damages + notices
        self._types = standard_types()
        # Count by topic of messages that cannot belong to a run.
        self.foreign: Counter[str] = Counter()

    @property
    def complete(self) -> bool:
        """Return whether the recorder finished its work; if not, see `notices`."""
        return not self.notices

    @property
    def has_virtual_clock(self) -> bool:
        """Return whether its log times are those of the simulation: it is of an offline run."""
        return self.start_ns == 0 and self.message_count > 0

    @property
    def foreign_notices(self) -> tuple[str, ...]:
        """Return a line per topic on the messages so far that cannot belong to a run."""
        return tuple(f'{count} messages of {topic} are not of this run: left out'
                     for topic, count in sorted(self.foreign.items()))

    @property
    def message_count(self) -> int:
        """Return the number of messages of all topics."""
        return sum(topic.message_count for topic in self.topics.values())

    @property
    def duration_s(self) -> float:
        """Return the time from the first to the last message [s]."""
        return (self.end_ns - self.start_ns) / 1e9

    def holds(self, topic: str, type_name: str | None = None) -> bool:
        """Return whether it has messages of a topic, which is of this type if one is given."""
        found = self.topics.get(topic)
        return found is not None and found.message_count > 0 \
            and type_name in (None, found.type_name)

    def messages(self, topics: Collection[str] | None = None, start_ns: int | None = None,
                 end_ns: int | None = None) -> Iterator[BagMessage]:
        """
        Yield the serialised messages, in order of log time.

        :param topics: only these; names that were not recorded yield nothing. Messages of another
            type on a topic of the contract are skipped and counted in `foreign`. None for all.
        :param start_ns: earliest log time [ns]; None for no limit.
        :param end_ns: log time before which to stop [ns]; None for no limit.
        :raises InputError: if the recording is damaged inside.
        """
        found = self._storage.messages(None if topics is None else frozenset(topics), start_ns,
                                       end_ns)
        if topics is not None:
            found = self._own(found)
        return found if self._progress is None else self._watched(found, self._progress)

    def _own(self, messages: Iterator[BagMessage]) -> Iterator[BagMessage]:
        for message in messages:
            if is_foreign(message.topic, message.type_name):
                self.foreign[message.topic] += 1
                continue
            yield message

    def _watched(self, messages: Iterator[BagMessage],
                 progress: Callable[[float], object]) -> Iterator[BagMessage]:
        for index, message in enumerate(messages):
            if index % _WATCHED_EVERY == 0:
                passed_ns = message.log_time_ns - self.start_ns
                progress(min(1.0, passed_ns / max(self.end_ns - self.start_ns, 1)))
            yield message

    def decoded(self, topics: Collection[str] | None = None, start_ns: int | None = None,
                end_ns: int | None = None) -> Iterator[DecodedMessage]:
        """
        Yield the decoded messages, in order of log time.

        :param topics: as in `messages`, as are the limits.
        :raises InputError: as `messages`, or if a message does not fit its type.
        """
        for message in self.messages(topics, start_ns, end_ns):
            yield self.decode(message)

    def readable(self, topics: Collection[str] | None = None, start_ns: int | None = None,
                 end_ns: int | None = None) -> Iterator[DecodedMessage]:
        """
        Yield messages as `decoded` does, but skip those that do not fit their type.

        Any node of a ROS graph may publish, so one such message must not make the run unreadable.
        They are counted in `foreign`.

        :raises InputError: as `messages`.
        """
        for message in self.messages(topics, start_ns, end_ns):
            try:
                yield self.decode(message)
            except InputError:
                self.foreign[message[0]] += 1

    def documents(self, kind: JsonDocument[T]) -> Iterator[tuple[int, T]]:
        """
        Yield the documents of a kind with their log times [ns], but skip malformed ones.

        :raises InputError: as `messages`.
        """
        for _, _, log_ns, message in self.readable([kind.topic]):
            try:
                document = kind.read(str(message.data))
            except (InputError, AttributeError):
                # The message may come from a foreign publisher.
                self.foreign[kind.topic] += 1
                continue
            yield log_ns, document

    def decode(self, message: BagMessage) -> DecodedMessage:
        """
        Return a decoded message.

        :raises InputError: if it does not fit its type.
        """
        topic, type_name, log_time_ns, data = message
        return DecodedMessage(topic, type_name, log_time_ns,
                              self._deserialize(topic, type_name, data))

    def latched(self, topic: str) -> DecodedMessage | None:
        """
        Return the last message of a topic, as a late subscriber to a latched topic gets it.

        :raises InputError: as `decoded`.
        """
        newest = deque(self.messages([topic]), maxlen=1)
        return self.decode(newest[0]) if newest else None

    def _deserialize(self, topic: str, type_name: str, data: bytes) -> object:
        try:
            if type_name not in self._types.fielddefs:
                self._learn(topic, type_name)
            codec = self._types.get_msgdef(type_name)
            decode = {BIG_ENDIAN: codec.deserialize_cdr_be,
                      LITTLE_ENDIAN: codec.deserialize_cdr_le}[data[:2]]
            message, end = decode(data[HEADER_BYTES:], 0, codec.cls, self._types)
            # The middleware may reserve more than a message needs; the rest is ignored.
            if end + HEADER_BYTES > len(data):
                raise ValueError(f'it needs {end + HEADER_BYTES} bytes and has {len(data)}')
            return message
        except (SerdeError, TypesysError, struct.error, ValueError, LookupError) as error:
            raise InputError(f'a message of {topic} is no {type_name} ({error})', str(self.path),
                             'the recording is damaged; record again') from error

    def _learn(self, topic: str, type_name: str) -> None:
        """Register a non-standard type by its definition in the recording."""
        definition = self._storage.definition(type_name)
        if not definition:
            raise InputError(f'{topic} has the type {type_name}, which is not known and which the '
                             'recording does not define', str(self.path),
                             'leave this topic out, or record in MCAP storage')
        found = get_types_from_msg(definition, type_name)
        if self._types is standard_types():
            # Recordings may define a type differently.
            self._types = get_typestore(Stores.ROS2_JAZZY)
        self._types.register({name: fields for name, fields in found.items()
                              if name not in self._types.fielddefs})

    def close(self) -> None:
        """Close the files."""
        self._storage.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


def _files_of(family: Sequence[Path]) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Find a recording's MCAP files in several folders; also return notices on unusable ones."""
    files: list[Path] = []
    notices: list[str] = []
    refusal: InputError | None = None
    for file in (file for folder in family for file in sorted(folder.glob('*.mcap'))):
        try:
            McapFile(file)
            files.append(file)
        except InputError as error:
            # A recorder that was killed right after its start has written nothing.
            notices.append(f'{error.what} ({file.parent.name}/{file.name}): left out')
            refusal = error
    if not files:
        raise refusal or InputError('no recording in this folder', str(family[0]),
                                    'give the folder that holds a .mcap or .db3 file')
    return tuple(files), tuple(notices)


def _listed_files(folder: Path) -> tuple[tuple[Path, ...], str, bool]:
    """Return the files in a folder's metadata, their storage, and whether they are compressed."""
    metadata = read_metadata(folder)
    where = str(folder / METADATA_FILE)
    if not metadata.files:
        raise InputError('it names no files', where, 'write it again with `crgame recover`')
    compressed = metadata.compression_mode in ('file', 'message')
    storage = metadata.storage
    if not storage:
        # `ros2 bag reindex` leaves it empty.
        storage = _SUFFIXES.get(Path(metadata.files[0].name).suffix, '')
        if storage != 'mcap' or compressed:
            raise InputError('it does not name the storage', where,
                             'write mcap or sqlite3 behind storage_identifier')
    if storage not in _SUFFIXES.values():
        raise InputError(f'unknown storage {storage!r}', where,
                         'convert it with `ros2 bag convert` to mcap or sqlite3')
    paths = tuple(folder / file.name for file in metadata.files)
    for path in paths:
        if not path.is_file():
            raise InputError('the file is missing', str(path),
                             f'{METADATA_FILE} names it: put it back, or recover what is there')
    return paths, storage, compressed


def _single_file(path: Path) -> Path:
    """Return the file to read without metadata."""
    if path.is_file():
        candidates = [path]
    else:
        candidates = sorted(p for p in path.iterdir() if p.is_file() and p.suffix in (
            *_SUFFIXES, '.zstd'))
        if not candidates:
            raise InputError('no recording in this folder', str(path),
                             'give the folder that holds a .mcap or .db3 file')
    packed = [item for item in candidates if item.suffix == '.zstd']
    if packed:
        raise InputError(f'is compressed, and {METADATA_FILE} is missing', str(packed[0]),
                         'unpack it with `zstd -d`')
    if len(candidates) > 1:
        raise InputError(f'{len(candidates)} files but no {METADATA_FILE}', str(path),
                         'name one of the files, or write it with `crgame recover`')
    if candidates[0].suffix not in _SUFFIXES:
        raise InputError('not a recording', str(path), 'give a folder, a .mcap or a .db3 file')
    return candidates[0]
