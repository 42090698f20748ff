# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Reads one MCAP file, finished or cut off anywhere, without its index.

A killed recorder never wrote the index at the end of the file. Walking over the records from the
front costs one seek per chunk and reads both kinds of file in the same way.
"""

from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
import struct
from typing import BinaryIO, NamedTuple
import zlib

from crgame_ros.errors import InputError
import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Header, Schema, Statistics
import zstandard

# Channel and size of the entries.
MESSAGE_INDEX_HEAD = struct.Struct('<HI')
_INDEX_ENTRY_BYTES = 16
_RECORD_BYTES = 9
# The checksum of the summary ends before itself, the last field of the footer.
_BEFORE_CHECKSUM_BYTES = _RECORD_BYTES + 16


class Extent(NamedTuple):
    """Size of a chunk with its head [bytes], and the range of its log times [ns]."""

    size: int
    start_ns: int
    end_ns: int


class McapIndex:
    """
    The index behind each chunk and the summary at the end, collected record by record.

    A chunk has a checksum, an index has none, and the summary may have one. A reader that skips a
    chunk trusts them, so entries that the file holds twice have to agree.

    :ivar statistics: of the summary, None if it has none.
    """

    def __init__(self) -> None:
        self.statistics: Statistics | None = None
        self._channels: defaultdict[int, Counter[int]] = defaultdict(Counter)
        self._outside: Counter[int] = Counter()
        self._chunks: dict[int, Extent] = {}
        self._sound = True

    def add(self, opcode: int, data: bytes, chunk: int | None) -> None:
        """
        Add a record.

        :param data: its body; of a message index the head is enough.
        :param chunk: offset of the chunk in front of it.
        :raises struct.error, ValueError, EndOfFile: if it is damaged.
        """
        if opcode == Opcode.MESSAGE_INDEX and chunk is not None:
            channel, size = MESSAGE_INDEX_HEAD.unpack_from(data)
            self._channels[chunk][channel] += size // _INDEX_ENTRY_BYTES
        elif opcode == Opcode.STATISTICS:
            self.statistics = Statistics.read(ReadDataStream(BytesIO(data)))
        elif opcode == Opcode.CHUNK_INDEX:
            entry = ChunkIndex.read(ReadDataStream(BytesIO(data)))
            self._chunks[entry.chunk_start_offset] = Extent(
                entry.chunk_length, entry.message_start_time, entry.message_end_time)

    def count_outside(self, channel: int) -> None:
        """Count a message outside of chunks, which no index names."""
        self._outside[channel] += 1

    def check_summary(self, stream: BinaryIO, footer: int) -> None:
        """
        Compare the summary with its checksum, if it has one.

        :param footer: offset of the footer's record.
        """
        stream.seek(footer + _RECORD_BYTES)
        found = Footer.read(ReadDataStream(stream))
        if found.summary_start and found.summary_crc:
            stream.seek(found.summary_start)
            size = footer + _BEFORE_CHECKSUM_BYTES - found.summary_start
            self._sound = size > 0 and zlib.crc32(stream.read(size)) == found.summary_crc

    def channels(self, chunk: int) -> frozenset[int] | None:
        """Return the channels with a message in a chunk, None if no index names them."""
        return frozenset(self._channels[chunk]) if chunk in self._channels else None

    def agrees(self, chunks: Mapping[int, Extent]) -> bool:
        """
        Return whether the index, the summary and the chunks of the file agree.

        :param chunks: by offset, as in the chunks' own heads.
        """
        if self._chunks and self._chunks != chunks:
            return False
        if self._channels and self.statistics is not None:
            found = sum(self._channels.values(), self._outside)
            counts = self.statistics.channel_message_counts
            return found == Counter({number: count for number, count in counts.items() if count})
        return self._sound


_MAGIC = b'\x89MCAP0\r\n'
_RECORD = struct.Struct('<BQ')
_MESSAGE = struct.Struct('<HIQQ')
_CHUNK = struct.Struct('<QQQII')
_CHANNEL_ID = struct.Struct('<H')
_LENGTH = struct.Struct('<Q')
_RUN_BYTES = 1 << 20
# ROS counts time in signed 64 bit; later times are not from a recorder [ns].
_LATEST_NS = 2 ** 63 - 1
# An unpacked chunk is as large as a few messages; a larger stated size means damage [bytes].
_LARGEST_CHUNK = 1 << 29
_DAMAGES = (struct.error, ValueError, RuntimeError, MemoryError, EOFError, EndOfFile,
            OverflowError, zstandard.ZstdError)
_LAST_DEFINED_OPCODE = max(Opcode)
_FIRST_PRIVATE_OPCODE = 0x80


class McapMessage(NamedTuple):
    """A message as it is stored; times in ns, the log time at most 2^63 - 1."""

    channel_id: int
    sequence: int
    log_time_ns: int
    publish_time_ns: int
    data: bytes


@dataclass(frozen=True)
class Segment:
    """
    A chunk, or a run of records outside of chunks, with the range of its log times [ns].

    :param channels: ids of the channels with a message in it, None if no index names them.
    """

    offset: int
    size: int
    start_ns: int
    end_ns: int
    chunked: bool
    channels: frozenset[int] | None = None


@dataclass(frozen=True)
class Tally:
    """Message counts by channel id, and the range of log times [ns], 0 without messages."""

    counts: dict[int, int]
    start_ns: int
    end_ns: int


class McapFile:
    """
    The contents found by a walk over a file's records; the messages stay in the file.

    :param path: the file.
    :ivar complete: whether the file has its closing records, undamaged.
    :ivar contradicts: whether its index and its content disagree; the index is then not used.
    :ivar segments: the positions of the messages, in file order.
    :ivar kept: offset and size of each metadata and attachment record.
    :ivar useless_bytes: size of the cut-off or damaged parts, as far as the walk shows.
    :ivar channels: by id; in a file without summary only after its messages were read.
    :raises InputError: if it is not an MCAP file or cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.complete = self.contradicts = False
        self.size = self.useless_bytes = 0
        self.header = Header('', '')
        self.segments: list[Segment] = []
        self.kept: list[tuple[int, int]] = []
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self._index = McapIndex()
        # Definitions that the summary does not repeat.
        self._defined: tuple[dict[int, Channel], dict[int, Schema]] = ({}, {})
        try:
            self.size = self.path.stat().st_size
            with self.path.open('rb') as stream:
                if stream.read(len(_MAGIC)) != _MAGIC:
                    raise InputError('no MCAP file' if self.size else 'the file is empty',
                                     str(self.path), 'give a recording made with MCAP storage')
                self._walk(stream)
        except OSError as error:
            raise InputError(f'cannot be read: {error.strerror}', str(self.path)) from error
        while not self.complete and self.segments and not self.is_sound(self.segments[-1]):
            # A power cut can leave a last chunk that has its length but not its bytes.
            self.useless_bytes += self.segments.pop().size

    def _walk(self, stream: BinaryIO) -> None:
        position = len(_MAGIC)
        run: list[int] = []
        while True:
            readable = position
            head = stream.read(_RECORD.size)
            if len(head) < _RECORD.size:
                break
            opcode, length = _RECORD.unpack(head)
            end = position + _RECORD.size + length
            defined = 0 < opcode <= _LAST_DEFINED_OPCODE or opcode >= _FIRST_PRIVATE_OPCODE
            if end > self.size or not defined:
                break
            try:
                if opcode == Opcode.MESSAGE:
                    channel, _, log_time_ns, _ = _MESSAGE.unpack(stream.read(
                        min(_MESSAGE.size, length)))
                    self._index.count_outside(channel)
                    self._extend_run(run, position, end, min(log_time_ns, _LATEST_NS))
                else:
                    self._close_run(run)
                    self._read_record(stream, opcode, position, end)
            except _DAMAGES:
                self._close_run(run)
                self.useless_bytes += end - position
            stream.seek(end)
            position = end
            if opcode == Opcode.FOOTER:
                # Bytes behind the closing mark hide the index from every other reader.
                self.complete = stream.read(len(_MAGIC) + 1) == _MAGIC
                readable = min(end + len(_MAGIC), self.size)
                break
        self._close_run(run)
        if self.complete:
            self._use_index()
        self.complete = self.complete and not self.useless_bytes
        self.useless_bytes += self.size - readable

    def _use_index(self) -> None:
        """Set each chunk's channels from the index, if the file does not contradict itself."""
        chunks = {segment.offset: segment for segment in self.segments if segment.chunked}
        self.contradicts = not self._index.agrees({
            offset: Extent(chunk.size, chunk.start_ns, chunk.end_ns)
            for offset, chunk in chunks.items()})
        if self.contradicts:
            self.complete = False
            self.channels, self.schemas = self._defined
            return
        self.segments = [replace(segment, channels=self._index.channels(segment.offset))
                         for segment in self.segments]

    def _read_record(self, stream: BinaryIO, opcode: int, position: int, end: int) -> None:
        length = end - position - _RECORD.size
        if opcode == Opcode.CHUNK:
            start_ns, end_ns, _, _, _ = _CHUNK.unpack(stream.read(_CHUNK.size))
            self.segments.append(Segment(position, end - position, min(start_ns, _LATEST_NS),
                                         min(end_ns, _LATEST_NS), True))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._define(opcode, stream.read(length))
        elif opcode in (Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX, Opcode.STATISTICS):
            # A chunk is followed by one index for each channel in it.
            last = self.segments[-1] if self.segments else None
            chunk = last.offset if last is not None and last.chunked else None
            # The number of its entries (one per message) is enough.
            size = MESSAGE_INDEX_HEAD.size if opcode == Opcode.MESSAGE_INDEX else length
            self._index.add(opcode, stream.read(min(size, length)), chunk)
        elif opcode == Opcode.HEADER:
            self.header = Header.read(ReadDataStream(BytesIO(stream.read(length))))
        elif opcode == Opcode.DATA_END:
            self._defined = dict(self.channels), dict(self.schemas)
        elif opcode == Opcode.FOOTER:
            self._index.check_summary(stream, position)
        elif opcode in (Opcode.METADATA, Opcode.ATTACHMENT):
            self.kept.append((position, end - position))

    def _extend_run(self, run: list[int], position: int, end: int, log_time_ns: int) -> None:
        """Grow `run`: offset, end, first and last log time of messages outside of chunks."""
        if run and end - run[0] > _RUN_BYTES:
            self._close_run(run)
        if not run:
            run += [position, end, log_time_ns, log_time_ns]
        run[1:] = [end, min(run[2], log_time_ns), max(run[3], log_time_ns)]

    def _close_run(self, run: list[int]) -> None:
        if run:
            self.segments.append(Segment(run[0], run[1] - run[0], run[2], run[3], False))
            run.clear()

    def _define(self, opcode: int, data: bytes) -> None:
        stream = ReadDataStream(BytesIO(data))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas[schema.id] = schema
        else:
            channel = Channel.read(stream)
            self.channels[channel.id] = channel

    def is_sound(self, segment: Segment) -> bool:
        """Return whether all of a segment can be read."""
        try:
            if self.complete and segment.chunked and self._has_checksum(segment):
                # The checksum shows that the bytes are those written, so they need no parsing.
                self._content(segment)
                return True
            for _ in self.messages(segment):
                pass
        except (InputError, *_DAMAGES):
            return False
        return True

    def _has_checksum(self, segment: Segment) -> bool:
        with self.path.open('rb') as stream:
            stream.seek(segment.offset + _RECORD.size)
            return _CHUNK.unpack(stream.read(_CHUNK.size))[3] != 0

    def tally(self) -> Tally:
        """
        Count the messages of each channel, from the summary or else by reading them all.

        After reading, the channels and times of each segment are known from its messages.

        :raises InputError: as `messages`.
        """
        found = self._index.statistics
        if self.complete and found is not None and self.channels:
            return Tally({number: count for number, count in found.channel_message_counts.items()
                          if count}, min(found.message_start_time, _LATEST_NS),
                         min(found.message_end_time, _LATEST_NS))
        counts: Counter[int] = Counter()
        for index, segment in enumerate(self.segments):
            inside = Counter[int]()
            start_ns, end_ns = _LATEST_NS, 0
            for number, _, log_time_ns, _, _ in self.messages(segment):
                inside[number] += 1
                start_ns, end_ns = min(start_ns, log_time_ns), max(end_ns, log_time_ns)
            counts.update(inside)
            if inside:
                self.segments[index] = replace(segment, channels=frozenset(inside),
                                               start_ns=start_ns, end_ns=end_ns)
        return Tally(dict(counts), min((s.start_ns for s in self.segments), default=0),
                     max((s.end_ns for s in self.segments), default=0))

    def messages(self, segment: Segment,
                 without: Collection[int] = ()) -> Iterator[McapMessage]:
        """
        Read the messages of a segment in file order, and store the channels it defines.

        :param without: ids of channels whose messages are skipped.
        :raises InputError: if the segment is damaged; nothing of it is yielded then, unless the
            damage passes the checksum or there is no checksum.
        """
        try:
            yield from self._messages(self._content(segment), without)
        except _DAMAGES as error:
            raise InputError(f'the data at byte {segment.offset} is damaged ({error})',
                             str(self.path), '`crgame recover` keeps the rest') from error

    def _content(self, segment: Segment) -> bytes:
        with self.path.open('rb') as stream:
            stream.seek(segment.offset)
            data = stream.read(segment.size)
        if not segment.chunked:
            return data
        body = _RECORD.size
        _, _, size, checksum, name_length = _CHUNK.unpack_from(data, body)
        body += _CHUNK.size
        compression = data[body:body + name_length].decode()
        body += name_length + _LENGTH.size
        if size > _LARGEST_CHUNK:
            raise ValueError(f'a chunk of {size} bytes')
        content = _decompress(compression, data[body:], size)
        if len(content) != size or checksum and zlib.crc32(content) != checksum:
            raise ValueError('wrong size or checksum')
        return content

    def _messages(self, content: bytes,
                  without: Collection[int]) -> Iterator[McapMessage]:
        position, end = 0, len(content)
        # Every message of a recording passes this loop, so names are looked up once.
        head, message, head_size = _RECORD.unpack_from, _MESSAGE.unpack_from, _RECORD.size
        channel_id, plain, data_place = _CHANNEL_ID.unpack_from, int(Opcode.MESSAGE), _MESSAGE.size
        while position < end:
            opcode, length = head(content, position)
            body = position + head_size
            position = body + length
            if position > end:
                raise ValueError('a record is longer than its chunk')
            if opcode == plain:
                if without and channel_id(content, body)[0] in without:
                    continue
                channel, number, log_ns, publish_ns = message(content, body)
                yield McapMessage(channel, number, min(log_ns, _LATEST_NS), publish_ns,
                                  content[body + data_place:position])
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._define(opcode, content[body:position])


def _decompress(compression: str, data: bytes, size: int) -> bytes:
    if compression == 'zstd':
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    if compression == 'lz4':
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
    if compression:
        raise ValueError(f'unknown compression {compression!r}')
    return data
