# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds scenarios by their benchmark ids in folders and archives that the user has named."""

from collections.abc import Collection, Iterator, Sequence
from fnmatch import fnmatchcase
import logging
import os
from pathlib import Path
import re
from typing import NamedTuple

from crgame_ros.errors import InputError, one_line
from crgame_ros.library.index import ArchiveIndex, FolderIndex
from crgame_ros.library.stored_index import Entry
from crgame_ros.paths import expanded, make_folder, scenarios_directory, user_directory
from crgame_ros.whole_file import write_text

_LOGGER = logging.getLogger(__name__)
_PATTERN = re.compile(r'[*?\[]')
_NO_ID = ('.xml', '.yaml', '.yml', '.json', '.jsonl', '.mcap', '.db3', '.csv')
_ADD = 'name a folder or archive that has it: crgame scenarios add DIR'
_GUESSES = 3
# All ids end alike, so much of them is the same in any two.
_ALIKE = 0.8

Index = FolderIndex | ArchiveIndex
VARIABLE = 'CRGAME_SCENARIOS'
ARCHIVES = ('.zip', '.tar', '.tar.gz', '.tgz')


class _Hit(NamedTuple):

    place: Index
    entry: Entry


def is_id(name: str) -> bool:
    """Return whether a name can be a benchmark id, by its form: it has no folder and no ending."""
    return bool(name.strip('.')) and os.sep not in name and not name.startswith('~') \
        and name.isprintable() and not name.lower().endswith(_NO_ID)


def names_file(name: str, base: Path = Path()) -> bool:
    """Return whether a name is that of a file or folder, there or not; otherwise it is an id."""
    return not is_id(name) or os.path.lexists(base / name)


def find_scenario(name: str | Path, base: Path = Path()) -> Path:
    """
    Return the file of a scenario: the file named, which need not exist, or the one with this id.

    :param name: file name or benchmark id.
    :param base: directory against which file names are resolved.
    :raises InputError: if an id is in none of the places.
    """
    text = str(name)
    return base / text if names_file(text, base) else scenario_of(text)


def find_scenarios(names: Sequence[str], base: Path = Path()) -> tuple[str, ...]:
    """
    Return names of files, where ids and patterns of ids such as `USA_*` are replaced.

    :raises InputError: if an id or a pattern is in none of the places.
    """
    ids = [name for name in names if not names_file(name, base) and not _PATTERN.search(name)]
    paths = _scenarios_of(ids)
    found: list[str] = []
    for name in names:
        if names_file(name, base):
            found.append(name)
        elif _PATTERN.search(name):
            found += map(str, scenarios_like(name))
        else:
            found.append(str(paths[name]))
    return tuple(found)


def index_of(place: Path) -> Index:
    """Return the index of a folder or an archive."""
    return FolderIndex(place) if place.is_dir() or not _is_archive(place) else ArchiveIndex(place)


def scenario_of(benchmark_id: str) -> Path:
    """
    Return the file of a scenario by its id: the name of the file, or else the id in it.

    The first place that has it wins. If another file of this id has other content, a warning is
    logged.

    :raises InputError: if no place has it.
    """
    return _scenarios_of([benchmark_id])[benchmark_id]


def _scenarios_of(ids: Collection[str]) -> dict[str, Path]:
    """Return the files of scenarios as `scenario_of` does; each index is read once for all."""
    hits = _hits(ids, trusting=True)
    doubtful = [name for name, found in hits.items()
                if not found or not all(hit.place.is_current(hit.entry) for hit in found)]
    if doubtful:
        # The times of folders may hide a change, and say nothing of changes within files.
        hits |= _hits(doubtful, trusting=False)
    paths = {}
    for name, found in hits.items():
        if not found:
            raise _unknown(name)
        paths[name] = found[0].place.path_of(found[0].entry)
        _warn_of_others(name, found)
    return paths


def scenarios_like(pattern: str) -> list[Path]:
    """
    Return the files of all scenarios whose id fits a pattern with `*` and `?`, by their ids.

    :raises InputError: if there is none.
    """
    found: dict[str, _Hit] = {}
    for index in _present():
        for entry in index.entries(trusting=False):
            if fnmatchcase(entry.id, pattern):
                found.setdefault(entry.id, _Hit(index, entry))
    if not found:
        raise InputError('no scenario has an id like this', pattern,
                         _ADD)
    return [found[name].place.path_of(found[name].entry) for name in sorted(found)]


def all_ids() -> list[str]:
    """Return the ids of all scenarios of all places, sorted."""
    return sorted({entry.id for index in _present() for entry in index.entries(trusting=False)})


def _present() -> Iterator[Index]:
    """Yield the indexes of the places that are there."""
    for place in all_places():
        if place.exists():
            yield index_of(place)


def _hits(ids: Collection[str], *, trusting: bool) -> dict[str, list[_Hit]]:
    """Return the scenarios of ids: those of this file name, else those with this id in them."""
    named: dict[str, list[_Hit]] = {name: [] for name in ids}
    headed: dict[str, list[_Hit]] = {name: [] for name in ids}
    for index in _present() if ids else ():
        for entry in index.entries(trusting=trusting):
            for found, name in ((named, entry.id), (headed, entry.header_id)):
                if name in found:
                    found[name].append(_Hit(index, entry))
    return {name: named[name] or headed[name] for name in named}


def _warn_of_others(benchmark_id: str, hits: Sequence[_Hit]) -> None:
    first = hits[0]
    try:
        digest = first.place.digest_of(first.entry) if len(hits) > 1 else ''
        others = [hit for hit in hits[1:] if hit.place.digest_of(hit.entry) != digest]
    except InputError:
        # Only the first is needed, and who reads it says what is wrong with it.
        return
    if others:
        _LOGGER.warning('%s', one_line(
            f'note: {benchmark_id} is {_place_of(first)}; of the same id and other content: '
            + _place_of(others[0])
            + (f' and {len(others) - 1} more' if len(others) > 1 else '')))


def _place_of(hit: _Hit) -> str:
    return str(hit.entry.place / hit.entry.name)


def _unknown(benchmark_id: str) -> InputError:
    ids = all_ids()
    missing = [str(place) for place in all_places() if not place.exists()]
    away = f', and {missing[0]} is not there' if missing else ''
    return InputError(
        f'is no file, and none of the {len(ids)} known scenarios{away}', benchmark_id,
        f'{_guess(benchmark_id, ids)}{_ADD}')


def _guess(benchmark_id: str, ids: Sequence[str]) -> str:
    # Imported here because it is seldom needed.
    from difflib import get_close_matches
    folded = {known.casefold(): known for known in ids}
    near = get_close_matches(benchmark_id[:80].casefold(), folded, _GUESSES, _ALIKE)
    return f'did you mean {", ".join(folded[name] for name in near)}? ' if near else ''


def _is_archive(path: Path) -> bool:
    """Return whether a file's name is that of an archive."""
    return path.name.lower().endswith(ARCHIVES)


def _places_file() -> Path:
    """Return the file that holds the user's places, one a line."""
    return user_directory('config') / 'scenarios.txt'


def user_places() -> tuple[Path, ...]:
    """
    Read the places that the user has added.

    :raises InputError: if their file cannot be read.
    """
    file = _places_file()
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
    return tuple(expanded(name).absolute() for name in given if name)


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
    found = expanded(path).absolute()
    if '\n' in str(found) or not (found.is_dir() or found.is_file() and _is_archive(found)):
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
    Remove a place from the user's, and return it; nothing in it changes.

    :raises InputError: if it is none of them, or the file of places cannot be written.
    """
    known, place = user_places(), expanded(path).absolute()
    if place not in known:
        raise InputError('is none of the places', str(path),
                         'these are ' + (', '.join(map(str, known)) or 'none: add one'))
    _write(tuple(each for each in known if each != place))
    return place


def _write(places: tuple[Path, ...]) -> None:
    file = _places_file()
    make_folder(file.parent, 'set XDG_CONFIG_HOME to a folder that can be written')
    write_text(''.join(f'{place}\n' for place in places), file)
