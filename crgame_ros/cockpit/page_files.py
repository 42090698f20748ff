# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of the page's files, read once: a request names a key of it, never a path."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
import gzip
import hashlib
from pathlib import Path
import posixpath
import re

from crgame_ros.errors import CrgameError
from crgame_ros.page_libraries import find_libraries, PLOTLY, THREE_SCRIPTS
from crgame_ros.paths import page_directory
from crgame_ros.type_stripping import strip_types

INDEX = '/'
# The libraries by request path: '/three/three.module.js' imports the other script of three.js
# by its relative path.
LIBRARIES = {'/plotly.js': PLOTLY, **{f'/three/{name}': name for name in THREE_SCRIPTS}}
TYPES = {'.html': 'text/html', '.css': 'text/css', '.js': 'text/javascript',
         '.ts': 'text/javascript', '.svg': 'image/svg+xml', '.png': 'image/png'}
_HTML, _SCRIPT = TYPES['.html'], TYPES['.js']
# Of our own pages, in which a statement begins a line; imports of types are none in the browser.
_ENTRY = re.compile(rb'<script type="module" src="([^"]+)"')
_IMPORT = re.compile(rb"^(?:import|export)(?! type\b)(?: [^'\";]*? from)? '(\.[^']+)'",
                     re.MULTILINE)


@dataclass(frozen=True)
class PageFile:
    """
    A served file.

    :param source: its content as stored.
    :param content_type: content type without the character set.
    :param typescript: name of a file of TypeScript; empty for any other.
    """

    source: bytes
    content_type: str
    typescript: str = ''

    @cached_property
    def body(self) -> bytes:
        """
        Return its content for browsers.

        Types are taken out when it is first wanted: for all files at the start of a run they would
        cost 0.2 s.

        :raises CrgameError: if they cannot be taken out.
        """
        return strip_types(self.source, self.typescript) if self.typescript else self.source

    @cached_property
    def packed(self) -> bytes:
        """
        Return the same by gzip (RFC 1952): a page is a quarter of its size.

        :raises CrgameError: as `body` does.
        """
        return gzip.compress(self.body, mtime=0)

    @cached_property
    def tag(self) -> str:
        """Return a text that changes with the content."""
        return hashlib.sha256(self.source).hexdigest()[:32]

    @property
    def is_text(self) -> bool:
        """Return whether it is text, whose character set is UTF-8."""
        return self.content_type != 'image/png'


def read_page(directory: Path | None = None) -> Mapping[str, PageFile]:
    """
    Read all files of the page.

    :param directory: the folder with index.html; None for that of the cockpit.
    :return: files by request path.
    :raises CrgameError: if the page is not installed.
    """
    directory = directory or page_directory() / 'cockpit'
    table = read_files(directory, '/static/')
    index = table.pop('/static/index.html', None)
    if index is None:
        raise CrgameError(f'{directory}: the page of the cockpit is missing; '
                          'install crgame_ros again')
    return {**table, INDEX: index}


def read_library(path: str) -> PageFile | None:
    """
    Read a library script, which may be downloaded while the cockpit runs.

    :param path: request path.
    :return: None if the path is not one of LIBRARIES or they are not downloaded.
    """
    folder = find_libraries() if path in LIBRARIES else None
    return None if folder is None else _read(folder / LIBRARIES[path])


def read_files(directory: Path, prefix: str) -> dict[str, PageFile]:
    """
    Read all files of a folder that can be part of a page, TypeScript as JavaScript.

    :param prefix: prefix of their request paths.
    :return: files by request path.
    """
    paths = [path for path in sorted(directory.rglob('*'))
             if path.suffix in TYPES and path.is_file() and not path.name.endswith('.d.ts')]
    return _with_preloads({prefix + _served_name(path.relative_to(directory)): _read(path)
                           for path in paths})


def _with_preloads(table: dict[str, PageFile]) -> dict[str, PageFile]:
    """
    Let each page name all scripts that it begins with.

    A browser then fetches them at once, instead of finding each only in the one that imports it.
    """
    return {path: replace(file, source=_ENTRY.sub(
        lambda found: b''.join(b'<link rel="modulepreload" href="%s">\n  ' % script.encode()
                               for script in _imported(table, found[1].decode())) + found[0],
        file.source)) if file.content_type == _HTML else file for path, file in table.items()}


def _imported(table: Mapping[str, PageFile], entry: str) -> list[str]:
    """Return the paths of all scripts that one imports, and that these import."""
    found, rest = [entry], [entry]
    while rest:
        script = rest.pop()
        if script in table and table[script].content_type == _SCRIPT:
            for name in _IMPORT.findall(table[script].source):
                path = posixpath.normpath(posixpath.join(posixpath.dirname(script),
                                                         name.decode()))
                if path not in found:
                    found.append(path)
                    rest.append(path)
    return found[1:]


def _served_name(path: Path) -> str:
    return (path.with_suffix('.js') if path.suffix == '.ts' else path).as_posix()


def _read(path: Path) -> PageFile:
    return PageFile(path.read_bytes(), TYPES[path.suffix],
                    path.name if path.suffix == '.ts' else '')
