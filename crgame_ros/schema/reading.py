# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads a user's values by their declaration: returns a checked dataclass, or raises one error."""

from collections.abc import Mapping, Sequence
from dataclasses import is_dataclass
import math
from pathlib import Path
import re
import sys
import types
from typing import Any, get_args, get_origin, Literal, NoReturn, TypeVar, Union

from crgame_ros.errors import InputError, short
from crgame_ros.registry import ANY_VALUE
from crgame_ros.schema.declaration import (
    advice,
    choices_of,
    Form,
    form_of,
    is_composite,
    Key,
    keys_of,
    known_keys,
    mark_of,
    split,
    wanted,
)
from crgame_ros.schema.marks import (
    Advice,
    Folder,
    Keyed,
    Listed,
    Meaning,
    Named,
    Numbered,
    OnlyWith,
    Parts,
    Sought,
    Special,
    Within,
    Wording,
)
from crgame_ros.yaml_text import UNPRINTABLE

T = TypeVar('T')
_HERE = Path()
_EXPONENT = re.compile(r'[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+')


def read(kind: type[T], values: object, where: str, base: Path = _HERE) -> T:
    """
    Build a dataclass from values of YAML or JSON, and check every key and value.

    :param kind: a frozen dataclass whose types and marks declare the keys, or the type of another
        value.
    :param where: file and key for messages.
    :param base: directory against which file names are resolved.
    :raises InputError: about the first fault, with the number of further ones.
    """
    try:
        made: T = _Reader(base).value(kind, (), values, '', where)
        return made
    except _SeveralError as error:
        others = len(error.wrong) - 1
        more = f'{others} more {"is" if others == 1 else "are"} wrong'
        first = error.wrong[0]
        remedy = '; '.join(filter(None, (first.remedy, more))) if others else first.remedy
        raise InputError(first.what, first.where, remedy) from error


def faults_of(kind: type[object], values: object, where: str,
              base: Path) -> tuple[InputError, ...]:
    """Return all faults that `read` would refuse, one error each."""
    try:
        _Reader(base).value(kind, (), values, '', where)
    except InputError as error:
        return error.wrong if isinstance(error, _SeveralError) else (error,)
    return ()


class _SeveralError(InputError):
    """All faults of one value, in the order in which they were found."""

    def __init__(self, wrong: Sequence[InputError]) -> None:
        super().__init__(wrong[0].what, wrong[0].where, wrong[0].remedy)
        self.wrong = tuple(wrong)


class _Wrong:
    """A collection of faults in the parts of a value."""

    def __init__(self) -> None:
        self.found: list[InputError] = []

    def __enter__(self) -> None:
        return None

    def __exit__(self, _: object, error: BaseException | None, __: object) -> bool:
        if not isinstance(error, InputError):
            return False
        self.found += error.wrong if isinstance(error, _SeveralError) else [error]
        return True

    def report(self) -> None:
        if self.found:
            raise _SeveralError(self.found)


class _Reader:
    """A reader of values whose file names are relative to one folder."""

    def __init__(self, base: Path) -> None:
        self._base = base
        # Of the mapping that is read, or of the next one around it.
        self._remedy = ''

    def value(self, hint: object, marks: tuple[object, ...], given: object, key: str, where: str,
              index: int | None = None) -> Any:
        hint, own = split(hint)
        marks = (*marks, *own)
        for mark in marks:
            if isinstance(mark, Meaning) and given == mark.written \
                    and type(given) is type(mark.written):
                return mark.meant
            if isinstance(mark, Special) and (given is not None or choices_of(hint) == (hint,)):
                return mark.read(given, where, key, self._base)
        choices = choices_of(hint)
        if given is None and types.NoneType in choices:
            return None
        choices = tuple(choice for choice in choices if choice is not types.NoneType)
        kinds = [choice for choice in choices if is_dataclass(choice)]
        if isinstance(given, Mapping) and len(kinds) > 1:
            choices = (self._kind(kinds, given, _inside(where, key)),)
        if len(choices) > 1:
            return self._one_of(choices, marks, given, key, where)
        hint = choices[0]
        if is_dataclass(hint):
            return self.mapping(hint, marks, given, _inside(where, key), index)
        if get_origin(hint) is tuple:
            return self._list(hint, marks, given, key, where)
        return self._plain(hint, marks, given, key, where)

    def mapping(self, kind: Any, marks: tuple[object, ...], given: object, where: str,
                index: int | None = None) -> object:
        around, self._remedy = self._remedy, form_of(kind).remedy or self._remedy
        try:
            return self._mapping(kind, marks, given, where, index)
        finally:
            self._remedy = around

    def _mapping(self, kind: Any, marks: tuple[object, ...], given: object, where: str,
                 index: int | None) -> object:
        form = form_of(kind)
        if form.short is not None and isinstance(given, str):
            given = {form.short: given}
        if not isinstance(given, Mapping):
            asked = mark_of(marks, Advice)
            raise InputError('is no mapping', where, asked.remedy if asked else self._remedy)
        values = moved(form, given)
        wrong = _Wrong()
        with wrong:
            known, beside = _known_beside(kind, values, where)
            for name in values:
                if name not in known and form.rest is None:
                    with wrong:
                        _refuse_unknown(name, known, where, beside)
        # A key that is unknown in this combination needs no further error.
        checked: dict[str, object] = {}
        for key in () if wrong.found and form.by else keys_of(kind):
            with wrong:
                checked |= self._field(key, form, values, known, where, index)
        wrong.report()
        made = kind(**checked)
        check = getattr(made, 'check', None)
        if check is not None:
            try:
                check()
            except InputError as error:
                raise InputError(error.what, _inside(where, error.where), error.remedy) from error
        return made

    def _field(self, key: Key, form: Form, values: Mapping[object, object], known: tuple[str, ...],
               where: str, index: int | None) -> dict[str, object]:
        """Read a field; return nothing if it is missing and its default applies."""
        if key.mark(Folder):
            return {key.field: self._base}
        keyed = key.mark(Keyed)
        if keyed is not None:
            return {key.field: self._keyed(keyed, values, where)}
        if form.rest == key.field:
            rest = {name: value for name, value in values.items() if name not in known}
            if is_dataclass(key.hint):
                return {key.field: self.mapping(key.hint, key.marks, rest, where)} if rest else {}
            return {key.field: rest}
        beside = key.mark(OnlyWith)
        needed = key.name in known and beside is not None and (
            beside.needed or key.name in beside.keys)
        if needed and values.get(key.name) is None:
            raise InputError(f'"{key.name}" is missing', where, advice(key.hint, key.marks))
        if key.name in values and key.name in known:
            given = values[key.name]
            return {key.field: self.value(key.hint, key.marks, given, key.name, where)}
        numbered = key.mark(Numbered)
        if numbered is not None and index is not None:
            return {key.field: f'{numbered.prefix}{index}'}
        if key.required:
            raise InputError(f'"{key.name}" is missing', where, advice(key.hint, key.marks))
        return {}

    def _keyed(self, keyed: Keyed, values: Mapping[object, object], where: str) -> object:
        given = [name for name in keyed.kinds if name in values]
        if len(given) != 1:
            found = f'{len(given)} {keyed.noun}s ({", ".join(given)})' if given \
                else f'no {keyed.noun}'
            raise InputError(f'has {found}', where,
                             'give exactly one of ' + ', '.join(keyed.kinds))
        return self.value(keyed.kinds[given[0]], (), values[given[0]], given[0], where)

    def _kind(self, kinds: Sequence[object], given: Mapping[object, object], where: str) -> object:
        """Return the kind whose first key is given."""
        fitting = [kind for kind in kinds if keys_of(kind)[0].name in given]
        if len(fitting) != 1:
            names = ', '.join(f'"{keys_of(kind)[0].name}"' for kind in fitting or kinds)
            raise InputError(f'has {names} at once' if fitting else f'has none of {names}', where,
                             'give ' + ' or '.join(map(wanted, kinds)))
        return fitting[0]

    def _one_of(self, choices: tuple[object, ...], marks: tuple[object, ...], given: object,
                key: str, where: str) -> object:
        for choice in choices:
            try:
                return self.value(choice, marks, given, key, where)
            except InputError:
                continue
        _refuse(given, key, where, advice(Union[choices], marks))  # noqa: UP007

    def _list(self, hint: object, marks: tuple[object, ...], given: object, key: str,
              where: str) -> tuple[object, ...]:
        items = get_args(hint)
        if not isinstance(given, list | tuple):
            entries = mark_of(marks, Listed)
            if entries is None or not is_composite(items[0]):
                _refuse(given, key, where, advice(hint, marks))
            raise InputError(f'"{key}" is no list' if key else 'is no list', where,
                             f'give one entry for each {entries.noun}')
        if items[-1] is Ellipsis:
            return self._entries(hint, marks, given, key, where)
        parts = mark_of(marks, Parts)
        missing = len(items) - len(given)
        if not 0 <= missing <= (parts.optional if parts else 0):
            _refuse(given, key, where, advice(hint, marks))
        inner = tuple(mark for mark in marks if isinstance(mark, Within))
        read = [self._part(item, inner, part, (hint, marks), key, where)
                for item, part in zip(items, given, strict=False)]
        return (*read, *(0.0,) * missing)

    def _part(self, item: object, marks: tuple[object, ...], given: object,
              whole: tuple[object, tuple[object, ...]], key: str, where: str) -> object:
        """Read a plain value in a list; errors advise on the list, with its type and marks."""
        try:
            return self.value(item, marks, given, key, where)
        except InputError as error:
            what = f'"{key}" holds' if key else 'holds'
            raise InputError(f'{what} {short(given)}', where,
                             advice(*whole) + _as_yaml(given)) from error

    def _entries(self, hint: object, marks: tuple[object, ...], given: Sequence[object], key: str,
                 where: str) -> tuple[object, ...]:
        item, entries = get_args(hint)[0], mark_of(marks, Listed) or Listed()
        if len(given) < entries.least or len(given) > (entries.most or sys.maxsize):
            allowed = f'{entries.least} or more' if entries.most is None else \
                f'{entries.least} to {entries.most}' if entries.least else \
                f'{entries.most} at most'
            raise InputError(f'has {len(given)} entries', _inside(where, key), f'give {allowed}')
        if not is_composite(item):
            inner = tuple(mark for mark in marks if isinstance(mark, Within | Special))
            return tuple(self._part(item, inner, part, (hint, marks), key, where)
                         for part in given)
        own = None if entries.own is None else next(
            name for name in keys_of(split(item)[0]) if name.name == entries.own)
        wrong = _Wrong()
        read: list[object] = []
        seen = set()
        for index, part in enumerate(given):
            place = f'{_inside(where, key)}[{index}]'
            with wrong:
                entry = self.value(item, (), part, '', place + self._label(own, part), index)
                read.append(entry)
                if own is None:
                    continue
                name = getattr(entry, own.field)
                if name in seen:
                    raise InputError(f'"{name}" is there already', place,
                                     f'give each {entries.noun} its own {own.name}')
                seen.add(name)
        wrong.report()
        return tuple(read)

    def _label(self, own: Key | None, entry: object) -> str:
        """Return an entry's label: the value of its own key after its index, if that is valid."""
        if own is None or not isinstance(entry, Mapping) or own.name not in entry:
            return ''
        try:
            return f' ({self.value(own.hint, own.marks, entry[own.name], own.name, "")})'
        except InputError:
            return ''

    def _plain(self, hint: object, marks: tuple[object, ...], given: object, key: str,
               where: str) -> object:
        plain = get_origin(hint) or hint
        if hint in ANY_VALUE:
            return given
        if plain is Literal:
            if isinstance(given, str) and given in get_args(hint):
                return given
        elif plain in (int, float):
            if isinstance(given, int | (float if plain is float else int)) \
                    and not isinstance(given, bool) and given == given \
                    and abs(given) <= (math.inf if isinstance(given, float)
                                       else sys.float_info.max) \
                    and (mark_of(marks, Within) or Within()).holds(given):
                return plain(given)
        elif plain in (str, Path):
            wording = mark_of(marks, Wording)
            if isinstance(given, str) and not UNPRINTABLE.search(given) \
                    and (wording is None or wording.fits(given)) and (given or plain is str):
                if plain is Path:
                    sought = mark_of(marks, Sought)
                    return self._base / given if sought is None else sought.find(given, self._base)
                named = mark_of(marks, Named)
                return given if named is None else named.resolved(given, self._base)
        elif isinstance(plain, type) and isinstance(given, plain):
            return given
        _refuse(given, key, where, advice(hint, marks))


def _inside(where: str, key: str) -> str:
    return f'{where}: {key}' if where and key else key or where


def _refuse(given: object, key: str, where: str, remedy: str) -> NoReturn:
    what = f'"{key}" is {short(given)}' if key else f'is {short(given)}'
    raise InputError(what, where, remedy + _as_yaml(given))


def _as_yaml(given: object) -> str:
    """Return the correct YAML spelling of a number that YAML read as text."""
    number = isinstance(given, str) and _EXPONENT.fullmatch(given)
    return ' (YAML: 1.0e-3, not 1e-3)' if number else ''


def moved(form: Form, given: Mapping[object, object]) -> dict[object, object]:
    """Return the values with moved keys in the sections to which they belong."""
    values = dict(given)
    for key, section in form.moved:
        beside = values.get(section, {})
        if key in values and isinstance(beside, Mapping):
            values[section] = {**beside, key: values.pop(key)}
    return values


def _known_beside(kind: type[object], values: Mapping[object, object],
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


def _refuse_unknown(name: object, known: Sequence[str], where: str, beside: str) -> NoReturn:
    """Refuse a key; `beside` is the condition on which the known ones depend."""
    # Imported here because it is seldom needed.
    from difflib import get_close_matches
    near = get_close_matches(name[:40], known, 1) if isinstance(name, str) else ()
    said = f'"{name}"' if isinstance(name, str) else short(name)
    guess = f'did you mean "{near[0]}"? ' if near else ''
    raise InputError(f'{said} is unknown{beside}', where, f'{guess}known are ' + ', '.join(known))
