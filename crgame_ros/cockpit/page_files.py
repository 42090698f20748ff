# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The files of the page, read once: a request names a key of this table, never a path."""

from collections.abc import Mapping
from dataclasses import dataclass
import hashlib
from pathlib import Path

from crgame_ros.cockpit.three_library import find_library, SCRIPTS
from crgame_ros.errors import CrgameError
from crgame_ros.paths import plotly_script

PAGE = Path(__file__).resolve().parent / 'page'
INDEX = '/'
PLOTLY = '/plotly.js'
# Of the 3D view: '/three/three.module.js' imports the other one by its relative path.
THREE = {f'/three/{name}': name for name in SCRIPTS}
TYPES = {'.html': 'text/html', '.css': 'text/css', '.js': 'text/javascript',
         '.svg': 'image/svg+xml', '.png': 'image/png'}


@dataclass(frozen=True)
class PageFile:
    """
    One file as it is served.

    :param body: its content.
    :param content_type: without the character set.
    :param tag: changes with the content.
    """

    body: bytes
    content_type: str
    tag: str

    @property
    def is_text(self) -> bool:
        """Whether it has a character set: UTF-8."""
        return self.content_type != 'image/png'


def read_page(directory: Path = PAGE) -> Mapping[str, PageFile]:
    """
    Read all files of the page, and Plotly's script.

    :param directory: the folder with index.html.
    :return: by the path of the request.
    :raises CrgameError: if the page or Plotly is not installed.
    """
    table = read_files(directory, '/static/')
    index = table.pop('/static/index.html', None)
    if index is None:
        raise CrgameError(f'{directory}: the page of the cockpit is missing; '
                          'install crgame_ros again')
    return {**table, INDEX: index, PLOTLY: _read(plotly_script())}


def read_three(path: str) -> PageFile | None:
    """
    Read a script of three.js, which may have been fetched while the cockpit runs.

    :param path: of the request.
    :return: None if that is none of them, or they have not been fetched.
    """
    folder = find_library() if path in THREE else None
    return None if folder is None else _read(folder / THREE[path])


def read_files(directory: Path, prefix: str) -> dict[str, PageFile]:
    """
    Read all files of a folder that a page may consist of.

    :param prefix: of their requests.
    :return: by the path of the request.
    """
    return {f'{prefix}{path.relative_to(directory).as_posix()}': _read(path)
            for path in sorted(directory.rglob('*'))
            if path.suffix in TYPES and path.is_file()}


def _read(path: Path) -> PageFile:
    body = path.read_bytes()
    return PageFile(body, TYPES[path.suffix], hashlib.sha256(body).hexdigest()[:32])
