# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading arbitrary input, and writing it again, by declaration alone."""

from dataclasses import dataclass, field, replace
import math
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from crgame_ros.errors import InputError, LONGEST
from crgame_ros.game.events import EventList
from crgame_ros.game.game import Game
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Called, LeftOut, Listed, Named, Within
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write
import pytest


@dataclass(frozen=True)
class Wheel:
    """
    A part.

    :param name: of the part.
    :param size: across [m]
    """

    name: str
    size: Annotated[float, Within(0.0, 2.0, above=True)] = 1.0


@dataclass(frozen=True)
class Cart:
    """A whole."""

    FORM: ClassVar[Form] = Form('build a cart')

    wheels: Annotated[tuple[Wheel, ...], Listed(1, 3, 'wheel', 'name')]
    from_: Annotated[Literal['shop', 'farm'], Called('from')] = 'shop'
    manual: Annotated[str, Named()] | None = None
    load: Annotated[float, Within(0.0, endless=True), LeftOut()] = math.inf
    extra: dict[str, Any] = field(default_factory=dict)


CART = {'wheels': [{'name': 'a', 'size': 2}, {'name': 'b'}], 'from': 'farm', 'manual': 'm.py:M'}


def test_values_arrive_and_are_written_as_they_can_be_read() -> None:
    cart = read(Cart, CART, 'cart.yaml', Path('/home'))
    assert cart == Cart((Wheel('a', 2.0), Wheel('b')), 'farm', '/home/m.py:M')
    written = {'wheels': [{'name': 'a', 'size': 2.0}, {'name': 'b', 'size': 1.0}], 'from': 'farm',
               'manual': '/home/m.py:M', 'extra': {}}
    assert write(cart) == written
    assert read(Cart, written, 'again') == cart
    loaded = replace(cart, load=3.0, extra={'a': (1, {'b': 2})})
    assert write(loaded)['extra'] == {'a': [1, {'b': 2}]}
    assert read(Cart, write(loaded), 'again').load == 3.0


@pytest.mark.parametrize(('changes', 'message'), [
    ({'wheels': []}, 'cart.yaml: wheels: has 0 entries; give 1 to 3'),
    ({'wheels': 3}, 'cart.yaml: "wheels" is no list; give one entry for each wheel'),
    ({'wheels': [{'name': 'a'}] * 2},
     'cart.yaml: wheels[1]: "a" is there already; give each wheel its own name'),
    ({'wheels': [{'name': 'a', 'size': 0}]},
     'cart.yaml: wheels[0] (a): "size" is 0; give a number above 0, to 2'),
    ({'wheels': [{'nmae': 'a'}]}, 'cart.yaml: wheels[0]: "nmae" is unknown; did you mean "name"? '
     'known are name, size; 1 more is wrong'),
    ({'wheels': [{'size': 3}, 7, {}]},
     'cart.yaml: wheels[0]: "name" is missing; give a text; 3 more are wrong'),
    ({'from': 'sea'}, 'cart.yaml: "from" is \'sea\'; use one of shop, farm'),
    ({'from_': 'shop'}, 'cart.yaml: "from_" is unknown; did you mean "from"? known are wheels, '
     'from, manual, load, extra'),
    ({'load': math.nan}, 'cart.yaml: "load" is nan; give a number from 0 to inf'),
    ({'extra': [1]}, 'cart.yaml: "extra" is [1]; give a mapping'),
    ({7: 1}, 'cart.yaml: 7 is unknown; known are wheels, from, manual, load, extra'),
], ids=range(11))
def test_a_refusal_says_what_is_wrong_where_and_what_to_do(changes: dict[Any, Any],
                                                           message: str) -> None:
    with pytest.raises(InputError) as caught:
        read(Cart, CART | changes, 'cart.yaml')
    assert str(caught.value) == message


def nested(depth: int) -> Any:
    """Nest lists deeper than Python's recursion limit."""
    value: Any = 1
    for _ in range(depth):
        value = [value]
    return value


WILD = [nested(5000), {1: {2: 3}}, {None: None}, {True: 1}, 10**400, -10**400, math.inf, -math.inf,
        math.nan, True, '\ud800', 'a\0b', 'x' * 100_000, [[[]]], {'': ''}, {'a': nested(3000)},
        ['\udfff'], b'bytes', 1e308, {('a', 'b'): 1}, object()]


@pytest.mark.matrix('perception')
@pytest.mark.slow
@pytest.mark.parametrize('kind', [Game, PerceptionSpec, TrafficSpec, EventList, Cart],
                         ids=['game', 'perception', 'traffic', 'events', 'cart'])
def test_wild_values_are_refused_shortly_wherever_they_stand(kind: Any) -> None:
    """Such values come in other processes' documents, which no YAML reader has checked."""
    keys = ('scenario', 'title', 'humans', 'avs', 'duration', 'seed', 'timing', 'events',
            'objects', 'traffic', 'localisation', 'sensors', 'memory', 'recorded', 'agents',
            'wheels', 'from', 'manual', 'load', 'name', 'id', 'perception', 'tracker', 'dynamics')
    for value in WILD:
        for values in (value, [value], *({key: value} for key in keys),
                       *({outer: [{key: value}]} for outer in ('humans', 'avs', 'sensors',
                                                               'events', 'objects', 'wheels')
                         for key in keys)):
            try:
                read(kind, values, 'document')
            except InputError as error:
                assert len(str(error)) <= LONGEST + 10
                assert str(error).isprintable()
