# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rewrites error messages about command line options to name Python arguments."""

from collections.abc import Iterator
import contextlib

from crgame_ros.errors import InputError

_NAMES = {'--planner': 'planner', '--driver': 'driver', '--problem': 'problems',
          '--rate': 'rate_hz', '--duration': 'duration_s'}


@contextlib.contextmanager
def argument_names() -> Iterator[None]:
    """Rewrite errors to name the argument instead of the option."""
    try:
        yield
    except InputError as error:
        if error.where not in _NAMES:
            raise
        raise InputError(error.what, _NAMES[error.where], error.remedy) from error
