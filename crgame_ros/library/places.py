# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The folders and archives in which scenarios are looked up: which, and in which order."""

import os
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.paths import make_folder, scenarios_directory, user_directory
from crgame_ros.whole_file import write_text

VARIABLE = 'CRGAME_SCENARIOS'
ARCHIVES = ('.zip', '.tar', '.tar.gz', '.tgz')


def is_archive(path: Path) -> bool:
    """Return whether a file's name is that of an archive."""
    return path.name.lower().endswith(ARCHIVES)


def places_file() -> Path:
    """Return the file that holds the user's places, one a line."""
    return user_directory('config') / 'scenarios.txt'


def user_places() -> tuple[Path, ...]:
    """
    Read the places that the user has added.

    :raises InputError: if their file cannot be read.
    """
    file = places_file()
    try:
        lines = file.read_text(encoding='utf-8').splitlines()
    except FileNotFoundError:
        return ()
    except (OSError, ValueError) as error:
        raise InputError(f'cannot be read ({error})', str(file),
                         'mend it: it holds a folder or archive in each line') from error
    return tuple(Path(line) for line in lines if line.strip())


def variable_places() -> tuple[Path, ...]:
    """Return the places that the environment names; they go before the user's."""
    given = os.environ.get(VARIABLE, '').split(os.pathsep)
    return tuple(Path(name).expanduser().absolute() for name in given if name)


def all_places() -> tuple[Path, ...]:
    """
    Return all places in the order of their precedence; the package's own scenarios come last.

    :raises InputError: if the user's file of places cannot be read.
    """
    return tuple(dict.fromkeys((*variable_places(), *user_places(), scenarios_directory())))


def checked_place(path: Path) -> Path:
    """
    Return the absolute path of a folder or archive.

    :raises InputError: if it is neither.
    """
    found = path.expanduser().absolute()
    if '\n' in str(found) or not (found.is_dir() or found.is_file() and is_archive(found)):
        raise InputError('is neither a folder nor an archive' if found.exists()
                         else 'is not there', str(path),
                         f'name a folder of scenarios, or one of {", ".join(ARCHIVES)}')
    return found


def store_place(place: Path) -> bool:
    """
    Add a place to the user's.

    :return: whether it is new.
    :raises InputError: if the file of places cannot be written.
    """
    known = user_places()
    if place not in known:
        _write((*known, place))
    return place not in known


def drop_place(path: Path) -> Path:
    """
    Remove a place from the user's; nothing in it changes.

    :return: the place.
    :raises InputError: if it is none of them, or the file of places cannot be written.
    """
    known, place = user_places(), path.expanduser().absolute()
    if place not in known:
        raise InputError('is none of the places', str(path),
                         'these are ' + (', '.join(map(str, known)) or 'none: add one'))
    _write(tuple(each for each in known if each != place))
    return place


def _write(places: tuple[Path, ...]) -> None:
    file = places_file()
    make_folder(file.parent, 'set XDG_CONFIG_HOME to a folder that can be written')
    write_text(''.join(f'{place}\n' for place in places), file)
