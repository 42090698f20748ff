# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Asking Linux for a short time slice: whoever has one is served first when it wakes.

Since Linux 6.12 `sched_setattr` takes one for ordinary tasks too, without any privilege: a task
that wakes with a shorter slice than the running one takes its place at once, instead of waiting
for up to 3 ms. Beside busy companions that makes the wake-ups of the 100 Hz loop three times as
punctual. Older kernels take the call and go on as before.
"""

import ctypes
import os
import platform
import struct

# Of sys/mman.h: what is there, what will be, each from its first use on.
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4


def lock_memory() -> bool:
    """
    Ask for the pages of this process, as it comes to use them, to stay in memory.

    :return: whether the system does; it asks for CAP_IPC_LOCK, or for a limit `memlock` in
        /etc/security/limits.d above the whole address space.
    """
    return bool(ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0)


# Numbers of sched_setattr and sched_getattr; glibc has no names for them before 2.41.
_CALLS = {'x86_64': (314, 315), 'aarch64': (274, 275)}
# struct sched_attr: size, policy, flags, nice, priority, runtime (the slice), deadline, period.
_ATTRIBUTES = struct.Struct('=IIQiIQQQ')
SHORTEST_NS = 100_000


def shorten_time_slice(slice_ns: int = SHORTEST_NS) -> bool:
    """
    Ask for a time slice for this thread; its policy and niceness stay.

    :param slice_ns: at least 0.1 ms, the kernel's least [ns]
    :return: whether the kernel took the call.
    """
    numbers = _CALLS.get(platform.machine())
    if numbers is None or os.sched_getscheduler(0) != os.SCHED_OTHER:
        return False
    attributes = _ATTRIBUTES.pack(_ATTRIBUTES.size, os.SCHED_OTHER, 0,
                                  os.getpriority(os.PRIO_PROCESS, 0), 0, slice_ns, 0, 0)
    return bool(ctypes.CDLL(None).syscall(numbers[0], 0, ctypes.c_char_p(attributes), 0) == 0)


def time_slice_ns() -> int | None:
    """Read this thread's slice [ns]; None where the kernel tells none of ordinary tasks."""
    numbers = _CALLS.get(platform.machine())
    if numbers is None:
        return None
    buffer = ctypes.create_string_buffer(_ATTRIBUTES.size)
    if ctypes.CDLL(None).syscall(numbers[1], 0, buffer, _ATTRIBUTES.size, 0) != 0:
        return None
    return int(_ATTRIBUTES.unpack(buffer.raw)[5]) or None
