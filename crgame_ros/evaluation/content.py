# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files stored by the digest of their content; workers read no files but these."""

from collections.abc import Mapping
import hashlib
import os
from pathlib import Path
import re
import tempfile
from typing import NamedTuple
import zlib

from crgame_ros.errors import InputError, refusing
from crgame_ros.whole_file import write_bytes

# Prefix of a reference to a file in the store, followed by its digest and its original name.
PREFIX = 'content:'
DIGEST_DIGITS = 32
_DIGEST = re.compile(rf'{PREFIX}([0-9a-f]{{{DIGEST_DIGITS}}})/')


class Content(NamedTuple):
    """
    A file, with the files of its folder that it names or imports.

    :param name: name of the main file.
    :param files: content of each file, by its path in the folder.
    """

    name: str
    files: Mapping[str, bytes]

    @property
    def digest(self) -> str:
        """Return the digest: SHA-256 over names and bytes, shortened."""
        total = hashlib.sha256(self.name.encode())
        for name, data in sorted(self.files.items()):
            total.update(f'\0{name}\0{len(data)}\0'.encode() + data)
        return total.hexdigest()[:DIGEST_DIGITS]

    @property
    def reference(self) -> str:
        """Return the text that refers to the file in a game."""
        return f'{PREFIX}{self.digest}/{self.name}'


def digests_in(text: str) -> set[str]:
    """Return the digests of the contents that a text refers to."""
    return set(_DIGEST.findall(text))


def resolved(text: str, folder: Path) -> str:
    """Replace references in a text by the paths of the files in a store's folder."""
    return _DIGEST.sub(lambda match: f'{folder / match[1]}/', text)


class ContentStore:
    """
    A folder with contents, each in a folder named by its digest.

    :param folder: folder of the store; it is created with the first content.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def put(self, content: Content) -> str:
        """
        Store a content; an existing one is left unchanged.

        :return: its digest.
        :raises InputError: if it cannot be written.
        """
        digest = content.digest
        place = self.folder / digest
        if place.is_dir():
            return digest
        with refusing('cannot be written', place,
                      'choose a folder that can be written, on a disk with room'):
            self.folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=self.folder, prefix='.part-') as part:
                whole = Path(part) / digest
                whole.mkdir()
                for name, data in content.files.items():
                    file = whole / name
                    if not file.resolve().is_relative_to(whole.resolve()):
                        raise InputError('is outside of its folder', name[:200],
                                         'start the evaluation again')
                    file.parent.mkdir(parents=True, exist_ok=True)
                    write_bytes(data, file)
                # Another process may have stored it in the meantime.
                if not place.is_dir():
                    _rename(whole, place)
        return digest

    def packed(self, digest: str) -> dict[str, bytes]:
        """
        Return the files of a content, each compressed for transfer to a worker.

        :raises InputError: if there is no such content.
        """
        place = self.folder / digest
        with refusing('a file of the evaluation cannot be read', place,
                      'start the evaluation anew in another folder'):
            place.stat()
            return {path.relative_to(place).as_posix(): zlib.compress(path.read_bytes(), 6)
                    for path in sorted(place.rglob('*')) if path.is_file()
                    and path.parent.name != '__pycache__'}

    def unpack(self, digest: str, packed: Mapping[str, bytes]) -> None:
        """Store the result of `packed`; an existing content is left unchanged."""
        if not (self.folder / digest).is_dir():
            files = {name: zlib.decompress(data) for name, data in packed.items()}
            found = next((Content(name, files) for name in files
                          if Content(name, files).digest == digest), None)
            if found is None:
                raise InputError('does not match its digest', f'content {digest}',
                                 'start the evaluation again')
            self.put(found)


def _rename(whole: Path, place: Path) -> None:
    try:
        os.rename(whole, place)
    except OSError:
        if not place.is_dir():
            raise
