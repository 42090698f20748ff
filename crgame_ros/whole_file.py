# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writing files and folders that are complete or absent, even if the machine stops."""

from collections.abc import Iterator
from contextlib import contextmanager
import glob
import os
from pathlib import Path
import shutil

from crgame_ros.errors import refusing


def write_text(text: str, path: Path) -> None:
    """
    Write a file completely or not at all.

    :raises InputError: if it cannot be written; an existing file is unchanged.
    """
    write_bytes(text.encode(), path)


def write_bytes(content: bytes, path: Path) -> None:
    """Write a file as `write_text` does."""
    with refusing('cannot be written', path, 'choose a folder that can be written'):
        write_whole(content, path)


def write_whole(content: bytes, path: Path) -> None:
    """
    Write a file completely or not at all.

    :raises OSError: if it cannot be written; an existing file is unchanged.
    """
    with whole_file(path) as part:
        part.write_bytes(content)


@contextmanager
def whole_file(path: Path, suffix: str = '.part') -> Iterator[Path]:
    """
    Yield the name under which to write a file, which is renamed once all of it is on the disk.

    :param suffix: of that name.
    :raises OSError: if it cannot be written; an existing file is unchanged.
    """
    part = part_of(path, suffix)
    try:
        yield part
        name_whole(part, path)
    finally:
        part.unlink(missing_ok=True)


def name_whole(part: Path, path: Path) -> None:
    """
    Give a file that has been written its name, once all of it is on the disk.

    :raises OSError: if it cannot be renamed; an existing file is unchanged.
    """
    _sync(part, os.O_RDONLY)
    part.replace(path)
    sync_folder(path.parent)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """
    Yield a folder of the same name elsewhere, which is moved to its place once all is written.

    The files in it must be on the disk by then.

    :param path: of the folder; an earlier one there is replaced.
    :raises OSError: if it cannot be written; an earlier folder is unchanged.
    """
    part = part_of(path)
    try:
        # What a process with the same number has left is not this one's.
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir()
        yield part / path.name
        before = part / 'before'
        if path.exists():
            path.rename(before)
        try:
            (part / path.name).rename(path)
        except OSError:
            if before.exists():
                before.rename(path)
            raise
        sync_folder(path.parent)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def part_of(path: Path, suffix: str = '.part') -> Path:
    """
    Return the name under which this process writes a file or folder before it is whole.

    What killed processes have left of the same one is removed.
    """
    for left in path.parent.glob(f'.{glob.escape(path.name)}.*{suffix}'):
        pid = left.name.removesuffix(suffix).rpartition('.')[2]
        if pid.isdecimal() and not Path('/proc', pid).exists():
            if left.is_dir():
                shutil.rmtree(left, ignore_errors=True)
            else:
                left.unlink(missing_ok=True)
    return path.with_name(f'.{path.name}.{os.getpid()}{suffix}')


def sync_folder(folder: Path) -> None:
    """
    Write the names of the files in a folder to the disk, as a power cut may lose them otherwise.

    :raises OSError: if the folder cannot be read.
    """
    _sync(folder, os.O_RDONLY | os.O_DIRECTORY)


def _sync(path: Path, flags: int) -> None:
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
