# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The clock by which the kernel stamps the events of an input device."""

import fcntl
import struct
import time

# EVIOCSCLOCKID of <linux/input.h>: _IOW('E', 0xa0, int).
_SET_CLOCK = 0x400445A0


def stamp_by_steady_clock(descriptor: int) -> bool:
    """
    Let a device's events be stamped by the clock of `time.monotonic`.

    The kernel's own choice is the time of day, which somebody may set.

    :param descriptor: of an opened event device.
    :return: whether the kernel does; Linux since 3.4.
    """
    try:
        fcntl.ioctl(descriptor, _SET_CLOCK, struct.pack('i', time.CLOCK_MONOTONIC))
    except OSError:
        return False
    return True
