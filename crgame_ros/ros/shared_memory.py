# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shared-memory ports that killed processes left half-made, on which others wait for ever."""

from pathlib import Path
import re
import time

SHARED_MEMORY = Path('/dev/shm')
PORT = re.compile(r'fastrtps_port\d+')
# Fast DDS 2.14 makes a port with boost's managed_open_or_create, which keeps a state in the first
# four bytes: 0 uninitialised, 1 being initialised, 2 initialised, 3 corrupted. Who opens a port
# that is not initialised waits for its maker, alive or not.
INITIALISED = (2).to_bytes(4, 'little')
# Far longer than making a port takes on a busy machine [s].
PATIENCE_S = 2.0
LOOK_S = 0.05


def remove_half_made_ports(folder: Path = SHARED_MEMORY) -> list[str]:
    """
    Remove the ports that nobody will ever finish; wait for those that may just be in the making.

    The ports of all ROS domains share their names. A process that was killed at the wrong moment
    would keep every later one that comes to its port from starting.

    :param folder: where Fast DDS keeps its ports.
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
                # Gone meanwhile, or another user's, for whom only they can do this.
                continue
        if not any(_is_young(port) for port in half_made):
            break
        time.sleep(LOOK_S)
    return removed


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
