# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files by what they hold: they travel with the cells, and nothing is read from elsewhere."""

from collections.abc import Mapping
import hashlib
import os
from pathlib import Path
import re
import tempfile
from typing import NamedTuple
import zlib

from crgame_ros.errors import InputError
from crgame_ros.recording.export import write_bytes

# How a game names a file of the store: its digest, and the name that it had.
PREFIX = 'content:'
DIGEST_DIGITS = 32
_DIGEST = re.compile(rf'{PREFIX}([0-9a-f]{{{DIGEST_DIGITS}}})/')


class Content(NamedTuple):
    """
    A file, with those beside it that it names.

    :param name: of the file that is meant.
    :param files: what each file holds, by its name in the same folder.
    """

    name: str
    files: Mapping[str, bytes]

    @property
    def digest(self) -> str:
        """Name what it holds: SHA-256 over names and bytes, shortened."""
        total = hashlib.sha256(self.name.encode())
        for name, data in sorted(self.files.items()):
            total.update(f'\0{name}\0{len(data)}\0'.encode() + data)
        return total.hexdigest()[:DIGEST_DIGITS]

    @property
    def reference(self) -> str:
        """Return the text that stands for the file in a game."""
        return f'{PREFIX}{self.digest}/{self.name}'


def digests_in(text: str) -> set[str]:
    """Find which contents a text refers to."""
    return set(_DIGEST.findall(text))


def resolved(text: str, folder: Path) -> str:
    """Let a text name the files that references stand for, in the folder of a store."""
    return _DIGEST.sub(lambda match: f'{folder / match[1]}/', text)


class ContentStore:
    """
    A folder with contents, each in a folder named by its digest.

    :param folder: is made when something is put into it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def put(self, content: Content) -> str:
        """
        Keep a content; what is there already is left.

        :return: its digest.
        :raises InputError: if it cannot be written.
        """
        digest = content.digest
        place = self.folder / digest
        if place.is_dir():
            return digest
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=self.folder, prefix='.part-') as part:
                whole = Path(part) / digest
                whole.mkdir()
                for name, data in content.files.items():
                    write_bytes(data, whole / name)
                # Another process may have been faster: then it is there.
                if not place.is_dir():
                    _rename(whole, place)
        except OSError as error:
            raise InputError(f'cannot be written ({error.strerror})', str(place),
                             'choose a folder that can be written, on a disk with room') from error
        return digest

    def packed(self, digest: str) -> dict[str, bytes]:
        """
        Return what a content holds, file by file, compressed for its way to a worker.

        :raises InputError: if it is not there.
        """
        try:
            return {path.name: zlib.compress(path.read_bytes(), 6)
                    for path in sorted((self.folder / digest).iterdir())}
        except OSError as error:
            raise InputError(f'a file of the evaluation cannot be read ({error.strerror})',
                             str(self.folder / digest), 'start the evaluation anew in another '
                             'folder') from error

    def unpack(self, digest: str, packed: Mapping[str, bytes]) -> None:
        """Keep what `packed` gave; what is there already is left."""
        if not (self.folder / digest).is_dir():
            files = {name: zlib.decompress(data) for name, data in packed.items()}
            found = next((Content(name, files) for name in files
                          if Content(name, files).digest == digest), None)
            if found is None:
                raise InputError('is not what its name says', f'content {digest}',
                                 'start the evaluation again')
            self.put(found)


def _rename(whole: Path, place: Path) -> None:
    try:
        os.rename(whole, place)
    except OSError:
        if not place.is_dir():
            raise
