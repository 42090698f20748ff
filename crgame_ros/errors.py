# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The exceptions of the package: each says what was wrong, where, and how to mend it."""

import reprlib
from typing import Any

# A message is read in a terminal, a log or a small window [characters].
LONGEST = 480
# Values in messages: YAML aliases can make a short file a huge value.
_SHORT = reprlib.Repr()
_SHORT.maxlevel = 2


class CrgameError(Exception):
    """Base of every error that a user may see; printed as one line, never as a traceback."""

    exit_code = 1


class InputError(CrgameError):
    """
    Something the user gave (file, parameter, argument, topic) cannot be used.

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
            # What names a file and a place in it is of most use at its end.
            where = where if len(where) <= room else f'…{where[1 - room:]}'
        text = f'{where}: {what}' if where else what
        super().__init__(f'{text}; {remedy}' if remedy else text)


def short(value: Any) -> str:
    """Write a value for a message, cut where it is long."""
    return _SHORT.repr(value)


def one_line(text: str) -> str:
    """Return a remark in a line that any terminal takes, cut where nobody would read on."""
    return _cut(_plain(text), LONGEST)


def _plain(text: str) -> str:
    """Return text that any terminal and any file takes: one line, what cannot be shown escaped."""
    return ''.join(character if character.isprintable() else ascii(character)[1:-1]
                   for character in ' '.join(text.split()))


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f'{text[:longest - 1]}…'


class PlanningError(CrgameError):
    """A planner found no plan; its adapter answers with a braking plan instead."""
