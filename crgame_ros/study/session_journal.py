# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The journal of a participant's session, line by line, safe against crashes."""

from collections.abc import Iterator
from contextlib import suppress
import fcntl
import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any, IO, Self

from crgame_ros.errors import InputError
from crgame_ros.whole_file import sync_folder

JOURNAL = 'journal.jsonl'


class SessionJournal:
    """
    An append-only file of entries; each is on the disk when `add` returns.

    However the process ends, all lines are complete, except perhaps the last one, which is dropped
    when the file is opened again.

    :param folder: of the participant; created if missing.
    :raises InputError: if it cannot be written, or another process writes there.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / JOURNAL
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file: IO[bytes] = self.path.open('a+b')
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            sync_folder(folder)
            sync_folder(folder.parent)
        except BlockingIOError as error:
            self._file.close()
            raise InputError('this participant takes part already, in another process',
                             str(folder), 'end that one first, or name another participant'
                             ) from error
        except OSError as error:
            raise _refusal(self.path, error) from error
        self.entries = list(self._recovered())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def add(self, entry: dict[str, Any]) -> None:
        """
        Add an entry.

        :raises InputError: if it cannot be written.
        """
        line = json.dumps(entry, ensure_ascii=False, allow_nan=False) + '\n'
        try:
            self._file.write(line.encode('utf-8', 'surrogatepass'))
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise _refusal(self.path, error) from error
        self.entries.append(json.loads(line))

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _recovered(self) -> Iterator[dict[str, Any]]:
        """Read the present entries, and remove a line that was cut off."""
        self._file.seek(0)
        content = self._file.read()
        whole = content[:content.rfind(b'\n') + 1]
        if len(whole) < len(content):
            self._file.truncate(len(whole))
            os.fsync(self._file.fileno())
        for line in whole.splitlines():
            with suppress(ValueError):
                entry = json.loads(line)
                if isinstance(entry, dict):
                    yield entry


def read_journal(folder: Path) -> list[dict[str, Any]]:
    """Read a participant's entries, also while a process adds some."""
    try:
        lines = (folder / JOURNAL).read_bytes().splitlines(keepends=True)
    except FileNotFoundError:
        return []
    entries = []
    for line in lines:
        with suppress(ValueError):
            if line.endswith(b'\n') and isinstance(entry := json.loads(line), dict):
                entries.append(entry)
    return entries


def _refusal(path: Path, error: OSError) -> InputError:
    return InputError(f'cannot be written ({error.strerror})', str(path),
                      'choose a folder that can be written, on a disk with room')
