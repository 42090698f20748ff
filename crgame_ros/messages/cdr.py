# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The layout of a serialised message, to read some of its fields without decoding all.

The layout is that of CDR (OMG DDS-XTypes 7.4.3): every value is aligned to its size, after a
header of four bytes that gives the byte order.
"""

import struct
from typing import Any, Literal

from crgame_ros.errors import InputError

HEADER_BYTES = 4
BIG_ENDIAN, LITTLE_ENDIAN = b'\x00\x00', b'\x00\x01'
_NS_PER_S = 1_000_000_000


def header_stamp_ns(data: bytes) -> int:
    """
    Return the stamp of a serialised message that begins with a std_msgs/Header [ns].

    :param data: CDR with its header.
    """
    order: Literal['big', 'little'] = 'big' if data[:2] == BIG_ENDIAN else 'little'
    seconds = int.from_bytes(data[HEADER_BYTES:HEADER_BYTES + 4], order, signed=True)
    return seconds * _NS_PER_S + int.from_bytes(data[HEADER_BYTES + 4:HEADER_BYTES + 8], order)


def stamp_of(message: Any) -> int:
    """Return the stamp of a message [ns]; any library may have decoded it."""
    return int(message.header.stamp.sec) * _NS_PER_S + int(message.header.stamp.nanosec)


def aligned(place: int, size: int) -> int:
    """Return the next position in a serialised message that is aligned to a size in bytes."""
    return place + (HEADER_BYTES - place) % size


class Reader:
    """
    A reader of the bytes of a message, field by field.

    :raises ValueError: if it is no little-endian CDR. Every method raises ValueError or
        struct.error.
    """

    def __init__(self, data: bytes) -> None:
        if data[:HEADER_BYTES] != LITTLE_ENDIAN + b'\x00\x00':
            raise ValueError('no little-endian CDR')
        self._data = data
        self._at = HEADER_BYTES

    def number(self, kind: str = 'I') -> int:
        """Read an integer of four bytes."""
        self._at = aligned(self._at, 4)
        value: int = struct.unpack_from('<' + kind, self._data, self._at)[0]
        self._at += 4
        return value

    def stamp_ns(self) -> int:
        """Read a time [ns]."""
        return self.number('i') * _NS_PER_S + self.number()

    def text(self) -> str:
        """Read a string."""
        length = self.number()
        text = self._data[self._at:self._at + length - 1]
        self._at += length
        return text.decode()

    def skip_text(self) -> None:
        """Skip a string."""
        length = self.number()
        self._at += length

    def doubles(self, wanted: int) -> tuple[float, ...]:
        """Read the first numbers of a sequence; NaN where it is empty."""
        count = self.number()
        if not count:
            return (float('nan'),) * wanted
        self._at = aligned(self._at, 8)
        values = struct.unpack_from(f'<{wanted}d', self._data, self._at)
        if count < wanted:
            raise ValueError('too few numbers')
        self._at += 8 * count
        return values


def message_header(data: bytes, where: str) -> tuple[int, str]:
    """
    Read the std_msgs/Header with which a message begins.

    :param where: topic for messages.
    :return: stamp [ns] and frame
    :raises InputError: if there is none.
    """
    try:
        # The header is within these bytes of a long message.
        reader = Reader(data[:512])
        return reader.stamp_ns(), reader.text()
    except (ValueError, struct.error) as error:
        raise InputError(f'has no header ({error})', where) from error
