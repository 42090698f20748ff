# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Marks for types that pydantic reads: bounds of what reading costs, and exact types."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Bounded:
    """
    A mark for the type of a list, tuple or dictionary that pydantic reads.

    A longer one is refused before its entries are read, and of a list reading ends at the first
    wrong entry. Without it, pydantic collects the faults of all entries: seconds for a megabyte.

    :param most: number of entries.
    """

    most: int

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Return the schema of the marked type, for pydantic."""
        schema = handler(source)
        if schema['type'] in ('list', 'tuple'):
            schema['fail_fast'] = True

        def check(given: Any) -> Any:
            if isinstance(given, list | tuple | dict) and len(given) > self.most:
                raise ValueError(f'should have {self.most} entries at most')
            return given
        return {'type': 'function-before', 'schema': schema,
                'function': {'type': 'no-info', 'function': check}}


class Exact:
    """A mark for the type of a value that must have it: no text is a number, no flag either."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Return the schema of the marked type, for pydantic."""
        return handler(source) | {'strict': True}
