# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The declaration of a user's mapping by a dataclass."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, MISSING
import functools
import inspect
import re
import types
from typing import (
    Annotated,
    Any,
    get_args,
    get_origin,
    get_type_hints,
    Literal,
    TypeVar,
    Union,
)

from crgame_ros.registry import ANY_VALUE, VALUE_WORDS
from crgame_ros.schema.marks import (
    Advice,
    Called,
    Folder,
    Keyed,
    Meaning,
    Parts,
    Special,
    Within,
    Wording,
)

T = TypeVar('T')
_PARAM = re.compile(r'^:param (\w+):(.*?)(?=^:|\Z)', re.MULTILINE | re.DOTALL)


@dataclass(frozen=True, eq=False, repr=False)
class Form:
    """
    The form of a dataclass in a file: its class attribute `FORM`, if it differs from the default.

    A method `check` of the dataclass may check conditions that types cannot express. It raises an
    InputError that names no place.

    :param remedy: remedy in the message about a value that is not a mapping; without one, that of
        the mapping around it.
    :param short: key for which a plain text may be written instead of the mapping.
    :param rest: field that receives all keys that are not fields.
    :param moved: keys that may be written here although they belong to a section: key, section.
    :param first: keys that are written first.
    :param written: `given` leaves out values of None, `changed` leaves out defaults, `all`
        writes everything.
    :param by: key whose value determines the known keys.
    :param one_of: keys of which exactly one is given, for each value of `by`.
    :param choices: allowed values of a key, for each value of `by`.
    """

    remedy: str = ''
    short: str | None = None
    rest: str | None = None
    moved: tuple[tuple[str, str], ...] = ()
    first: tuple[str, ...] = ()
    written: Literal['given', 'changed', 'all'] = 'given'
    by: str = ''
    one_of: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    choices: Mapping[str, Mapping[str, tuple[str, ...]]] = field(default_factory=dict)

    @property
    def places(self) -> tuple[str, ...]:
        """Return all keys of which exactly one is given."""
        return tuple(dict.fromkeys(key for keys in self.one_of.values() for key in keys))


@dataclass(frozen=True, eq=False, repr=False)
class Key:
    """
    One field of a declaration.

    :param name: name in files.
    :param field: name of the dataclass's field.
    :param hint: its type, without marks.
    :param marks: the marks of its `Annotated`.
    :param default: `MISSING` if it is required.
    """

    name: str
    field: str
    hint: object
    marks: tuple[object, ...]
    default: object

    @property
    def required(self) -> bool:
        """Return whether it is required."""
        return self.default is MISSING

    def mark(self, kind: type[T]) -> T | None:
        """Return the mark of a kind; None without one."""
        return mark_of(self.marks, kind)


def mark_of(marks: tuple[object, ...], kind: type[T]) -> T | None:
    """Return the mark of a kind among others; None without one."""
    for mark in marks:
        if isinstance(mark, kind):
            return mark
    return None


def form_of(kind: type[object]) -> Form:
    """Return the form of a dataclass in a file."""
    return getattr(kind, 'FORM', _PLAIN)


_PLAIN = Form()
# Cache of `keys_of`.
_KEYS: dict[object, tuple[Key, ...]] = {}


def keys_of(kind: object) -> tuple[Key, ...]:
    """Return the fields of a dataclass in their order."""
    if kind not in _KEYS:
        _KEYS[kind] = _keys(kind)
    return _KEYS[kind]


def _keys(kind: Any) -> tuple[Key, ...]:
    hints = get_type_hints(kind, include_extras=True)
    keys = []
    for item in fields(kind):
        if not item.init:
            continue
        hint, marks = split(hints[item.name])
        called = mark_of(marks, Called)
        default = item.default
        if item.default_factory is not MISSING:
            default = item.default_factory()
        keys.append(Key(called.name if called else item.name, item.name, hint, marks, default))
    return tuple(keys)


def known_keys(kind: type[object]) -> tuple[str, ...]:
    """Return all keys that a mapping may have, except those for its `rest`."""
    form = form_of(kind)
    names: list[str] = []
    for key in keys_of(kind):
        keyed = key.mark(Keyed)
        if keyed is not None:
            names += keyed.kinds
        elif key.mark(Folder) is None and key.field != form.rest:
            names.append(key.name)
    return (*names, *(key for key, _ in form.moved))


def sentences_of(kind: type[object]) -> dict[str, str]:
    """Return the description of each field from the docstrings of a class, in one line each."""
    return {name: ' '.join(words.split()).rstrip('.')
            for base in reversed(kind.__mro__)
            for name, words in _PARAM.findall(inspect.cleandoc(base.__doc__ or ''))}


@functools.cache
def split(hint: object) -> tuple[object, tuple[object, ...]]:
    """Return a type without marks, and its marks, including those of the one type beside None."""
    marks: tuple[object, ...] = ()
    if get_origin(hint) is Annotated:
        hint, *given = get_args(hint)
        marks = tuple(given)
    choices = choices_of(hint)
    if len(choices) == 2 and types.NoneType in choices:
        inner, more = split(next(choice for choice in choices if choice is not types.NoneType))
        if more:
            return Union[inner, None], (*marks, *more)  # noqa: UP007
    return hint, marks


def choices_of(hint: object) -> tuple[object, ...]:
    """Return the members of a union; another type alone."""
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)


def is_composite(hint: object) -> bool:
    """Return whether a value has named parts: a mapping, or a list of lists or mappings."""
    plain, _ = split(hint)
    return any(is_dataclass(choice) or get_origin(choice) is tuple for choice in choices_of(plain))


def wanted(hint: object, marks: tuple[object, ...] = ()) -> str:
    """Return the kind of value that is required, as text after "give"."""
    hint, own = split(hint)
    marks = (*marks, *own)
    special = mark_of(marks, Special)
    if special is not None:
        return str(special)
    wording = mark_of(marks, Wording)
    words = [_wanted(plain, (*marks, *inner)) for choice in choices_of(hint)
             if choice is not types.NoneType for plain, inner in (split(choice),)]
    text = wording.remedy.removeprefix('give ') if wording else ' or '.join(dict.fromkeys(words))
    others = [str(mark.written) for mark in marks
              if isinstance(mark, Meaning) and isinstance(mark.written, str)]
    return ', or '.join([text, *others])


def _wanted(hint: object, marks: tuple[object, ...]) -> str:
    origin = get_origin(hint)
    if origin is Literal:
        return 'one of ' + ', '.join(map(str, get_args(hint)))
    if hint is float or hint is int:
        return f'{VALUE_WORDS[hint]}{mark_of(marks, Within) or ""}'
    if is_dataclass(hint):
        needed = [key.name for key in keys_of(hint) if key.required]
        return '{' + ', '.join(f'{name}:' for name in needed) + '}' if needed else 'a mapping'
    if origin is tuple:
        return _wanted_list(get_args(hint), marks)
    return 'any value' if hint in ANY_VALUE else VALUE_WORDS.get(
        hint, 'a mapping' if (origin or hint) in (dict, Mapping) else
        'a file name' if getattr(hint, '__name__', '') == 'Path' else
        getattr(hint, '__name__', str(hint)))


def _wanted_list(items: tuple[object, ...], marks: tuple[object, ...]) -> str:
    if items[-1] is Ellipsis:
        return f'a list of {_plural(items[0], marks)}'
    parts = mark_of(marks, Parts)
    shown = ', '.join(parts.names) if parts else f'{len(items)} values'
    return f'[{shown}], {_plural(items[0], marks)}'


def _plural(hint: object, marks: tuple[object, ...]) -> str:
    return re.sub(r'^a (whole number|number|text|mapping|list)', r'\1s',
                  wanted(hint, marks)).removeprefix('one of ')


def advice(hint: object, marks: tuple[object, ...]) -> str:
    """Return the remedy for a wrong value."""
    given = mark_of(marks, Advice)
    if given is not None:
        return given.remedy
    wording = mark_of(marks, Wording)
    if wording is not None:
        return wording.remedy
    text = wanted(hint, marks)
    return f'use {text}' if text.startswith('one of') else f'give {text}'
