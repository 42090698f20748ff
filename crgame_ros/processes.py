# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names of processes, and their end with the process that started them, as Linux offers both."""

import ctypes
import os
import signal
import sys

# Set for a process that is to end with this one: what is started by hand goes on.
PARENT_VARIABLE = 'CRGAME_PARENT_PID'
_PR_SET_PDEATHSIG, _PR_SET_NAME = 1, 15


def end_with_parent() -> int | None:
    """
    End with the parent if it asked for that by `PARENT_VARIABLE`, which children do not inherit.

    :return: the parent's process id if so.
    """
    parent = os.environ.pop(PARENT_VARIABLE, None)
    if parent is None:
        return None
    # By this signal the kernel tells of its death, whatever it died of.
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):
        sys.exit(f'the process {parent} that started this one is gone')
    return int(parent)


def name_process(name: str) -> None:
    """Name this process for `top` and `ps -o comm`, which show the first 15 characters."""
    ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode())
