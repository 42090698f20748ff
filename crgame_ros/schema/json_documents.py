# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Documents on topics: untrusted JSON text becomes the dataclass that declares its content."""

from functools import cached_property
import json
from typing import Any, Generic, TYPE_CHECKING, TypeVar

from crgame_ros.errors import InputError
from crgame_ros.schema.faults import first_fault

if TYPE_CHECKING:  # It takes a tenth of a second to import, and many commands read no document.
    from pydantic import TypeAdapter

T = TypeVar('T')


class DocumentReader(Generic[T]):
    """
    A reader of a document.

    Keys that are not declared are left out: a newer program may have written them.

    :param kind: a dataclass, or another type whose parts are dataclasses; their types and
        `annotated_types` are checked.
    :param topic: on which the document comes.
    :param what: noun for messages.
    :param remedy: what to send instead.
    """

    def __init__(self, kind: Any, topic: str, what: str, remedy: str = '') -> None:
        self._kind, self._topic, self._what, self._remedy = kind, topic, what, remedy

    @cached_property
    def _adapter(self) -> 'TypeAdapter[T]':
        from pydantic import TypeAdapter
        return TypeAdapter(self._kind)

    def read(self, text: str) -> T:
        """
        Read a document.

        :raises InputError: if it is malformed.
        """
        from pydantic import ValidationError
        try:
            return self._adapter.validate_python(json.loads(text))
        except ValidationError as error:
            fault = first_fault(error)
            place = '.'.join(map(str, fault.place)) or 'all of it'
            raise InputError(f'is no {self._what} ({place}: {fault.said})', self._topic,
                             self._remedy) from None
        except (ValueError, RecursionError) as error:
            raise InputError(f'is no {self._what} (no JSON)', self._topic,
                             self._remedy) from error
