# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The head of a serialised plan request: whose it is, when, and where that vehicle is in point 0.

Decoding a whole request of 60 objects costs the 100 Hz loop a millisecond, its head a tenth of
that. The layout is that of CDR (OMG DDS-XTypes 7.4.3): little endian, everything aligned to its
size behind a header of four bytes.
"""

import struct

import numpy as np

from crgame_ros.errors import InputError
from crgame_ros.planner.joints import JointSeries, VEHICLE_JOINTS

HEADER = b'\x00\x01\x00\x00'
JOINTS = len(VEHICLE_JOINTS)
NS_PER_S = 1_000_000_000


class _Reader:
    """Walks over the bytes."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def number(self, kind: str = 'I') -> int:
        """Read an integer of four bytes."""
        self._at += -self._at % 4
        value: int = struct.unpack_from('<' + kind, self._data, self._at)[0]
        self._at += 4
        return value

    def text(self) -> str:
        """Read a string."""
        length = self.number()
        text = self._data[self._at:self._at + length - 1]
        self._at += length
        return text.decode()

    def skip_text(self) -> None:
        """Pass over a string."""
        length = self.number()
        self._at += length

    def doubles(self, wanted: int) -> tuple[float, ...]:
        """Read the first numbers of a sequence; NaN where it is empty."""
        count = self.number()
        if not count:
            return (float('nan'),) * wanted
        self._at += -self._at % 8
        values = struct.unpack_from(f'<{wanted}d', self._data, self._at)
        if count < wanted:
            raise ValueError('too few numbers')
        self._at += 8 * count
        return values


def request_head(data: bytes, where: str) -> JointSeries:
    """
    Read stamp and first vehicle of a request's point 0.

    :param data: a serialised trajectory_msgs/JointTrajectory.
    :param where: topic for messages.
    :return: one point of four joints
    :raises InputError: if it is something else.
    """
    try:
        if data[:4] != HEADER:
            raise ValueError('no little-endian CDR')
        reader = _Reader(data[4:])
        stamp_ns = reader.number('i') * NS_PER_S + reader.number()
        reader.skip_text()
        names = reader.number()
        if names < JOINTS:
            raise ValueError('too few joints')
        own = tuple(reader.text() for _ in range(JOINTS))
        for _ in range(names - JOINTS):
            reader.skip_text()
        if not reader.number():
            raise ValueError('no points')
        rows = [np.array([reader.doubles(JOINTS)]) for _ in range(3)]
    except (ValueError, struct.error, UnicodeDecodeError) as error:
        raise InputError(f'cannot be read ({error})', where) from error
    return JointSeries(stamp_ns, own, np.zeros(1, dtype=np.int64), *rows)
