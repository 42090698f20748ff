# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C while one program runs another."""

import os
from pathlib import Path
import signal
import subprocess
import sys

PROGRAM = """
import pathlib, signal, sys, time
def end(*_):
    time.sleep(1.0)
    pathlib.Path(sys.argv[1]).write_text('written')
    sys.exit()
signal.signal(signal.SIGINT, end)
print('runs', flush=True)
signal.pause()
"""
CALLER = """
import sys
from crgame_ros.launcher.interruption import run_to_its_end
run_to_its_end([sys.executable, *sys.argv[1:]])
"""


def test_what_ctrl_c_ends_has_written_its_files(tmp_path: Path) -> None:
    """A terminal signals both; the caller waits for a second, and is interrupted then."""
    caller = subprocess.Popen([sys.executable, '-c', CALLER, '-c', PROGRAM, tmp_path / 'file'],
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              start_new_session=True, text=True)
    assert caller.stdout is not None
    assert caller.stdout.readline() == 'runs\n'
    os.killpg(caller.pid, signal.SIGINT)
    assert 'KeyboardInterrupt' in caller.communicate()[1]
    assert (tmp_path / 'file').read_text() == 'written'
