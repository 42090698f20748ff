# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Documents on topics: JSON text, read and written by the dataclass that declares its content."""

from functools import cached_property
import json
from typing import Any, Generic, NoReturn, TYPE_CHECKING, TypeVar

from crgame_ros.errors import InputError
from crgame_ros.schema.faults import first_fault

if TYPE_CHECKING:  # It takes a tenth of a second to import, and many commands read no document.
    from pydantic import TypeAdapter

T = TypeVar('T')


class JsonDocument(Generic[T]):
    """
    A kind of document.

    Keys that are not declared are left out: a newer program may have written them.

    :param kind: a dataclass, or another type whose parts are dataclasses; their types and
        `annotated_types` are checked.
    :param topic: on which the document comes.
    :param what: noun for messages.
    :param remedy: what to send instead.
    """

    def __init__(self, kind: Any, topic: str, what: str, remedy: str = '') -> None:
        self.topic = topic
        self._kind, self._what, self._remedy = kind, what, remedy

    @cached_property
    def _adapter(self) -> 'TypeAdapter[T]':
        from pydantic import TypeAdapter
        return TypeAdapter(self._kind)

    def read(self, text: str) -> T:
        """
        Read a document, which anyone may have written.

        :raises InputError: if it is malformed.
        """
        from pydantic import ValidationError
        try:
            return self._adapter.validate_python(
                json.loads(text, parse_constant=_refuse), context=self.topic)
        except ValidationError as error:
            fault = first_fault(error)
            place = '.'.join(map(str, fault.place)) or 'all of it'
            raise InputError(f'is no {self._what} ({place}: {fault.said})', self.topic,
                             self._remedy) from None
        except (ValueError, RecursionError) as error:
            raise InputError(f'is no {self._what} (no JSON)', self.topic,
                             self._remedy) from error

    def write(self, value: T) -> str:
        """Return the text from which `read` makes an equal value."""
        return json.dumps(self._adapter.dump_python(value, mode='json'), allow_nan=False)


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f'{constant} is no JSON')
