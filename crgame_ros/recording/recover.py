# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finishes the recording of a killed recorder, without risk to its messages."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
import sqlite3
from typing import BinaryIO

from crgame_ros.errors import InputError
from crgame_ros.recording.exceptions import RecordingError
from crgame_ros.recording.mcap_file import McapFile
from crgame_ros.recording.metadata import (
    BagFile,
    BagMetadata,
    METADATA_FILE,
    read_metadata,
    write_metadata,
)
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.storage import McapStorage, merge_topics, RosbagsStorage
from crgame_ros.recording.writer import CHUNK_BYTES
from crgame_ros.whole_file import whole_file
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Metadata
from mcap.writer import CompressionType, Writer

_RECORD_HEAD_BYTES = 9


@dataclass(frozen=True)
class RecoverReport:
    """
    The findings and changes of `recover`.

    :param path: the recording.
    :param messages: the number of messages it has now.
    :param duration_s: from its first to its last message [s].
    :param bytes_dropped: bytes of the old files that held no readable message.
    :param rewritten: names of the files that were finished.
    :param metadata_written: whether `metadata.yaml` was written.
    """

    path: Path
    messages: int
    duration_s: float
    bytes_dropped: int
    rewritten: tuple[str, ...]
    metadata_written: bool

    @property
    def changed(self) -> bool:
        """Return whether the recording was changed."""
        return bool(self.rewritten) or self.metadata_written


def recover(path: Path, progress: Callable[[float], object] | None = None) -> RecoverReport:
    """
    Finish a recording whose recorder was killed; leave a finished one as it is.

    Each unfinished file is copied, message by message, to a file beside it. The copy is read back
    and then replaces the file in one step, so that one file with all messages exists at any time.

    For SQLite files only the metadata is written.

    :param path: the folder of a recording, or a bare `.mcap` file.
    :param progress: called with the copied share of a file, 0 to 1.
    :raises InputError: if there is nothing to finish.
    :raises RecordingError: if writing fails; the recording is then unchanged.
    """
    if not path.exists():
        raise InputError('no such file or folder', str(path), 'give a recording')
    files = [path] if path.is_file() else sorted(path.glob('*.mcap'))
    dropped: dict[str, int | None] = {}
    try:
        if files and files[0].suffix == '.mcap':
            dropped = {file.name: _finish(file, progress) for file in files}
            rewritten = any(count is not None for count in dropped.values())
            written = path.is_dir() and (rewritten or not _has_metadata(path, files))
            if written:
                _describe(path, 'mcap', files, [McapStorage([file]) for file in files])
        else:
            files = sorted(path.glob('*.db3')) if path.is_dir() else []
            written = bool(files) and not _is_described(path, files)
            if written:
                _describe(path, 'sqlite3', files, [_opened_database(file) for file in files])
    except OSError as error:
        raise RecordingError(path, f'cannot be finished: {error.strerror}',
                             'free some space; the recording is as it was') from error
    with BagReader(path) as reader:
        return RecoverReport(
            path, reader.message_count, reader.duration_s,
            sum(count or 0 for count in dropped.values()),
            tuple(name for name, count in dropped.items() if count is not None), written)


def _is_described(folder: Path, files: list[Path]) -> bool:
    """Return whether SQLite files have metadata with which they can be read."""
    if not _has_metadata(folder, files):
        return False
    try:
        with BagReader(folder):
            return True
    except InputError:
        return False


def _opened_database(file: Path) -> RosbagsStorage:
    """
    Open an SQLite file.

    :raises InputError: if it is damaged.
    """
    try:
        # Opening rolls back unfinished transactions; readers open without this check.
        with closing(sqlite3.connect(file)) as connection:
            (state,), *_ = connection.execute('PRAGMA quick_check(1)').fetchall()
    except sqlite3.Error as error:
        state = str(error)
    if state != 'ok':
        raise InputError(f'the database is damaged ({state})', str(file),
                         f'save what is left with `sqlite3 {file.name} .recover`')
    return RosbagsStorage(file)


def _describe(folder: Path, kind: str, files: Sequence[Path],
              storages: Sequence[McapStorage | RosbagsStorage]) -> None:
    """Write the `metadata.yaml` of files, each opened as a storage of its own; close these."""
    entries = [BagFile(file.name, storage.start_ns, storage.end_ns,
                       sum(topic.message_count for topic in storage.topics))
               for file, storage in zip(files, storages, strict=True)]
    topics = merge_topics(topic for storage in storages for topic in storage.topics)
    for storage in storages:
        storage.close()
    entries.sort(key=lambda entry: entry.start_ns)
    write_metadata(folder, BagMetadata(kind, tuple(entries), topics))


def _finish(path: Path, progress: Callable[[float], object] | None) -> int | None:
    """Rewrite a file unless it is finished and undamaged; return the bytes dropped, or None."""
    source = McapFile(path)
    damaged = {segment for segment in source.segments if not source.is_sound(segment)}
    if source.complete and not damaged:
        return None
    source.segments = [segment for segment in source.segments if segment not in damaged]
    with whole_file(path) as part:
        with part.open('wb') as stream:
            count, lost = _copy(source, stream, progress)
        copy = McapFile(part)
        if not copy.complete or sum(copy.tally().counts.values()) != count:
            raise RecordingError(part, 'what was written does not read back',
                                 'check the disk; the recording is as it was')
    return source.useless_bytes + lost + sum(segment.size for segment in damaged)


def _copy(source: McapFile, target: BinaryIO,
          progress: Callable[[float], object] | None) -> tuple[int, int]:
    """Copy all messages; return their number, and the bytes of those with unknown channel."""
    writer = Writer(target, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
    writer.start(source.header.profile, source.header.library)
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    count = lost = 0
    for segment in source.segments:
        if progress is not None:
            progress(segment.offset / max(source.size, 1))
        for message in source.messages(segment):
            if message.channel_id not in source.channels:
                lost += len(message.data)
                continue
            if message.channel_id not in channels:
                _register(source, message.channel_id, writer, schemas, channels)
            writer.add_message(channels[message.channel_id], message.log_time_ns, message.data,
                               message.publish_time_ns, message.sequence)
            count += 1
    for number in sorted(source.channels.keys() - channels.keys()):
        _register(source, number, writer, schemas, channels)
    for offset, size in source.kept:
        _copy_record(source.path, offset, size, writer)
    writer.finish()
    return count, lost


def _register(source: McapFile, number: int, writer: Writer, schemas: dict[int, int],
              channels: dict[int, int]) -> None:
    channel = source.channels[number]
    schema = source.schemas.get(channel.schema_id)
    if schema is not None and schema.id not in schemas:
        schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
    channels[number] = writer.register_channel(
        channel.topic, channel.message_encoding, schemas.get(channel.schema_id, 0),
        channel.metadata)


def _copy_record(path: Path, offset: int, size: int, writer: Writer) -> None:
    with path.open('rb') as stream:
        stream.seek(offset)
        record = stream.read(size)
    body = ReadDataStream(BytesIO(record[_RECORD_HEAD_BYTES:]))
    if record[0] == Opcode.METADATA:
        metadata = Metadata.read(body)
        writer.add_metadata(metadata.name, metadata.metadata)
    else:
        attachment = Attachment.read(body)
        writer.add_attachment(attachment.create_time, attachment.log_time, attachment.name,
                              attachment.media_type, attachment.data)


def _has_metadata(folder: Path, files: list[Path]) -> bool:
    """Return whether `metadata.yaml` exists and describes the present files."""
    if not (folder / METADATA_FILE).is_file():
        return False
    try:
        listed = {file.name for file in read_metadata(folder).files}
    except InputError:
        # Unreadable metadata is one kind of damage that is repaired here.
        return False
    return listed == {file.name for file in files}
