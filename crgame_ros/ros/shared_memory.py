# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shared memory left by killed processes: half-made ports that block others, and other files."""

from contextlib import suppress
import fcntl
import os
from pathlib import Path
import re
import time

SHARED_MEMORY = Path('/dev/shm')
PORT = re.compile(r'fastrtps_port\d+')
SEGMENT = re.compile(r'fastrtps_[0-9a-f]{16}')
# Fast DDS 2.14 makes a port with boost's managed_open_or_create, which keeps a state in the first
# four bytes: 0 uninitialised, 1 being initialised, 2 initialised, 3 corrupted. A process that
# opens a port that is not initialised waits for its maker, alive or not.
INITIALISED = (2).to_bytes(4, 'little')
# Far longer than making a port takes on a busy machine [s].
PATIENCE_S = 2.0
# The maker of a segment maps and locks it well within this time [s].
YOUNG_S = 60.0
LOOK_S = 0.05


def remove_half_made_ports(folder: Path = SHARED_MEMORY) -> list[str]:
    """
    Remove the ports that will never be finished; wait for those that may still be in the making.

    The ports of all ROS domains share their names. A process killed at the wrong moment would
    block the start of every later one that uses its port.

    :return: names of the ports that were removed
    """
    removed = []
    while half_made := [port for port in _ports(folder) if not _is_initialised(port)]:
        for port in half_made:
            try:
                if time.time() - port.stat().st_mtime > PATIENCE_S:
                    port.unlink()
                    removed.append(port.name)
            except OSError:
                # Gone meanwhile, or owned by another user, who alone can remove it.
                continue
        if not any(_is_young(port) for port in half_made):
            break
        time.sleep(LOOK_S)
    return removed


def remove_stale(folder: Path = SHARED_MEMORY, *, ports: bool = False) -> tuple[int, int]:
    """
    Remove files of Fast DDS whose processes are gone.

    These are files of this user only, which no visible process has mapped and whose lock no
    process holds. The kernel releases both with the process, however that ended.

    :param ports: remove ports too, 50 kB each. Their names are reused: a port that another process
        is just opening would be lost to the others, so the user chooses the moment.
    :return: number of files removed, and their size in shared memory [bytes]
    """
    if not folder.is_dir():
        return 0, 0
    left = [path for path in sorted(folder.iterdir())
            if (SEGMENT.fullmatch(path.name) or ports and PORT.fullmatch(path.name))
            and _is_left(path)]
    # The processes are searched only where a file may be left.
    mapped = _mapped(folder) if left else set()
    count = size = 0
    for path in left:
        if path.name in mapped:
            continue
        # Gone meanwhile, or another user's.
        with suppress(OSError):
            blocks = path.stat().st_blocks
            path.unlink()
            count, size = count + 1, size + 512 * blocks
        for belonging in (*_locks_of(path), path.with_name(f'sem.{path.name}_mutex')):
            with suppress(OSError):
                belonging.unlink()
    return count, size


def _locks_of(path: Path) -> tuple[Path, Path]:
    """Return the lock files of a segment or port, for exclusive and shared access."""
    return path.with_name(f'{path.name}_el'), path.with_name(f'{path.name}_sl')


def _is_left(path: Path) -> bool:
    """Return whether a file is this user's, not young, and no process holds its locks."""
    try:
        found = path.stat()
        return found.st_uid == os.getuid() and time.time() - found.st_mtime >= YOUNG_S \
            and all(_is_free(lock) for lock in _locks_of(path))
    except OSError:
        return False


def _mapped(folder: Path) -> set[str]:
    """Return the names of a folder's files that visible processes have mapped."""
    found: set[str] = set()
    mark = f' {folder}/'
    for process in Path('/proc').iterdir():
        if not process.name.isdecimal():
            continue
        try:
            lines = (process / 'maps').read_text(errors='replace').splitlines()
        except OSError:
            continue
        found.update(line.partition(mark)[2].split(' ')[0] for line in lines if mark in line)
    return found


def _is_free(lock: Path) -> bool:
    """Return whether no process holds a lock file, which may be absent."""
    try:
        descriptor = os.open(lock, os.O_RDONLY | os.O_CLOEXEC)
    except FileNotFoundError:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return True


def _ports(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if PORT.fullmatch(path.name)] \
        if folder.is_dir() else []


def _is_initialised(port: Path) -> bool:
    try:
        with port.open('rb') as file:
            return file.read(len(INITIALISED)) == INITIALISED
    except OSError:
        return True


def _is_young(port: Path) -> bool:
    try:
        return time.time() - port.stat().st_mtime <= PATIENCE_S
    except OSError:
        return False
