# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""JSON that a class declares: documents on topics, and messages of pages."""

from functools import cached_property
import json
from typing import Annotated, Any, Generic, NamedTuple, NoReturn, TypeVar

from crgame_ros.errors import InputError
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StringConstraints,
    TypeAdapter,
    ValidationError,
)

T = TypeVar('T')
M = TypeVar('M', bound='Message')


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
            fault = _first_fault(error)
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


class Message(BaseModel):
    """
    A message, which its `type` names.

    Values must have their very type; numbers are finite. Keys that are not declared are dropped.
    """

    model_config = ConfigDict(frozen=True, strict=True, allow_inf_nan=False)

    type: str  # noqa: A003


class MessageReader(Generic[M]):
    """
    A reader of messages.

    :param kinds: union of the classes, each with a literal `type`.
    """

    def __init__(self, kinds: Any) -> None:
        self._adapter: TypeAdapter[M] = TypeAdapter(
            Annotated[kinds, Field(discriminator='type')])

    def read(self, text: str) -> M:
        """
        Read a message.

        :raises InputError: if it is malformed, with the key.
        """
        try:
            # Unlike pydantic's own, this parser lets through half a surrogate pair.
            return self._adapter.validate_python(json.loads(text))
        except ValidationError as error:
            raise _refusal(error) from None
        except (ValueError, RecursionError) as error:
            raise InputError('is no JSON', 'message') from error


def _refusal(error: ValidationError) -> InputError:
    fault = _first_fault(error)
    if fault.kind.startswith('union_tag'):
        return InputError('is unknown', 'type')
    # The first part is the message's type; a message without a type has no place.
    place = [part for part in fault.place[1:2] if isinstance(part, str)]
    said = fault.said.removeprefix('Input ')
    return InputError(said[:1].lower() + said[1:], place[0] if place else 'message')


def _flag(given: object) -> object:
    return bool(given) if type(given) is int and given in (0, 1) else given


def _whole_text(given: object) -> object:
    """Replace halves of surrogate pairs, which are no characters."""
    if not isinstance(given, str) or given.isascii():
        return given
    return given.encode('utf-16', 'surrogatepass').decode('utf-16', 'replace')


# True or false; pages write 1 and 0 as well.
Flag = Annotated[bool, BeforeValidator(_flag, json_schema_input_type=bool | int)]
# What a person has typed.
Words = Annotated[str, BeforeValidator(_whole_text)]
# Number of a message to which the page expects a reply.
MessageId = Annotated[int, Field(ge=0, le=2 ** 53)]
HexKey = Annotated[str, StringConstraints(pattern='^[0-9a-f]{32}$')]


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


def _first_fault(error: 'ValidationError') -> Fault:
    """Return the first fault; the value may be long, and others may read the log."""
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    said = 'has another form' if first['type'] == 'predicate_failed' \
        else first['msg'].removeprefix('Value error, ')
    return Fault(first['type'], first['loc'], said)
