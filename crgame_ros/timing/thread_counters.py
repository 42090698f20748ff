# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A thread and Linux's scheduler: its counters, and a request for a short time slice.

Since Linux 6.12 `sched_setattr` accepts one for ordinary tasks too, without any privilege. A task
that wakes with a shorter slice than the running one preempts it at once, instead of waiting for up
to 3 ms. With busy companions that makes the wake-ups of the 100 Hz loop three times as punctual.
Older kernels accept the call and ignore it.
"""

from contextlib import suppress
import ctypes
import mmap
import os
import platform
from resource import getrusage, RUSAGE_THREAD, struct_rusage
import struct
import threading
import time
from typing import NamedTuple

# Bytes to read: the first line of schedstat, and the processors' lines at the start of /proc/stat.
_LINE, _STAT = 128, 16384
_TICK_NS = 1_000_000_000 // os.sysconf('SC_CLK_TCK')
# Index of the stolen ticks in a processor's line of /proc/stat.
_STOLEN = 8
_PAGES = 64
# From sys/mman.h: present pages, future pages, each locked at its first use.
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4


class ThreadCounts(NamedTuple):
    """
    The counters of a thread so far.

    :param wall_ns: the monotonic clock [ns]
    :param computed_ns: processor time [ns]; where the kernel counts `waited_ns`, only until the
        thread was last scheduled or a timer tick came
    :param waited_ns: time for which it was ready but not running [ns]; None where the kernel does
        not count it
    :param runs: number of times that it was scheduled on a processor.
    :param minor_faults: page faults served from memory.
    :param major_faults: page faults that waited for a disk.
    """

    wall_ns: int
    computed_ns: int
    waited_ns: int | None
    runs: int
    minor_faults: int
    major_faults: int


# The raw readings for `ThreadCounts`: the clock, `schedstat`, processor time, and `getrusage`.
RawCounts = tuple[int, bytes, int, struct_rusage]


class ThreadCounters:
    """
    A reader of the counters of the thread that creates it, in 1.5 µs; files are opened once.

    See proc(5) for `/proc/PID/task/TID/schedstat`. The thread's own clock is not read where that
    file exists: reading it lets the kernel notice that a short time slice is used up and give the
    processor to other threads.
    """

    def __init__(self) -> None:
        self._schedule = _opened(f'/proc/self/task/{threading.get_native_id()}/schedstat')
        self._stat = _opened('/proc/stat')
        if self._schedule is not None and len(os.pread(self._schedule, _LINE, 0).split()) < 3:
            os.close(self._schedule)
            self._schedule = None
        self.tells_waiting = self._schedule is not None

    def read(self) -> RawCounts:
        """Read all counters that a step needs, for `counts_of`."""
        if self._schedule is None:
            return (time.monotonic_ns(), b'', time.thread_time_ns(), getrusage(RUSAGE_THREAD))
        schedule = os.pread(self._schedule, _LINE, 0)
        return time.monotonic_ns(), schedule, 0, getrusage(RUSAGE_THREAD)

    def stolen(self) -> bytes:
        """Read the text for `stolen_between`, in 3 µs plus 1 µs for each further processor."""
        return b'' if self._stat is None else os.pread(self._stat, _STAT, 0)

    def close(self) -> None:
        """Close the files."""
        for descriptor in (self._schedule, self._stat):
            if descriptor is not None:
                os.close(descriptor)
        self._schedule = self._stat = None


def counts_of(raw: RawCounts) -> ThreadCounts:
    """Return the counters from raw readings."""
    wall_ns, schedule, computed_ns, usage = raw
    fields = [int(field) for field in schedule.split()]
    computed_ns, waited_ns, runs = fields[:3] if fields else (computed_ns, None, 0)
    return ThreadCounts(wall_ns, computed_ns, waited_ns, runs, usage.ru_minflt, usage.ru_majflt)


def _opened(path: str) -> int | None:
    """Open a file for reading; return None where this kernel lacks it."""
    with suppress(OSError):
        return os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    return None


def stolen_between(before: bytes, after: bytes) -> int:
    """
    Return the least time that the host took from any one processor between two readings [ns].

    It is counted in ticks of 10 ms, of which one may have been due before.

    :param before: of `ThreadCounters.stolen`.
    :param after: the same, later.
    """
    first, last = _stolen_ticks(before), _stolen_ticks(after)
    taken = max((last[name] - first[name] for name in last.keys() & first.keys()), default=0)
    return max(0, taken - 1) * _TICK_NS


def _stolen_ticks(text: bytes) -> dict[bytes, int]:
    """Read the stolen ticks by processor; the line `cpu` itself is their sum."""
    # The last line may have been cut off.
    lines = (line.split() for line in text.split(b'\n')[:-1] if line.startswith(b'cpu'))
    return {fields[0]: int(fields[_STOLEN]) for fields in lines
            if fields[0] != b'cpu' and len(fields) > _STOLEN}


def fault_time_ns() -> float:
    """Measure the duration of a page fault served from memory on this machine [ns]."""
    with mmap.mmap(-1, _PAGES * mmap.PAGESIZE) as fresh:
        began_ns = time.thread_time_ns()
        for page in range(_PAGES):
            fresh[page * mmap.PAGESIZE] = 1
        return (time.thread_time_ns() - began_ns) / _PAGES


def lock_memory() -> bool:
    """
    Lock the pages of this process in memory from their first use.

    :return: whether the system allows it; it requires CAP_IPC_LOCK, or a limit `memlock` in
        /etc/security/limits.d above the whole address space.
    """
    return bool(ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0)


# Numbers of sched_setattr; glibc has no name for it before 2.41.
_CALLS = {'x86_64': 314, 'aarch64': 274}
# struct sched_attr: size, policy, flags, nice, priority, runtime (the slice), deadline, period.
_ATTRIBUTES = struct.Struct('=IIQiIQQQ')
# The kernel's least.
SHORTEST_NS = 100_000


def shorten_time_slice() -> bool:
    """
    Request the shortest time slice for this thread; its policy and niceness stay.

    :return: whether the kernel accepted the call.
    """
    number = _CALLS.get(platform.machine())
    if number is None or os.sched_getscheduler(0) != os.SCHED_OTHER:
        return False
    attributes = _ATTRIBUTES.pack(_ATTRIBUTES.size, os.SCHED_OTHER, 0,
                                  os.getpriority(os.PRIO_PROCESS, 0), 0, SHORTEST_NS, 0, 0)
    return bool(ctypes.CDLL(None).syscall(number, 0, ctypes.c_char_p(attributes), 0) == 0)
