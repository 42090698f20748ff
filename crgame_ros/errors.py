# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The exceptions of the package: each says what was wrong, where, and how to mend it."""


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
        text = f'{where}: {what}' if where else what
        if remedy:
            text = f'{text}; {remedy}'
        super().__init__(' '.join(text.split()))


class PlanningError(CrgameError):
    """A planner found no plan; its adapter answers with a braking plan instead."""
