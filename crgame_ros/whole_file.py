# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writing files that are complete or absent, even if the process or the machine stops."""

import glob
import os
from pathlib import Path


def write_whole(content: bytes, path: Path) -> None:
    """
    Write a file under another name, and rename it once all of it is on the disk.

    :raises OSError: if it cannot be written; an existing file is unchanged.
    """
    temporary = part_of(path)
    try:
        with temporary.open('wb') as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(path)
        sync_folder(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def part_of(path: Path) -> Path:
    """
    Return the name under which this process writes a file before it is whole.

    What killed processes have left of the same file is removed.
    """
    for left in path.parent.glob(f'.{glob.escape(path.name)}.*.part'):
        pid = left.name.split('.')[-2]
        if pid.isdecimal() and not Path('/proc', pid).exists():
            left.unlink(missing_ok=True)
    return path.with_name(f'.{path.name}.{os.getpid()}.part')


def sync_folder(folder: Path) -> None:
    """
    Write the names of the files in a folder to the disk, as a power cut may lose them otherwise.

    :raises OSError: if the folder cannot be read.
    """
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
