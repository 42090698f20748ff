# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Refusals of what a command line would have said, in the words of Python's arguments."""

from collections.abc import Iterator
import contextlib

from crgame_ros.errors import InputError

_NAMES = {'--planner': 'planner', '--driver': 'driver', '--problem': 'problems',
          '--rate': 'rate_hz', '--duration': 'duration_s'}


@contextlib.contextmanager
def argument_names() -> Iterator[None]:
    """Name the argument, not the option."""
    try:
        yield
    except InputError as error:
        if error.where not in _NAMES:
            raise
        raise InputError(error.what, _NAMES[error.where], error.remedy) from error
