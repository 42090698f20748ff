# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files that are there whole or not at all, whatever ends the process or the machine."""

import os
from pathlib import Path


def write_whole(content: bytes, path: Path) -> None:
    """
    Write a file under another name, and give it its own once the disk has all of it.

    :raises OSError: if it cannot be written; a file that was there before is unchanged.
    """
    temporary = path.with_name(f'.{path.name}.{os.getpid()}.part')
    try:
        with temporary.open('wb') as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(path)
        sync_folder(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def sync_folder(folder: Path) -> None:
    """
    Let the disk have the names of the files in a folder: without it a power cut may take them.

    :raises OSError: if the folder cannot be read.
    """
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
