# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scenarios in a folder and in those inside it, read again only where something changed."""

from collections.abc import Callable, Iterator
import contextlib
import os
from pathlib import Path
import stat
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.library.entry import Entry, HEAD_BYTES, header_id, may_be_scenario, MOST_FILES
from crgame_ros.library.stored_index import digest_of, load_index, save_index

# Of a file: time of its last change [ns], size [bytes], id in it (None for no scenario).
Row = list[Any]


class FolderIndex:
    """
    The scenarios of a folder.

    :param place: the folder.
    """

    def __init__(self, place: Path) -> None:
        self.place = place

    def entries(self, *, trusting: bool,
                tell: Callable[[int], object] = lambda _: None) -> list[Entry]:
        """
        Return the scenarios in the order of their paths.

        :param trusting: whether a folder whose time of change is the known one is not read. That
            time tells of files that come and go, not of a change within the clock's resolution.
        :param tell: called with the number of files seen so far.
        :raises InputError: if the folder cannot be read, or holds too many files.
        """
        before = load_index(self.place)
        after: dict[str, Any] = {}
        count = 0
        pending = ['']
        while pending:
            name = pending.pop()
            folder = self._folder(name, before.get(name), trusting)
            if folder is None:
                continue
            after[name] = folder
            count += len(folder['files'])
            if count > MOST_FILES:
                raise InputError(f'holds more than {MOST_FILES} XML files', str(self.place),
                                 'name the folder with the scenarios')
            tell(count)
            pending += [f'{name}{inside}/' for inside in folder['folders']]
        if after != before:
            save_index(self.place, after)
        return [Entry(self.place, f'{folder}{name}', row[2]) for folder in sorted(after)
                for name, row in sorted(after[folder]['files'].items()) if row[2] is not None]

    def path_of(self, entry: Entry) -> Path:
        """Return the path of a scenario."""
        return self.place / entry.name

    def digest_of(self, entry: Entry) -> str:
        """
        Return the digest of a scenario's content.

        :raises InputError: if it cannot be read.
        """
        path = self.path_of(entry)
        try:
            return digest_of(path.read_bytes())
        except OSError as error:
            raise InputError(f'cannot be read ({error.strerror})', str(path),
                             'check the permissions') from error

    def is_current(self, entry: Entry) -> bool:
        """Return whether a scenario is still there, with the same id in it."""
        try:
            return _header(self.path_of(entry)) == entry.header_id
        except OSError:
            return False

    def _folder(self, name: str, before: Any, trusting: bool) -> dict[str, Any] | None:
        """Return the files and folders of a folder; None if it cannot be read."""
        path = self.place / name
        try:
            changed_ns = path.stat().st_mtime_ns
            if trusting and before and before['changed_ns'] == changed_ns:
                return dict(before)
            files, folders = self._read(path, before['files'] if before else {})
        except OSError as error:
            if name:
                return None
            raise InputError(f'cannot be read ({error.strerror})', str(path),
                             'check the folder, or remove it: crgame scenarios remove') from error
        return {'changed_ns': changed_ns, 'files': files, 'folders': sorted(folders)}

    def _read(self, path: Path, known: dict[str, Row]) -> tuple[dict[str, Row], list[str]]:
        files: dict[str, Row] = {}
        folders: list[str] = []
        for item in _visible(path):
            if item.is_dir(follow_symlinks=False):
                folders.append(item.name)
            elif item.name.lower().endswith('.xml'):
                # A file that cannot be read is not there.
                with contextlib.suppress(OSError):
                    status = item.stat()
                    if not (stat.S_ISREG(status.st_mode)
                            and may_be_scenario(item.name, status.st_size)):
                        continue
                    stamp = [status.st_mtime_ns, status.st_size]
                    row = known.get(item.name)
                    files[item.name] = row if row is not None and row[:2] == stamp else [
                        *stamp, _header(Path(item.path))]
        return files, folders


def _visible(path: Path) -> Iterator['os.DirEntry[str]']:
    with os.scandir(path) as items:
        for item in items:
            # Names that are no text could not be stored; .git and the like hold no scenarios.
            if not item.name.startswith('.') and item.name.isprintable():
                yield item


def _header(path: Path) -> str | None:
    with path.open('rb') as stream:
        return header_id(stream.read(HEAD_BYTES))
