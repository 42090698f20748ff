# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The `metadata.yaml` of a recording's folder, in the layout of rosbag2 version 9."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
import functools
from pathlib import Path
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.whole_file import write_whole
from crgame_ros.yaml_text import parse_yaml, read_text
import yaml

METADATA_FILE = 'metadata.yaml'
VERSION = 9
# A recording that was split into thousands of files names them all.
_MAX_BYTES = 32 << 20
_REMEDY = 'write it again with `crgame recover` or `ros2 bag reindex`'
_ROOT = 'rosbag2_bagfile_information'
_INFINITE = {'sec': 9223372036, 'nsec': 854775807}
# Recordings older than version 9 store the numbers of the middleware's enumerations.
_RELIABILITIES = ('system_default', 'reliable', 'best_effort', 'unknown', 'best_available')
_DURABILITIES = ('system_default', 'transient_local', 'volatile', 'unknown', 'best_available')


@dataclass(frozen=True)
class TopicQos:
    """
    The quality of service of a recorded topic, used for its replay too.

    :param depth: length of the publisher's queue (keep last).
    :param reliability: `reliable` or `best_effort`; recordings of other tools may also have
        `system_default`, `best_available` or `unknown`.
    :param durability: `volatile` or `transient_local` (latched); others as above.
    :raises InputError: for any other word.
    """

    depth: int = 10
    reliability: str = 'reliable'
    durability: str = 'volatile'

    def __post_init__(self) -> None:
        for value, known in ((self.reliability, _RELIABILITIES), (self.durability, _DURABILITIES)):
            if value not in known:
                raise InputError(f'no such quality of service: {value!r}', 'QoS',
                                 f'use one of {", ".join(known)}')

    def to_dict(self) -> dict[str, object]:
        """Return the nested form of `offered_qos_profiles`."""
        return {
            'history': 'keep_last', 'depth': self.depth, 'reliability': self.reliability,
            'durability': self.durability, 'deadline': dict(_INFINITE),
            'lifespan': dict(_INFINITE), 'liveliness': 'automatic',
            'liveliness_lease_duration': dict(_INFINITE),
            'avoid_ros_namespace_conventions': False}


@dataclass(frozen=True)
class BagTopic:
    """A recorded topic; `qos` has one entry for each publisher with known offer."""

    name: str
    type_name: str
    message_count: int
    qos: tuple[TopicQos, ...] = ()
    type_hash: str = ''


@dataclass(frozen=True)
class BagFile:
    """A file of a recording; times are log times [ns], both 0 without messages."""

    name: str
    start_ns: int
    end_ns: int
    message_count: int


@dataclass(frozen=True)
class BagMetadata:
    """The content of `metadata.yaml`."""

    storage: str
    files: tuple[BagFile, ...]
    topics: tuple[BagTopic, ...]
    compression_mode: str = ''


@functools.lru_cache(maxsize=64)
def _load(text: str, where: str = '') -> Any:
    """Read YAML; callers share the cached result and must not change it."""
    return parse_yaml(text, where, _REMEDY, _MAX_BYTES)


def qos_text(profiles: Iterable[TopicQos]) -> str:
    """Return QoS profiles as the YAML text of an MCAP channel."""
    return str(yaml.safe_dump([qos.to_dict() for qos in profiles], sort_keys=False))


def parse_qos(value: object, where: str) -> tuple[TopicQos, ...]:
    """
    Read `offered_qos_profiles`: nested lists (version 9) or YAML text (before, and in MCAP).

    :param value: the field as it was read.
    :param where: the file or topic, for the message.
    :raises InputError: if it is neither.
    """
    try:
        entries: Any = _load(value) if isinstance(value, str) else value
        return tuple(TopicQos(int(entry['depth']), _named(entry['reliability'], _RELIABILITIES),
                              _named(entry['durability'], _DURABILITIES))
                     for entry in entries or [])
    except (InputError, KeyError, TypeError, ValueError, IndexError, OverflowError,
            AttributeError) as error:
        reason = error.what if isinstance(error, InputError) else repr(error)
        raise InputError(f'its offered_qos_profiles cannot be read ({reason})', where,
                         'record again, or correct the entry') from error


def _named(value: object, names: Sequence[str]) -> str:
    return names[value] if isinstance(value, int) else str(value)


def write_metadata(folder: Path, metadata: BagMetadata) -> Path:
    """
    Write `metadata.yaml` in one step: a reader sees the old file or the complete new one.

    :raises OSError: if writing fails; an existing file is then unchanged.
    """
    path = folder / METADATA_FILE
    write_whole(yaml.safe_dump({_ROOT: _to_dict(metadata)}, sort_keys=False).encode(), path)
    return path


def _to_dict(metadata: BagMetadata) -> dict[str, object]:
    filled = [file for file in metadata.files if file.message_count]
    # `ros2 bag play` waits for this time; earlier than the first message, it would never end.
    start_ns = min((file.start_ns for file in filled), default=0)
    end_ns = max((file.end_ns for file in filled), default=0)
    return {
        'version': VERSION,
        'storage_identifier': metadata.storage,
        'duration': {'nanoseconds': end_ns - start_ns},
        'starting_time': {'nanoseconds_since_epoch': start_ns},
        'message_count': sum(file.message_count for file in filled),
        'topics_with_message_count': [
            {'topic_metadata': {
                'name': topic.name, 'type': topic.type_name, 'serialization_format': 'cdr',
                'offered_qos_profiles': [qos.to_dict() for qos in topic.qos],
                'type_description_hash': topic.type_hash},
             'message_count': topic.message_count} for topic in metadata.topics],
        'compression_format': '',
        'compression_mode': metadata.compression_mode,
        'relative_file_paths': [file.name for file in metadata.files],
        'files': [
            {'path': file.name,
             'starting_time': {'nanoseconds_since_epoch': file.start_ns},
             'duration': {'nanoseconds': file.end_ns - file.start_ns},
             'message_count': file.message_count} for file in metadata.files],
        'custom_data': {},
        'ros_distro': 'jazzy'}


def read_metadata(folder: Path) -> BagMetadata:
    """
    Read the `metadata.yaml` of a folder, of any version of rosbag2 (1 to 9).

    :raises InputError: if it cannot be read or lacks what every version has.
    """
    path = folder / METADATA_FILE
    try:
        content = _load(read_text(path, 'metadata file', _REMEDY, _MAX_BYTES), str(path))[_ROOT]
        # Only the name: before version 4 the path repeats the folder, and none may lead outside.
        names = [Path(str(name)).name for name in content['relative_file_paths']]
        details = {Path(str(entry['path'])).name: entry for entry in content.get('files') or []}
        return BagMetadata(
            storage=str(content['storage_identifier']),
            files=tuple(_read_file(name, details.get(name)) for name in names),
            topics=tuple(_read_topic(entry, str(path))
                         for entry in content['topics_with_message_count'] or []),
            compression_mode=str(content.get('compression_mode') or '').lower())
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InputError(f'not the metadata of a recording ({error!r})', str(path),
                         _REMEDY) from error


def _read_file(name: str, entry: dict[str, Any] | None) -> BagFile:
    if entry is None:
        return BagFile(name, 0, 0, 0)
    start_ns = int(entry['starting_time']['nanoseconds_since_epoch'])
    return BagFile(name, start_ns, start_ns + int(entry['duration']['nanoseconds']),
                   int(entry['message_count']))


def _read_topic(entry: dict[str, Any], where: str) -> BagTopic:
    topic = entry['topic_metadata']
    return BagTopic(str(topic['name']), str(topic['type']), int(entry['message_count']),
                    parse_qos(topic.get('offered_qos_profiles'), where),
                    str(topic.get('type_description_hash') or ''))
