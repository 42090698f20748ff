# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keys of a game by their path, such as `humans.hv0.spawn.speed`."""

from typing import Any

from crgame_ros.errors import InputError, short

_NAMES = ('id', 'name')


def value_at(values: Any, path: str) -> object:
    """
    Return the value of a key; None where it is not given.

    :param values: mappings and lists, as `write` returns them.
    :param path: names of keys, and ids, names or indices of entries, with dots between.
    """
    for name in path.split('.'):
        if isinstance(values, dict):
            values = values.get(name)
        elif isinstance(values, list):
            place = _place(values, name)
            values = None if place is None else values[place]
        else:
            return None
    found: object = values
    return found


def with_value(values: Any, path: str, value: object, where: str = '') -> Any:
    """
    Return values with a key changed or added; what is not on its path is shared.

    :param where: for messages.
    :raises InputError: if an entry or a section of the path does not exist.
    """
    name, _, rest = path.partition('.')
    if isinstance(values, list):
        place = _place(values, name)
        if place is None:
            raise InputError(f'there is no entry {short(name)}', where,
                             f'there are {", ".join(_names_of(values)) or "none"}')
        inner = with_value(values[place], rest, value, where) if rest else value
        return [*values[:place], inner, *values[place + 1:]]
    if values is None:
        values = {}
    if not isinstance(values, dict):
        raise InputError(f'{short(name)} is in no section', where, 'name a key of the game')
    return values | {name: with_value(values.get(name), rest, value, where) if rest else value}


def _place(entries: list[Any], name: str) -> int | None:
    for index, entry in enumerate(entries):
        if isinstance(entry, dict) and name in (entry.get(key) for key in _NAMES):
            return index
    return int(name) if name.isdecimal() and int(name) < len(entries) else None


def _names_of(entries: list[Any]) -> list[str]:
    return [next((str(entry[key]) for key in _NAMES if isinstance(entry, dict) and key in entry),
                 str(index)) for index, entry in enumerate(entries)]
