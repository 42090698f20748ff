# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Marks for types that pydantic reads: bounds of what it costs, exact types, other forms."""

from collections.abc import Callable
from dataclasses import dataclass, replace
import sys
from typing import Any, get_args

from crgame_ros.schema.marks import Handler
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write


@dataclass(frozen=True)
class Bounded:
    """
    A mark for the type of a list, tuple or dictionary that pydantic reads.

    A longer one is refused before its entries are read, and of a list reading ends at the first
    wrong entry. Without it, pydantic collects the faults of all entries: seconds for a megabyte.

    :param most: number of entries.
    """

    most: int

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        schema = handler(source)
        if schema['type'] in ('list', 'tuple'):
            schema['fail_fast'] = True

        def check(given: object) -> object:
            if isinstance(given, list | tuple | dict) and len(given) > self.most:
                raise ValueError(f'should have {self.most} entries at most')
            return given
        return {'type': 'function-before', 'schema': schema,
                'function': {'type': 'no-info', 'function': check}}


class Exact:
    """A mark for the type of a value that must have it: no text is a number, no flag either."""

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        return handler(source) | {'strict': True}


@dataclass(frozen=True)
class Otherwise:
    """A mark for literals: what a newer program has written is read as this one."""

    known: str

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        return {'type': 'function-before', 'schema': handler(source), 'function': {
            'type': 'no-info', 'function': lambda given:
            given if given in get_args(source) or not isinstance(given, str) else self.known}}


@dataclass(frozen=True)
class Derived:
    """A mark for a class of which properties are written too, for other programs."""

    names: tuple[str, ...]

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        def write_all(value: object, write_fields: Handler) -> object:
            return write_fields(value) | {name: getattr(value, name) for name in self.names}
        return handler(source) | {
            'serialization': {'type': 'function-wrap', 'function': write_all}}


class Row:
    """A mark for a class that is written as the list of its finite numbers."""

    def __get_pydantic_core_schema__(self, source: Callable[..., object],
                                     handler: object) -> object:
        names = tuple(source.__annotations__)

        def made(given: object, _: object) -> object:
            if not isinstance(given, list) or len(given) != len(names) or not all(
                    isinstance(number, int | float) and abs(number) <= sys.float_info.max
                    for number in given):
                raise ValueError(f'should be a list of {len(names)} finite numbers')
            return source(*map(float, given))
        return _plain_schema(made, lambda value: [getattr(value, name) for name in names])


@dataclass(frozen=True)
class Declared:
    """
    A mark for a type that is read and written as in users' files.

    :param kind: the type with its marks for files; None if it has none.
    """

    kind: Any = None

    def __get_pydantic_core_schema__(self, source: object, handler: object) -> object:
        mark = self if self.kind is not None else replace(self, kind=source)
        return _plain_schema(
            lambda given, info: mark.read(given, f'{info.context}: {info.field_name}'),
            mark.write)

    def read(self, given: object, where: str) -> object:
        """
        Read a value.

        :raises InputError: if it is malformed.
        """
        return read(self.kind, given, where)

    def write(self, value: object) -> object:
        """Return the JSON value from which `read` makes an equal one."""
        return write(value)


def _plain_schema(read_value: Callable[[object, Any], object],
                  write_value: Callable[[object], object]) -> object:
    """Return the schema of a value that two functions read and write."""
    return {'type': 'function-plain', 'function': {'type': 'with-info', 'function': read_value},
            'serialization': {'type': 'function-plain', 'function': write_value}}
