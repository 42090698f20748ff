# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run's files as one archive, made while it is sent: nothing of it lies in memory or on disk."""

from collections.abc import Iterator, Mapping
from pathlib import Path
import zipfile

_CHUNK_BYTES = 256 * 1024


class _Pending:
    """What has been written and not yet been sent; it cannot be sought in."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def write(self, data: bytes, /) -> int:
        self._parts.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Do nothing: what is written is there."""

    def close(self) -> None:
        """Do nothing: who sends it knows its end."""

    def take(self) -> bytes:
        data = b''.join(self._parts)
        self._parts.clear()
        return data


def zip_chunks(name: str, files: Mapping[str, Path]) -> Iterator[bytes]:
    """
    Pack files.

    :param name: of the folder in the archive.
    :param files: by their names in that folder.
    :return: the archive, piece by piece; a file that has gone meanwhile is left out.
    """
    pending = _Pending()
    # Recordings are compressed already.
    with zipfile.ZipFile(pending, 'w', zipfile.ZIP_STORED) as archive:
        for inside, path in files.items():
            try:
                source = path.open('rb')
            except OSError:
                continue
            entry = zipfile.ZipInfo.from_file(path, f'{name}/{inside}', strict_timestamps=False)
            with source, archive.open(entry, 'w', force_zip64=True) as target:
                while data := source.read(_CHUNK_BYTES):
                    target.write(data)
                    yield pending.take()
    yield pending.take()
