# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of pages: each is declared by a class; untrusted JSON becomes one, or a clear error."""

import json
from typing import Annotated, Any, Generic, TypeVar

from crgame_ros.errors import InputError
from crgame_ros.schema.json_documents import first_fault
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StringConstraints,
    TypeAdapter,
    ValidationError,
)

T = TypeVar('T', bound='Message')


class Message(BaseModel):
    """
    A message, which its `type` names.

    Values must have their very type; numbers are finite. Keys that are not declared are dropped.
    """

    model_config = ConfigDict(frozen=True, strict=True, allow_inf_nan=False)

    type: str  # noqa: A003


class MessageReader(Generic[T]):
    """A reader of messages of a union of classes, each with a literal `type`."""

    def __init__(self, kinds: Any) -> None:
        self._adapter: TypeAdapter[T] = TypeAdapter(
            Annotated[kinds, Field(discriminator='type')])

    def read(self, text: str) -> T:
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
    fault = first_fault(error)
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
