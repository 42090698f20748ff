# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One scenario of a place, and what its first bytes tell."""

from pathlib import Path, PurePosixPath
import re
from typing import NamedTuple

# Of a scenario file, also within an archive.
MAX_BYTES = 64 * 2 ** 20
# Of a place: beyond it, the user has most likely named another folder than the one meant.
MOST_FILES = 200_000
# The root element begins within so many bytes.
HEAD_BYTES = 8192
_ROOT = re.compile(rb'<commonRoad\s[^>]*')
_ID = re.compile(rb'\sbenchmarkID\s*=\s*["\']([^"\']{1,200})["\']')


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
