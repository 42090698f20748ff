# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The head of a serialised plan request: whose it is, when, and where that vehicle is in point 0.

Decoding a whole request of 60 objects costs the 100 Hz loop a millisecond, its head a tenth of
that.
"""

import struct

from crgame_ros.errors import InputError
from crgame_ros.messages.cdr import Reader
from crgame_ros.messages.joints import JointSeries, VEHICLE_JOINTS
import numpy as np

JOINTS = len(VEHICLE_JOINTS)


def request_head(data: bytes, where: str) -> JointSeries:
    """
    Read stamp and first vehicle of a request's point 0.

    :param data: a serialised trajectory_msgs/JointTrajectory.
    :param where: topic for messages.
    :return: one point of four joints
    :raises InputError: if it is something else.
    """
    try:
        reader = Reader(data)
        stamp_ns = reader.stamp_ns()
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
