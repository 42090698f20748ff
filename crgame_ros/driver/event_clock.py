# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
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
