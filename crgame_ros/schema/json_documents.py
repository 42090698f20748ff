# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Documents on topics: JSON text, read and written by the class that declares its content."""

from functools import cached_property
import json
from typing import Any, Generic, NamedTuple, NoReturn, TYPE_CHECKING, TypeVar

from crgame_ros.errors import InputError

if TYPE_CHECKING:
    from pydantic import TypeAdapter, ValidationError

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


class Fault(NamedTuple):
    """What is wrong: pydantic's name of it, keys and indices from the outside in, and words."""

    kind: str
    place: tuple[int | str, ...]
    said: str


def first_fault(error: 'ValidationError') -> Fault:
    """Return the first fault; the value may be long, and others may read the log."""
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    said = 'has another form' if first['type'] == 'predicate_failed' \
        else first['msg'].removeprefix('Value error, ')
    return Fault(first['type'], first['loc'], said)
