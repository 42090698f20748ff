# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Determines the known keys of a mapping, and refuses others."""

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

from crgame_ros.errors import InputError, short
from crgame_ros.schema.declaration import Form, form_of, keys_of, known_keys
from crgame_ros.schema.marks import OnlyWith


def moved(form: Form, given: Mapping[object, Any]) -> dict[object, object]:
    """Return the values with moved keys in the sections to which they belong."""
    values = dict(given)
    for key, section in form.moved:
        if key in values and isinstance(values.get(section, {}), Mapping):
            values[section] = {**values.get(section, {}), key: values.pop(key)}
    return values


def known_beside(kind: type[object], values: Mapping[object, object],
                 where: str) -> tuple[tuple[str, ...], str]:
    """
    Return the keys that are known together with those given.

    :return: the keys, and the condition on which they depend, for messages.
    :raises InputError: if not exactly one of some keys is given, or one does not fit its kind.
    """
    form = form_of(kind)
    if not form.by:
        return known_keys(kind), ''
    by = values.get(form.by)
    if not isinstance(by, str) or by not in form.one_of:
        what = f'is {short(by)}' if form.by in values else 'is missing'
        raise InputError(f'"{form.by}" {what}', where, 'use one of ' + ', '.join(form.one_of))
    allowed = form.one_of[by]
    given = [key for key in form.places if key in values]
    if len(given) != 1 or given[0] not in allowed:
        found = ' and '.join(f'"{key}"' for key in given) \
            or 'none of ' + ', '.join(f'"{key}"' for key in allowed)
        raise InputError(
            f'has {found}', where,
            f'{form.by} {by} needs ' + (f'"{allowed[0]}"' if len(allowed) == 1 else
                                        'exactly one of ' + ', '.join(allowed)))
    for key, choices in form.choices.items():
        if key in values and values[key] not in choices[by]:
            raise InputError(f'"{key}" is {short(values[key])}', where,
                             f'{form.by} {by} has one of ' + ', '.join(choices[by]))
    return keys_beside(kind, given[0]), f' for {form.by} {by} with "{given[0]}"'


def keys_beside(kind: type[object], place: str) -> tuple[str, ...]:
    """Return the keys that are known together with one of the exclusive keys."""
    return tuple(key.name for key in keys_of(kind)
                 if (beside := key.mark(OnlyWith)) is None or place in beside.keys)


def refuse_unknown(name: object, known: Sequence[str], where: str, beside: str = '') -> NoReturn:
    """
    Refuse a key.

    :param beside: the condition on which the known keys depend, for the message.
    :raises InputError: always.
    """
    # Imported here because it is seldom needed.
    from difflib import get_close_matches
    near = get_close_matches(name[:40], known, 1) if isinstance(name, str) else ()
    said = f'"{name}"' if isinstance(name, str) else short(name)
    guess = f'did you mean "{near[0]}"? ' if near else ''
    raise InputError(f'{said} is unknown{beside}', where, f'{guess}known are ' + ', '.join(known))
