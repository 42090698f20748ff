# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Streams stay on this machine unless the game opens them; what is missing is told in one line."""

import os
from pathlib import Path
import subprocess
import sys

import pytest

# liblsl reads its settings once in a process.
SERVE = """
import os, socket, sys
from crgame_ros.game.instruments_spec import InstrumentsSpec
from crgame_ros.instruments.outlets import configure, Outlet
from crgame_ros.instruments.outlets import MARKERS
local = sys.argv[1] == 'machine'
configure(InstrumentsSpec(True, scope=sys.argv[1]))
outlet = Outlet(MARKERS, '7', local)
for entry in os.listdir('/proc/self/fd'):
    try:
        own = socket.socket(fileno=os.dup(int(entry)))
    except OSError:
        continue
    if own.family in (socket.AF_INET, socket.AF_INET6):
        device = own.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
        print(own.type.name, device.rstrip(b'\\0').decode() or 'any')
"""


def test_nothing_listens_beyond_the_loopback() -> None:
    """Each server of a stream, for its data, times and queries, is on the device lo."""
    pytest.importorskip('pylsl', reason='the extra `instruments` is not installed')
    done = subprocess.run([sys.executable, '-c', SERVE, 'machine'], capture_output=True,
                          text=True, check=True)
    lines = done.stdout.split('\n')[:-1]
    assert {'SOCK_STREAM lo', 'SOCK_DGRAM lo'} == set(lines)


@pytest.mark.parametrize(('module', 'said'), [
    ('raise RuntimeError("LSL binary library file was not found.")', 'cannot load liblsl'),
    ('', '')])
def test_a_wheel_without_the_library_is_one_line(tmp_path: Path, module: str, said: str) -> None:
    """Of platforms for which pylsl has no wheel, it comes without liblsl."""
    (tmp_path / 'pylsl').mkdir()
    (tmp_path / 'pylsl' / '__init__.py').write_text(module)
    done = subprocess.run(
        [sys.executable, '-c', 'from crgame_ros.game.instruments_spec import InstrumentsSpec\n'
         'from crgame_ros.instruments.extra import require_instruments\n'
         'from crgame_ros.errors import InputError\n'
         'try:\n    require_instruments(InstrumentsSpec(True))\n'
         'except InputError as error:\n    print(error)'],
        env=os.environ | {'PYTHONPATH': os.pathsep.join(
            (str(tmp_path), os.environ.get('PYTHONPATH', '')))},
        capture_output=True, text=True, check=True)
    assert said in done.stdout
    assert done.stdout.count('\n') == bool(said)
