# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an MCAP file says of its own content, and whether it agrees with itself."""

from collections import Counter, defaultdict
from collections.abc import Mapping
from io import BytesIO
import struct
from typing import BinaryIO, NamedTuple
import zlib

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, Footer, Statistics

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
    The index behind each chunk and the summary at the end, taken up record by record.

    A chunk has a checksum and these have none, or one of the summary alone. Who skips a chunk
    because of them trusts them: what is said twice has to agree.

    :ivar statistics: of the summary, None where there are none.
    """

    def __init__(self) -> None:
        self.statistics: Statistics | None = None
        self._channels: defaultdict[int, Counter[int]] = defaultdict(Counter)
        self._outside: Counter[int] = Counter()
        self._chunks: dict[int, Extent] = {}
        self._sound = True

    def take(self, opcode: int, data: bytes, chunk: int | None) -> None:
        """
        Take up a record.

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
        """Take up a message outside of chunks: no index names it."""
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
        """Return the channels with a message in a chunk, None where no index names them."""
        return frozenset(self._channels[chunk]) if chunk in self._channels else None

    def agrees(self, chunks: Mapping[int, Extent]) -> bool:
        """
        Return whether all that the file says of itself fits together.

        :param chunks: by offset, as each says itself.
        """
        if self._chunks and self._chunks != chunks:
            return False
        if self._channels and self.statistics is not None:
            found = sum(self._channels.values(), self._outside)
            counts = self.statistics.channel_message_counts
            return found == Counter({number: count for number, count in counts.items() if count})
        return self._sound
