# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Places that cannot be written to: refused in one line, before the work, and nothing is left."""

import os
from pathlib import Path
import resource
import shutil
import subprocess
import sys

from crgame_ros.paths import default_game, scenarios_directory
import pytest

ROADS = scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml'
COMMANDS = {
    'offline': ('offline', default_game(), '--duration', '0.3', '--out'),
    'run': ('run', default_game(), '--headless', '--duration', '0.3', '--out'),
    'rasterize': ('rasterize', ROADS), 'roads': ('roads', ROADS)}
NAMES = {'roads': 'r.csv', 'offline': 'run.xml'}


def refusal(command: str, out: Path, full: bool = False) -> str:
    """Run a command, on a full disk if asked for, and return the one line that it prints."""
    def fill() -> None:
        # No file may grow: to a program this is a full disk, or a quota that is used up.
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    done = subprocess.run(
        [sys.executable, '-m', 'crgame_ros.cli', *map(str, COMMANDS[command]), str(out)],
        capture_output=True, text=True, timeout=60, check=False,
        preexec_fn=fill if full else None,
        # Coverage of the command would write a file.
        env={name: value for name, value in os.environ.items() if not name.startswith('COV_')})
    told = [line for line in done.stderr.splitlines() if not line.startswith('note: ')]
    assert done.returncode in (1, 2) and done.stdout == '', done
    assert len(told) == 1 and told[0].startswith('error: ') and len(told[0]) < 500, told
    assert str(out.parent if out.suffix == '.xml' else out) in told[0]
    return told[0]


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize('command', COMMANDS)
def test_a_full_disk_is_told_at_the_start(command: str, tmp_path: Path) -> None:
    """It is refused at the start, not after the run; no half-made file or folder stays."""
    out = tmp_path / NAMES.get(command, 'out')
    told = refusal(command, out, full=True)
    assert 'File too large' in told
    assert not out.exists() or not any(out.iterdir())


@pytest.mark.exhaustive
@pytest.mark.skipif(shutil.which('mount') is None, reason='no mount')
@pytest.mark.parametrize('command', COMMANDS)
def test_a_file_system_without_room(command: str, tmp_path: Path) -> None:
    """The same on a file system that is really full."""
    place = tmp_path / 'small'
    place.mkdir()
    if subprocess.run(['mount', '-t', 'tmpfs', '-o', 'size=64k', 'tmpfs', str(place)],
                      capture_output=True, check=False).returncode:
        pytest.skip('only root may mount')
    try:
        (place / 'filling').write_bytes(bytes(64 << 10))
        told = refusal(command, place / NAMES.get(command, 'out'))
        assert 'No space left on device' in told
    finally:
        subprocess.run(['umount', str(place)], check=True)


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize('command', COMMANDS)
@pytest.mark.parametrize('name', ['file', 'file/below', 'file.xml', 'folder.xml'])
def test_something_else_in_the_way_is_told_at_the_start(
        command: str, name: str, tmp_path: Path) -> None:
    """An existing file is never overwritten, and a folder is never taken for a file."""
    if name == 'folder.xml':
        if command in ('run', 'rasterize', 'roads'):
            pytest.skip('to these it is a folder like any other, or no such file')
        (tmp_path / name).mkdir()
    else:
        (tmp_path / name.split('/')[0]).write_text('mine')
    out = tmp_path / name
    if command == 'roads':
        out = out.with_name(f'{out.name}.csv')
        if '/' not in name:
            out.write_text('mine')
    refusal(command, out)
    assert all(path.read_text() == 'mine' for path in tmp_path.iterdir() if path.is_file())
