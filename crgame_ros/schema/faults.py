# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What pydantic finds wrong, in words that do not repeat the value."""

from typing import NamedTuple, TYPE_CHECKING

if TYPE_CHECKING:  # It takes a tenth of a second to import, and many commands read no document.
    from pydantic import ValidationError


class Fault(NamedTuple):
    """
    A fault.

    :param kind: as pydantic names it.
    :param place: keys and indices from the outside in.
    :param said: what is wrong.
    """

    kind: str
    place: tuple[int | str, ...]
    said: str


def first_fault(error: 'ValidationError') -> Fault:
    """Return the first fault; the value may be long, and others may read the log."""
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    said = 'has another form' if first['type'] == 'predicate_failed' \
        else first['msg'].removeprefix('Value error, ')
    return Fault(first['type'], first['loc'], said)
