# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The exceptions of the package: each message says what is wrong, where, and what to do."""

from collections.abc import Iterator
from contextlib import contextmanager
import reprlib

# Messages are shown in a terminal, a log or a small window [characters].
LONGEST = 480
# For values in messages: with YAML aliases a short file can hold a huge value.
_SHORT = reprlib.Repr()
_SHORT.maxlevel = 2


class CrgameError(Exception):
    """Base of every error that a user may see; printed as one line, never as a traceback."""

    exit_code = 1


class InputError(CrgameError):
    """
    An error in the user's input (file, parameter, argument, topic).

    :param what: what is wrong, in a few words.
    :param where: the file, element, topic or parameter in which it is wrong.
    :param remedy: what the user can do about it.
    """

    exit_code = 2

    def __init__(self, what: str, where: str = '', remedy: str = '') -> None:
        self.what = what
        self.where = where
        self.remedy = remedy
        what, where, remedy = _plain(what), _plain(where), _plain(remedy)
        if len(what) + len(where) + len(remedy) > LONGEST:
            what, remedy = _cut(what, LONGEST // 3), _cut(remedy, LONGEST // 3)
            room = LONGEST - len(what) - len(remedy)
            # The end of a file name with a place in it is the most useful part.
            where = where if len(where) <= room else f'…{where[1 - room:]}'
        text = f'{where}: {what}' if where else what
        super().__init__(f'{text}; {remedy}' if remedy else text)


@contextmanager
def refusing(what: str, where: object, remedy: str = '') -> Iterator[None]:
    """Raise an `InputError` with the system's reason in place of an `OSError`."""
    try:
        yield
    except OSError as error:
        raise InputError(f'{what} ({error.strerror})', str(where), remedy) from error


def short(value: object) -> str:
    """Return a value as text for a message, shortened if it is long."""
    return _SHORT.repr(value)


def one_line(text: str) -> str:
    """Return a remark as one printable line, shortened if it is long."""
    return _cut(_plain(text), LONGEST)


def _plain(text: str) -> str:
    """Return text as one line for any terminal or file, with unprintable characters escaped."""
    return ''.join(character if character.isprintable() else ascii(character)[1:-1]
                   for character in ' '.join(text.split()))


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f'{text[:longest - 1]}…'


class PlanningError(CrgameError):
    """The failure of a planner to find a plan; its adapter answers with a braking plan instead."""
