# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Documents are returned once they belong together, in whatever order they come."""

from dataclasses import replace
from itertools import permutations

from crgame_ros.errors import InputError
from crgame_ros.game.documents import GAME, OBJECTS
from crgame_ros.game.game import load_game
from crgame_ros.ros.scenario_documents import DocumentCollector, KINDS
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup
from live_support import SCENARIOS
import pytest


def _texts(game: str, epoch: int = 0) -> dict[str, str]:
    setup = build_setup(load_game(SCENARIOS / f'{game}.yaml'))
    return {'xml': setup.loaded.xml_text, 'objects': OBJECTS.write(setup.descriptions),
            'game': GAME.write(describe_game(setup, epoch=epoch, clock_offset_ns=epoch * 10 ** 9))}


@pytest.fixture(scope='module')
def cut_in() -> dict[str, str]:
    """Return the documents of a game of hv0 and av0."""
    return _texts('cut_in')


@pytest.fixture(scope='module')
def two_avs() -> dict[str, str]:
    """Return the documents of a game of hv0, av0 and av1 in another scenario."""
    return _texts('two_avs')


@pytest.mark.parametrize('order', permutations(KINDS), ids='-'.join)
def test_a_set_is_given_once(order: tuple[str, ...], cut_in: dict[str, str]) -> None:
    """It comes with the third document, and not again when the same text comes again."""
    collector = DocumentCollector()
    for kind in order:
        assert collector.complete() is None
        collector.add(kind, cut_in[kind])
    documents = collector.complete()
    assert documents is not None
    assert [item.id for item in documents.driven] == ['hv0', 'av0']
    assert documents.others == ()
    assert documents.loaded.sha256 == documents.game.scenario_sha256
    assert documents.texts == cut_in
    collector.add('game', cut_in['game'])
    assert collector.complete() is None


@pytest.mark.parametrize('order', permutations(KINDS), ids='-'.join)
def test_a_new_game_never_mixes_with_the_old(
        order: tuple[str, ...], cut_in: dict[str, str], two_avs: dict[str, str]) -> None:
    """Text, objects and game of the new scenario count together only."""
    collector = DocumentCollector()
    for kind, text in cut_in.items():
        collector.add(kind, text)
    assert collector.complete() is not None
    for kind in order[:2]:
        collector.add(kind, two_avs[kind])
        assert collector.complete() is None
    collector.add(order[2], two_avs[order[2]])
    documents = collector.complete()
    assert documents is not None
    assert [item.id for item in documents.driven] == ['hv0', 'av0', 'av1']


def test_a_reset_does_not_read_the_same_scenario_again(cut_in: dict[str, str]) -> None:
    """The game of the next epoch is a new set with the scenario that was read already."""
    collector = DocumentCollector()
    for kind, text in cut_in.items():
        collector.add(kind, text)
    first = collector.complete()
    collector.add('game', _texts('cut_in', epoch=1)['game'])
    second = collector.complete()
    assert first is not None
    assert second is not None
    assert (first.game.epoch, second.game.epoch) == (0, 1)
    assert second.loaded is first.loaded
    assert replace(second, game=first.game, texts=first.texts) == first


def test_what_cannot_be_read_is_said(cut_in: dict[str, str]) -> None:
    """The error names the topic; the old documents stay and are returned with the new ones."""
    collector = DocumentCollector()
    for kind, text in cut_in.items():
        collector.add(kind, text)
    with pytest.raises(InputError, match='/scenario/objects'):
        collector.add('objects', '[{}]')
    with pytest.raises(InputError, match='/scenario/game'):
        collector.add('game', '{}')
    assert collector.complete() is not None
