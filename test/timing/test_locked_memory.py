# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Memory settings of the loop's process, against the kernel's report."""

import subprocess
import sys

LOCKED = """
from pathlib import Path
from crgame_ros.timing.thread_counters import lock_memory
given = lock_memory()
lines = Path('/proc/self/status').read_text().splitlines()
(locked,) = [int(line.split()[1]) for line in lines if line.startswith('VmLck')]
print(given, locked > 0)
"""


def _said(program: str) -> list[str]:
    return subprocess.run([sys.executable, '-c', program], check=True, capture_output=True,
                          text=True).stdout.split()


def test_memory_is_locked_where_the_system_allows_it() -> None:
    """The report agrees with the kernel, with the privilege or without it."""
    given, locked = _said(LOCKED)
    assert given == locked
