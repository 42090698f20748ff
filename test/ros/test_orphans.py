# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node that hangs ends, in whatever call: when its parent is gone, or when it was to end."""

from pathlib import Path
import subprocess
import sys
import time

import pytest

SCRIPT = """
import os, signal, time
from crgame_ros.processes import PARENT_VARIABLE
from crgame_ros.ros import node_main
parent = os.getpid()
if (child := os.fork()):
    print(child, flush=True)
    time.sleep(1.0)
    os._exit(0)
node_main._GRACE_S, node_main._LOOK_S = 0.5, 0.1
# As one whose main thread waits for ever does.
signal.signal(signal.SIGTERM, signal.SIG_IGN)
os.environ[PARENT_VARIABLE] = str(parent)
node_main.die_with_parent()
os.close(1)
time.sleep(600.0)
"""


@pytest.mark.exhaustive
def test_a_hanging_node_ends_some_time_after_its_parent() -> None:
    done = subprocess.run([sys.executable, '-c', SCRIPT], capture_output=True, text=True)
    child = Path('/proc') / done.stdout.strip()
    assert done.returncode == 0, done.stderr
    until_s = time.monotonic() + 60.0
    while child.exists() and (child / 'stat').read_text().rpartition(')')[2].split()[0] != 'Z':
        assert time.monotonic() < until_s, 'it lives on'
        time.sleep(0.05)


HANGING = """
import ctypes
from crgame_ros.ros import node_main
node_main._RELEASE_S = 0.5

class Node:
    def run(self, stop):
        pass

    def destroy_node(self):
        # As Fast DDS, without giving way to other threads of Python.
        ctypes.PyDLL(None).sleep(600)

node_main.run_node(Node)
"""


def test_a_node_that_cannot_release_its_endpoints_ends_and_tells_where() -> None:
    done = subprocess.run([sys.executable, '-c', HANGING], capture_output=True, text=True)
    assert done.returncode == 1
    assert 'in destroy_node' in done.stderr
