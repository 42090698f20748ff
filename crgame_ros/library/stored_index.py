# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The user's cache: the entries of places, which can be made again, and files of archives."""

from collections.abc import Mapping
import contextlib
import hashlib
import json
import os
from pathlib import Path, PurePosixPath
import re
from typing import Any, NamedTuple

from crgame_ros.paths import make_folder, user_directory
from crgame_ros.whole_file import write_bytes, write_whole

FORMAT = 1
_DIGITS = 16
# Of a scenario file, also within an archive.
MAX_BYTES = 64 * 2 ** 20
# Of a place: beyond it, the user has most likely named another folder than the one meant.
MOST_FILES = 200_000
# The root element begins within so many bytes.
HEAD_BYTES = 8192
_ROOT = re.compile(rb'<commonRoad\s[^>]*')
_ID = re.compile(rb'\sbenchmarkID\s*=\s*["\']([^"\']{1,200})["\']')


def cache_folder() -> Path:
    """Return the folder of indexes and of files out of archives."""
    return user_directory('cache') / 'scenarios'


def load_index(place: Path) -> dict[str, Any]:
    """Read what is known of a place; empty if that is nothing, or cannot be read."""
    try:
        found = json.loads(_index_file(place).read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    known = isinstance(found, dict) and found.get('format') == FORMAT \
        and found.get('place') == str(place)
    return found['content'] if known and isinstance(found['content'], dict) else {}


def save_index(place: Path, content: Mapping[str, object]) -> None:
    """Write what is known of a place, if the cache can be written."""
    file = _index_file(place)
    text = json.dumps({'format': FORMAT, 'place': str(place), 'content': content},
                      separators=(',', ':'))
    # Without a cache, places are only slower.
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(text.encode(), file)


def drop_index(place: Path) -> None:
    """Remove what is known of a place."""
    with contextlib.suppress(OSError):
        _index_file(place).unlink(missing_ok=True)


def digest_of(content: bytes) -> str:
    """Return the digest under which a file out of an archive is kept."""
    return hashlib.sha256(content).hexdigest()


def kept_file(digest: str, name: str) -> Path:
    """Return the path of a file out of an archive; its folder names the content."""
    return cache_folder() / 'files' / digest[:_DIGITS] / f'{name}.xml'


def keep_file(content: bytes, name: str) -> Path:
    """
    Keep a file out of an archive.

    :param name: its name without ending, and without folders.
    :return: its path.
    :raises InputError: if it cannot be written.
    """
    path = kept_file(digest_of(content), name)
    try:
        if path.stat().st_size == len(content):
            return path
    except OSError:
        pass
    make_folder(path.parent, 'set XDG_CACHE_HOME to a folder that can be written')
    write_bytes(content, path)
    return path


def is_kept(path: Path) -> bool:
    """Return whether a file lies in the cache, and may so be gone tomorrow."""
    return path.resolve().is_relative_to(cache_folder().resolve())


def _index_file(place: Path) -> Path:
    digest = hashlib.sha256(os.fsencode(place)).hexdigest()[:_DIGITS]
    return cache_folder() / f'index-{digest}.json'


class Entry(NamedTuple):
    """
    A scenario.

    :param place: folder or archive that holds it.
    :param name: its path there, of any origin: it is compared and shown, never opened as a path
        where it comes from an archive.
    :param header_id: benchmark id in the file; empty if it has none.
    """

    place: Path
    name: str
    header_id: str

    @property
    def id(self) -> str:  # noqa: A003
        """Return the id by which it is looked up first: the file's name without its ending."""
        return PurePosixPath(self.name).name[:-len('.xml')].removesuffix('.cr')


def may_be_scenario(name: str, size: int) -> bool:
    """Return whether a file may be a scenario, by its name and its size in bytes."""
    return name.lower().endswith('.xml') and 0 < size <= MAX_BYTES


def id_in_file(path: Path) -> str | None:
    """
    Return the benchmark id in a file, as `header_id`.

    :raises OSError: if it cannot be read.
    """
    with path.open('rb') as stream:
        return header_id(stream.read(HEAD_BYTES))


def header_id(head: bytes) -> str | None:
    """
    Return the benchmark id in the first bytes of a file.

    :return: None for a file that is no CommonRoad scenario; empty for one without an id.
    """
    root = _ROOT.search(head)
    if root is None:
        return None
    found = _ID.search(root.group())
    return '' if found is None else found[1].decode('utf-8', 'replace').strip()
