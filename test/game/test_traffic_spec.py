# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The key `traffic` of a game file."""

from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write
import pytest


def test_the_word_reactive_is_enough() -> None:
    assert read(TrafficSpec, 'reactive', 'game') == TrafficSpec(recorded='reactive')
    assert read(TrafficSpec, {}, 'game') == TrafficSpec()


def test_what_is_written_reads_as_the_same() -> None:
    spec = TrafficSpec('reactive', 12, 300.0, 40, 'idm', {'time_gap': 1.2}, False, True, False, 7,
                       0.9, 0.05)
    assert read(TrafficSpec, write(spec), 'game') == spec
    assert write(TrafficSpec()) == {}


def test_a_model_of_the_users_own_is_relative_to_the_game_file() -> None:
    assert read(TrafficSpec, {'model': 'mine.py:Model'}, 'game',
                Path('/games')).model == '/games/mine.py:Model'


@pytest.mark.parametrize(('values', 'message'), [
    ({'agnets': 3}, '"agnets" is unknown'),
    ({'agents': -1}, 'give a whole number from 0 to 20000'),
    ({'agents': 2.5}, '"agents" is 2.5'),
    ({'flow': float('inf')}, '"flow" is inf'),
    ({'speed_spread': 2.0}, 'from 0 to 0.5'),
    ('replay', 'use one of replayed, reactive'),
    ([1], 'is no mapping'),
], ids=['unknown key', 'negative', 'half an agent', 'endless', 'too wide', 'wrong word', 'list'])
def test_refuses_what_makes_no_sense(values: object, message: str) -> None:
    with pytest.raises(InputError, match=message) as raised:
        read(TrafficSpec, values, 'my.yaml, traffic')
    assert raised.value.where == 'my.yaml, traffic'
