# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Orders are balanced and equal on every machine."""

from collections import Counter
from itertools import pairwise
import subprocess
import sys
from typing import Any, get_args

from crgame_ros.errors import InputError
from crgame_ros.schema.reading import read
from crgame_ros.study.file import StudyFile
from crgame_ros.study.session_script import PracticeDrives, session_of
from crgame_ros.study.trial_order import order_of, OrderKind, rows_of, williams_rows
from crgame_ros.study.trial_plan import blocks_of, plan_trials
import pytest


@pytest.mark.parametrize('count', range(2, 9))
@pytest.mark.parametrize('seed', [0, 7])
def test_every_condition_follows_every_other_equally_often(count: int, seed: int) -> None:
    rows = rows_of('williams', count)
    assert rows == (count if count % 2 == 0 else 2 * count)
    orders = [order_of('williams', count, seed, place) for place in range(rows)]
    follows = Counter(pair for order in orders for pair in pairwise(order))
    assert len(follows) == count * (count - 1)
    assert set(follows.values()) == {1 if count % 2 == 0 else 2}
    places = Counter((place, item) for order in orders for place, item in enumerate(order))
    assert set(places.values()) == {rows // count}


@pytest.mark.parametrize('kind', get_args(OrderKind))
def test_every_order_has_every_condition_once(kind: str) -> None:
    for count in range(1, 9):
        for place in range(20):
            for again in range(3):
                assert sorted(order_of(kind, count, 3, place, again)) == list(range(count))


def test_orders_differ_by_participant_pass_and_seed() -> None:
    found = {tuple(order_of('random', 8, seed, place, again))
             for seed in range(3) for place in range(5) for again in range(3)}
    assert len(found) == 45
    assert order_of('williams', 4, 1, 0) != order_of('williams', 4, 1, 0, pass_number=1)
    assert order_of('given', 4, 1, 3) == [0, 1, 2, 3]


def test_a_list_is_taken_in_turn() -> None:
    sequences = [[0, 1, 1], [1, 0, 0]]
    assert [order_of('williams', 2, 5, place, sequences=sequences) for place in range(3)] == [
        [0, 1, 1], [1, 0, 0], [0, 1, 1]]


def test_another_process_orders_alike() -> None:
    """The order is the same for every hash seed, as no code depends on the order of a set."""
    code = ('from crgame_ros.study.trial_plan import order_of; '
            'print([order_of(kind, 7, 11, 5) for kind in ("random", "williams")])')
    told = {subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                           env={'PYTHONHASHSEED': seed, 'PYTHONPATH': ':'.join(sys.path)}).stdout
            for seed in ('1', '2')}
    # Recorded values: another machine or Python version must give them too.
    assert told == {f'{[order_of(kind, 7, 11, 5) for kind in ("random", "williams")]}\n'}
    assert order_of('random', 7, 11, 5) == [0, 6, 4, 5, 3, 1, 2]


def test_the_square_of_four_is_the_textbooks() -> None:
    assert williams_rows(4) == [[0, 1, 3, 2], [1, 2, 0, 3], [2, 3, 1, 0], [3, 0, 2, 1]]


def blocks_in(study: StudyFile, place: int, group: str = '') -> str:
    """Return the first letters of the blocks, in the order of a participant."""
    return ''.join(block.name[0] for block in blocks_of(study, place, group))


def test_blocks_are_ordered_as_conditions_are() -> None:
    """Each order of the blocks meets each order of the conditions equally often."""
    plain: dict[str, Any] = {
        'name': 'blocks', 'seed': 2, 'factors': [
            {'name': 'a', 'levels': [{'name': 'x'}, {'name': 'y'}]}],
        'blocks': [{'name': name, 'repetitions': 2} for name in ('first', 'second')]}
    given = read(StudyFile, plain, 'study')
    assert {blocks_in(given, place) for place in range(4)} == {'fs'}
    study = read(StudyFile, plain | {'block_order': 'williams'}, 'study')
    met: Counter[tuple[str, str]] = Counter()
    for place in range(8):
        trials = plan_trials(study, place)
        assert [trial.number for trial in trials] == list(range(1, 9))
        blocks = blocks_in(study, place)
        assert [trial.block[0] for trial in trials] == [name for name in blocks for _ in range(4)]
        met[blocks, next(trial.condition.name for trial in trials if trial.block == 'first')] += 1
        names = [item.id.partition('/')[0] for item in session_of(study, place)]
        assert names == [trial.block for trial in trials]
    assert met == dict.fromkeys((('fs', 'x'), ('fs', 'y'), ('sf', 'x'), ('sf', 'y')), 2)
    turns = read(StudyFile, plain | {'block_sequences': [['second', 'first']] * 2 + [
        ['first', 'second']]}, 'study')
    assert [blocks_in(turns, place) for place in range(4)] == ['sf', 'sf', 'fs', 'sf']
    many = read(StudyFile, plain | {'block_order': 'random', 'blocks': [
        {'name': name} for name in 'abcdef']}, 'study')
    assert len({blocks_in(many, place, group) for place in range(4) for group in 'uv'}) == 8
    with pytest.raises(InputError, match='does not have each block once'):
        read(StudyFile, plain | {'block_sequences': [['first', 'first']]}, 'study')


def test_blocks_with_equally_many_conditions_have_orders_of_their_own() -> None:
    study = read(StudyFile, {
        'name': 'two', 'seed': 11, 'factors': [
            {'name': 'a', 'levels': [{'name': name} for name in 'tuvwxyz']}],
        'blocks': [{'name': name, 'order': 'random'} for name in ('first', 'second')]}, 'study')
    trials = plan_trials(study, 5)
    first, second = ([trial.condition.name for trial in trials if trial.block == name]
                     for name in ('first', 'second'))
    # That of the first block is as if it were alone.
    assert first == ['tuvwxyz'[index] for index in order_of('random', 7, 11, 5)] != second


def test_each_drive_may_have_a_seed_of_its_own() -> None:
    study = read(StudyFile, {
        'name': 'seeds', 'settings': {'seed': 'each'}, 'factors': [
            {'name': 'a', 'levels': [{'name': 'x'}, {'name': 'y', 'seed': 5}]}],
        'blocks': [{'name': 'main', 'repetitions': 3, 'practice': {}}]}, 'study')
    seeds = [[trial.condition.settings.seed for trial in plan_trials(study, place)
              if trial.condition.name == 'x'] for place in range(4)]
    assert len({seed for row in seeds for seed in row}) == 12
    # Drawn by another machine for its first six drives.
    drawn = [1240283022, 212378984, 1781601113, 391212979, 1356494655, 1019340412]
    assert seeds[0] == [drawn[trial.number - 1] for trial in plan_trials(study, 0)
                        if trial.condition.name == 'x']
    assert all(trial.condition.settings.seed == 5 for trial in plan_trials(study, 0)
               if trial.condition.name == 'y')
    assert plan_trials(study, 3) == plan_trials(study, 3)
    practice = session_of(study, 0)[0].what
    assert isinstance(practice, PracticeDrives)
    assert isinstance(practice.settings.seed, int) and practice.settings.seed not in seeds[0]
