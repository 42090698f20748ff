# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The scenarios of a place: in a folder and those inside it, or in an archive.

Nothing is unpacked: members are read into memory, up to the size of a scenario, and the one asked
for is kept in the user's cache under the digest of its content. A member's name is never a path.
"""

from collections.abc import Iterator
import contextlib
from contextlib import contextmanager
import gzip
import os
from pathlib import Path
import stat
import tarfile
from typing import Any, IO, NamedTuple
import zipfile
import zlib

from crgame_ros.errors import InputError, refusing
from crgame_ros.library.stored_index import (
    digest_of,
    Entry,
    HEAD_BYTES,
    header_id,
    id_in_file,
    keep_file,
    kept_file,
    load_index,
    MAX_BYTES,
    may_be_scenario,
    MOST_FILES,
    save_index,
)

# Of a file: time of its last change [ns], size [bytes], id in it (None for no scenario).
Row = list[Any]
# What a compressed tar may hold: all of it is decompressed to find the members [bytes].
_MOST_BYTES = 64 * 2 ** 30
_ENCRYPTED = 1


class FolderIndex:
    """The scenarios of a folder."""

    def __init__(self, place: Path) -> None:
        self.place = place

    def entries(self, *, trusting: bool) -> list[Entry]:
        """
        Return the scenarios in the order of their paths.

        :param trusting: whether a folder whose time of change is the known one is not read. That
            time tells of files that come and go, not of a change within the clock's resolution.
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
        with refusing('cannot be read', path, 'check the permissions'):
            return digest_of(path.read_bytes())

    def is_current(self, entry: Entry) -> bool:
        """Return whether a scenario is still there, with the same id in it."""
        try:
            return id_in_file(self.path_of(entry)) == entry.header_id
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
                        *stamp, id_in_file(Path(item.path))]
        return files, folders


def _visible(path: Path) -> Iterator['os.DirEntry[str]']:
    with os.scandir(path) as items:
        for item in items:
            # Names that are no text could not be stored; .git and the like hold no scenarios.
            if not item.name.startswith('.') and item.name.isprintable():
                yield item


class _Row(NamedTuple):
    """
    What is known of a member.

    :param header_id: benchmark id in it.
    :param digest: of its content; empty where the archive lets one member be read alone.
    :param offset: of its content in the unpacked tar [bytes]
    :param size: [bytes]
    """

    header_id: str
    digest: str
    offset: int
    size: int


class ArchiveIndex:
    """The scenarios of an archive: .zip, .tar, .tar.gz or .tgz."""

    def __init__(self, place: Path) -> None:
        self.place = place
        self._rows: dict[str, _Row] = {}

    def entries(self, *, trusting: bool) -> list[Entry]:
        """
        Return the scenarios in the order of their names.

        They are read again if time of change or size of the archive differ.

        :param trusting: for folders; an archive is always believed by its time and size.
        :raises InputError: if the archive cannot be read, or holds too much.
        """
        with self._readable():
            status = self.place.stat()
            stamp = [status.st_mtime_ns, status.st_size]
            known = load_index(self.place)
            if known.get('stamp') != stamp:
                read = self._zipped if self._is_zip else self._tarred
                known = {'stamp': stamp, 'members': dict(read())}
                save_index(self.place, known)
        self._rows = {name: _Row(*row) for name, row in known['members'].items()}
        return [Entry(self.place, name, row.header_id)
                for name, row in sorted(self._rows.items())]

    def path_of(self, entry: Entry) -> Path:
        """
        Return the path of a scenario's copy in the user's cache.

        :raises InputError: if it cannot be read or written.
        """
        digest = self._rows[entry.name].digest
        if digest and (kept := kept_file(digest, entry.id)).is_file():
            return kept
        return keep_file(self._content(entry), entry.id)

    def digest_of(self, entry: Entry) -> str:
        """
        Return the digest of a scenario's content.

        :raises InputError: if it cannot be read.
        """
        return self._rows[entry.name].digest or digest_of(self._content(entry))

    def _content(self, entry: Entry) -> bytes:
        row = self._rows[entry.name]
        with self._readable():
            if self._is_zip:
                with zipfile.ZipFile(self.place) as archive, archive.open(entry.name) as stream:
                    return _bounded(stream)
            with self._tar_stream() as stream:
                stream.seek(row.offset)
                return stream.read(row.size)

    def is_current(self, entry: Entry) -> bool:
        """Return whether a scenario is still there: its archive was just compared."""
        return entry.name in self._rows

    @property
    def _is_zip(self) -> bool:
        return self.place.name.lower().endswith('.zip')

    def _zipped(self) -> Iterator[tuple[str, _Row]]:
        with zipfile.ZipFile(self.place) as archive:
            for number, member in enumerate(archive.infolist()):
                self._check_count(number)
                if member.is_dir() or member.flag_bits & _ENCRYPTED \
                        or not member.filename.isprintable() \
                        or not may_be_scenario(member.filename, member.file_size):
                    continue
                with archive.open(member) as stream:
                    found = header_id(stream.read(HEAD_BYTES))
                if found is not None:
                    yield member.filename, _Row(found, '', 0, member.file_size)

    def _tarred(self) -> Iterator[tuple[str, _Row]]:
        with self._tar_stream() as stream, tarfile.open(fileobj=stream, mode='r:') as archive:
            for number, member in enumerate(archive):
                self._check_count(number)
                if member.offset_data + member.size > _MOST_BYTES:
                    raise InputError(f'holds more than {_MOST_BYTES // 2 ** 30} GiB',
                                     str(self.place), 'unpack it, and name the folder')
                if not member.isreg() or member.issparse() or not member.name.isprintable() \
                        or not may_be_scenario(member.name, member.size):
                    continue
                body = archive.extractfile(member)
                content = b'' if body is None else _bounded(body)
                found = header_id(content[:HEAD_BYTES])
                if found is not None:
                    yield member.name, _Row(found, digest_of(content), member.offset_data,
                                            member.size)

    @contextmanager
    def _tar_stream(self) -> 'Iterator[IO[bytes]]':
        if self.place.name.lower().endswith('.tar'):
            with self.place.open('rb') as stream:
                yield stream
        else:
            with gzip.open(self.place, 'rb') as unpacked:
                yield unpacked  # type: ignore[misc]

    @contextmanager
    def _readable(self) -> Iterator[None]:
        """Turn what archives can raise into one error."""
        try:
            yield
        except (OSError, zipfile.BadZipFile, tarfile.TarError, EOFError, zlib.error, KeyError,
                NotImplementedError, ValueError, RuntimeError) as error:
            said = getattr(error, 'strerror', None) or error
            raise InputError(f'cannot be read as an archive ({said})', str(self.place),
                             'copy the file again, or remove it: crgame scenarios remove'
                             ) from error

    def _check_count(self, number: int) -> None:
        if number >= MOST_FILES:
            raise InputError(f'holds more than {MOST_FILES} files', str(self.place),
                             'unpack it, and name the folder with the scenarios')


def _bounded(stream: IO[bytes]) -> bytes:
    """Return what a member holds, whatever size its header claims."""
    content = stream.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise ValueError(f'a member has more than {MAX_BYTES // 2 ** 20} MiB')
    return content
