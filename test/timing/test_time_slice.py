# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The time slice that the loop asks for, against the kernel's report."""

import ctypes
import os
import platform
import threading

from crgame_ros.timing.thread_counters import shorten_time_slice, SHORTEST_NS
import pytest

pytestmark = pytest.mark.clock

# Numbers of sched_getattr.
NUMBERS = {'x86_64': 315, 'aarch64': 275}
KERNEL = tuple(int(part) for part in platform.release().split('.')[:2])


def time_slice_ns() -> int:
    """Read this thread's slice: the runtime in struct sched_attr, its fourth word [ns]."""
    attributes = (ctypes.c_uint64 * 6)()
    assert ctypes.CDLL(None).syscall(
        NUMBERS[platform.machine()], 0, attributes, ctypes.sizeof(attributes), 0) == 0
    return attributes[3]


def in_a_thread(work: list[object]) -> None:
    """Shorten the slice of a thread that ends, because it is the thread's own."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    work.append(shorten_time_slice())
    work.append(time_slice_ns())
    work.append(os.getpriority(os.PRIO_PROCESS, 0) == before)


@pytest.mark.skipif(platform.machine() not in NUMBERS, reason='another processor')
@pytest.mark.skipif(KERNEL < (6, 12), reason='Linux gives slices to ordinary tasks from 6.12 on')
def test_the_kernel_takes_the_slice_and_nothing_else_changes() -> None:
    here = time_slice_ns()
    work: list[object] = []
    thread = threading.Thread(target=in_a_thread, args=(work,))
    thread.start()
    thread.join()
    assert work == [True, SHORTEST_NS, True]
    assert time_slice_ns() == here != SHORTEST_NS


def test_on_a_processor_without_a_known_number_nothing_happens(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, 'machine', lambda: 'pdp11')
    assert not shorten_time_slice()
