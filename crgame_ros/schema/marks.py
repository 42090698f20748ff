# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Marks that stand in `Annotated` and say what a type alone cannot."""

from dataclasses import dataclass
import math
from pathlib import Path
import re
from typing import Any

from crgame_ros.registry import POLICY

# Without comparison and representation, which nobody needs, a mark costs half as much to import.


@dataclass(frozen=True, eq=False, repr=False)
class Within:
    """
    Bounds of a number, or of each number of a list.

    :param above: whether the lower bound itself is excluded.
    :param or_zero: whether 0 is allowed besides.
    :param endless: whether infinity is allowed, where there is no upper bound.
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

    def __str__(self) -> str:
        """Return which numbers are meant, to stand behind the noun."""
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
    What a text has to look like.

    :param pattern: regular expression of the whole text, of those that JavaScript has too.
    :param remedy: what to write, for messages.
    """

    pattern: str
    remedy: str

    def fits(self, text: str) -> bool:
        """Return whether a text is of this form."""
        return re.fullmatch(self.pattern, text) is not None


@dataclass(frozen=True, eq=False, repr=False)
class Meaning:
    """Another value that a user may write, and what it stands for."""

    written: Any
    meant: Any


@dataclass(frozen=True, eq=False, repr=False)
class Listed:
    """
    How many entries a list has, and what they are.

    :param noun: what one of them is.
    :param own: key of an entry that no other of the list may have alike.
    """

    least: int = 0
    most: int | None = None
    noun: str = 'entry'
    own: str | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Parts:
    """
    The names of a short list's numbers.

    :param optional: how many of the last may be left out; they are 0.
    """

    names: tuple[str, ...]
    optional: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class Numbered:
    """An entry of a list that gives no such key gets this and its place in the list."""

    prefix: str


@dataclass(frozen=True, eq=False, repr=False)
class Called:
    """The key in files, where it cannot be the field's name."""

    name: str


@dataclass(frozen=True, eq=False, repr=False)
class Advice:
    """What to do about a value that is missing or wrong."""

    remedy: str


@dataclass(frozen=True, eq=False, repr=False)
class OnlyWith:
    """
    The key is known only beside one of these.

    :param needed: whether it has to be given there.
    """

    keys: tuple[str, ...]
    needed: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Keyed:
    """
    The value stands at one of several keys of the same mapping, which says what it is.

    :param noun: what it is, for messages.
    """

    kinds: dict[str, Any]
    noun: str


class LeftOut:
    """A value that is the default is not written."""


class Folder:
    """Never in a file: the folder against which the file's own names are resolved."""


class Special:
    """Base of marks of values that need a reader of their own."""

    def read(self, given: Any, where: str, key: str, base: Path) -> Any:
        """
        Read a value.

        :raises InputError: if it is none.
        """
        raise NotImplementedError

    def json_schema(self) -> dict[str, Any]:
        """Describe it as JSON Schema."""
        raise NotImplementedError

    def __str__(self) -> str:
        """Return what is wanted, to stand behind "give"."""
        raise NotImplementedError


class Named:
    """A name that may be a file's: `FILE.yaml` and `FILE.py:Class` are relative to the file."""

    def resolved(self, name: str, base: Path) -> str:
        """Return the name as the program has it."""
        return named_file(name, base)

    def written(self, name: str, base: Path) -> str:
        """Return the name as it can be read from anywhere."""
        return named_file(name, Path.cwd())


def named_file(name: str, base: Path) -> str:
    """Resolve `FILE.yaml` and `[policy:]FILE.py:Class` against a directory; other names stay."""
    kind = POLICY if name.startswith(POLICY) else ''
    name = name.removeprefix(POLICY)
    file, colon, attribute = name.rpartition(':')
    if not (name.endswith('.yaml') or file.endswith('.py')):
        return kind + name
    return kind + str(base / (file or name)) + colon + (attribute if file else '')
