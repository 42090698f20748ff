# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is read from others costs no more than its text: lists end at their first fault."""

from dataclasses import dataclass
import json
import math
from typing import Annotated, Literal

from crgame_ros.errors import InputError
from crgame_ros.schema.document_marks import Bounded, Row
from crgame_ros.schema.json_documents import JsonDocument
from crgame_ros.schema.messages import Message, MessageReader
from pydantic import TypeAdapter, ValidationError
import pytest


@dataclass(frozen=True)
class Entry:
    """An entry."""

    n: int
    names: Annotated[tuple[str, ...], Bounded(3)] = ()


@dataclass(frozen=True)
class Point:
    """A point."""

    x: float
    y: float


@pytest.mark.parametrize('kind', [list[Entry], tuple[Entry, ...]])
def test_a_list_has_one_faulty_entry(kind: type) -> None:
    """Of a hundred thousand wrong ones, none but the first is looked at."""
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(Annotated[kind, Bounded(1_000_000)]).validate_python([{}] * 100_000)
    assert caught.value.error_count() == 1
    assert TypeAdapter(Annotated[kind, Bounded(2)]).validate_python(
        [{'n': 1, 'names': ['a']}, {'n': 2}]) == kind([Entry(1, ('a',)), Entry(2)])


@pytest.mark.parametrize(('given', 'said'), [
    ({'a': [{'n': 1}]}, ''), (dict.fromkeys('abc', 1), 'all of it: should have 2 entries'),
    ({'a': [{}]}, 'a.0.n: Field required'),
    ({'a': [{'n': 1, 'names': ['x'] * 4}]}, 'a.0.names: should have 3 entries at most'),
    (7, 'all of it: Input should be a valid dictionary')])
def test_what_is_longer_is_refused_before_it_is_read(given: object, said: str) -> None:
    reader: JsonDocument[dict[str, tuple[Entry, ...]]] = JsonDocument(
        Annotated[dict[str, Annotated[tuple[Entry, ...], Bounded(5)]], Bounded(2)], '/topic',
        'list')
    if not said:
        assert reader.read(json.dumps(given)) == {'a': (Entry(1),)}
        return
    with pytest.raises(InputError) as caught:
        reader.read(json.dumps(given))
    assert str(caught.value).startswith(f'/topic: is no list ({said}')


@pytest.mark.parametrize('number', ['1', None, math.nan, math.inf,
                                    pytest.param(-10 ** 400, id='long')])
def test_a_row_has_finite_numbers_alone(number: object) -> None:
    reader = TypeAdapter(Annotated[Point, Row()])
    assert reader.validate_python([1, 2.5]) == Point(1.0, 2.5)
    with pytest.raises(ValidationError, match='a list of 2 finite numbers'):
        reader.validate_python([number, 0.0])


def test_a_message_names_the_key_but_not_the_value() -> None:
    class Ask(Message):
        type: Literal['ask'] = 'ask'  # noqa: A003
        n: Annotated[list[int], Bounded(2)]

    class Tell(Message):
        type: Literal['tell'] = 'tell'  # noqa: A003
    reader: MessageReader[Ask | Tell] = MessageReader(Ask | Tell)
    for given, said in (([1, 2, 3], 'n: should have 2 entries at most'),
                        (['secret'], 'n: should be a valid integer'), (None, 'n: ')):
        with pytest.raises(InputError) as caught:
            reader.read(json.dumps({'type': 'ask', 'n': given}))
        assert str(caught.value).startswith(said) and 'secret' not in str(caught.value)
