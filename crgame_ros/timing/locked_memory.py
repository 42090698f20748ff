# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keeping the loop's memory: pages that the system took back cost a wait for a disk."""

import ctypes

# Of sys/mman.h: what is there, what will be, each from its first use on.
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4


def lock_memory() -> bool:
    """
    Ask for the pages of this process, as it comes to use them, to stay in memory.

    :return: whether the system does; it asks for CAP_IPC_LOCK, or for a limit `memlock` in
        /etc/security/limits.d above the whole address space.
    """
    return bool(ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0)
