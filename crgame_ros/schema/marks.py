# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Marks for `Annotated`, which express conditions that types cannot."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
import math
from pathlib import Path
import re

from crgame_ros.registry import POLICY

# Returns the schema of a type, for pydantic.
Handler = Callable[[object], dict[str, object]]
# Comparison and representation are not needed; without them, marks take half the import time.


@dataclass(frozen=True, eq=False, repr=False)
class Within:
    """
    Bounds of a number, or of each number of a list.

    :param above: whether the lower bound itself is excluded.
    :param or_zero: whether 0 is allowed as well.
    :param endless: whether infinity is allowed if there is no upper bound.
    """

    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    or_zero: bool = False
    endless: bool = False

    def holds(self, value: float) -> bool:
        """Return whether a number, not NaN, is allowed."""
        if self.or_zero and value == 0:
            return True
        if math.isinf(value) and not self.endless:
            return False
        return self.low <= value <= self.high and not (self.above and value == self.low)

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        """Return the schema of the marked number, for pydantic; in JSON null is infinity."""
        def check(number: float) -> float:
            if not self.holds(number):
                raise ValueError(f'should be a number{self}')
            return number
        schema = {'type': 'function-after', 'schema': handler(source),
                  'function': {'type': 'no-info', 'function': check}}
        if not self.endless:
            return schema
        return {'type': 'function-before', 'schema': schema, 'function': {
            'type': 'no-info', 'function': lambda given: math.inf if given is None else given},
            'serialization': {'type': 'function-plain', 'function': lambda number:
                              None if number == math.inf else number}}

    def __str__(self) -> str:
        """Return the allowed numbers, as text after the noun."""
        if self.low == -math.inf and self.high == math.inf:
            return ''
        zero = ', or 0' if self.or_zero else ''
        if self.high == math.inf and not self.endless:
            return f' above {self.low:g}{zero}' if self.above else f' from {self.low:g}{zero}'
        start = f'above {self.low:g},' if self.above else f'from {self.low:g}'
        return f' {start} to {self.high:g}{zero}'


@dataclass(frozen=True, eq=False, repr=False)
class Wording:
    """
    The form of a text.

    :param pattern: regular expression for the whole text, in syntax that JavaScript supports too.
    :param remedy: what to write, for messages.
    """

    pattern: str
    remedy: str

    def fits(self, text: str) -> bool:
        """Return whether a text is of this form."""
        return re.fullmatch(self.pattern, text) is not None


@dataclass(frozen=True, eq=False, repr=False)
class Meaning:
    """Another value that a user may write, and its meaning."""

    written: object
    meant: object


@dataclass(frozen=True, eq=False, repr=False)
class Listed:
    """
    The number and kind of a list's entries.

    :param noun: noun for an entry.
    :param own: key of an entry whose value must be unique in the list.
    """

    least: int = 0
    most: int | None = None
    noun: str = 'entry'
    own: str | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Parts:
    """
    The names of a short list's numbers.

    :param optional: number of the last ones that may be left out; they are 0.
    """

    names: tuple[str, ...]
    optional: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class Numbered:
    """The prefix of an entry's default for a missing key, followed by its index in the list."""

    prefix: str


@dataclass(frozen=True, eq=False, repr=False)
class Called:
    """The key in files, if it differs from the field's name."""

    name: str


@dataclass(frozen=True, eq=False, repr=False)
class Advice:
    """The remedy for a value that is missing or wrong."""

    remedy: str


@dataclass(frozen=True, eq=False, repr=False)
class OnlyWith:
    """
    A mark of a key that is known only together with one of these keys or values.

    :param needed: whether it is required there.
    """

    keys: tuple[str, ...]
    needed: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Keyed:
    """
    A mark of a value that is at one of several keys of its mapping, which determines its kind.

    :param noun: noun for the value, for messages.
    """

    kinds: dict[str, object]
    noun: str


class LeftOut:
    """A mark of a key that is not written if its value is the default."""


class Folder:
    """A mark of the field with the folder of the file's relative names; it is never in a file."""


class Special(ABC):
    """The base of marks for values that need their own reader."""

    @abstractmethod
    def read(self, given: object, where: str, key: str, base: Path) -> object:
        """
        Read a value.

        :raises InputError: if it is invalid.
        """

    @abstractmethod
    def json_schema(self) -> dict[str, object]:
        """Return the JSON Schema of the value."""

    @abstractmethod
    def __str__(self) -> str:
        """Return the kind of value that is required, as text after "give"."""


class Named:
    """A name or a file: `FILE.yaml` and `FILE.py:Class` are relative to the user's file."""

    def resolved(self, name: str, base: Path) -> str:
        """Return the name with its path resolved."""
        return named_file(name, base)

    def written(self, name: str, base: Path) -> str:
        """Return the name in a form that is valid from any folder."""
        return named_file(name, Path.cwd())


class Sought(ABC):
    """A mark of a file that may be given by another name than that of its path."""

    @abstractmethod
    def find(self, name: str, base: Path) -> Path:
        """
        Return the path of the file.

        :raises InputError: if a name that is no file name is unknown.
        """


def named_file(name: str, base: Path) -> str:
    """Resolve `FILE.yaml` and `[policy:]FILE.py:Class` against a directory; keep other names."""
    kind = POLICY if name.startswith(POLICY) else ''
    name = name.removeprefix(POLICY)
    file, colon, attribute = name.rpartition(':')
    if not (name.endswith('.yaml') or file.endswith('.py')):
        return kind + name
    return kind + str(base / (file or name)) + colon + (attribute if file else '')
