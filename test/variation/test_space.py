# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What varies in a game: values, distributions, constraints, keys and samples."""

from collections.abc import Mapping
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.game import load_game, parse_game
from crgame_ros.game.variation_spec import Dimension
from crgame_ros.paths import scenarios_directory
from crgame_ros.schema.writing import write
from crgame_ros.variation.space import Axis, game_of, sample, space_of, VariantSpace
import numpy as np
import pytest
from scipy import stats

FAMILY = scenarios_directory() / 'cut_in_family.yaml'


def space(*entries: Mapping[str, object], **values: object) -> VariantSpace:
    return space_of({'scenario': 'x.xml', 'vary': list(entries), **values}, 'game.yaml')


@pytest.mark.parametrize(('given', 'law'), [
    ({'start': 2.0, 'end': 8.0}, stats.uniform(2, 6)),
    ({'start': 2.0, 'end': 8.0, 'distribution': 'loguniform'}, stats.loguniform(2, 8)),
    ({'mean': 3.0, 'deviation': 2.0, 'distribution': 'normal'}, stats.norm(3, 2)),
    ({'start': 0.0, 'mean': 3.0, 'deviation': 2.0, 'distribution': 'normal'},
     stats.truncnorm(-1.5, np.inf, 3, 2)),
    ({'mean': 3.0, 'deviation': 0.4, 'distribution': 'lognormal'}, stats.lognorm(0.4, scale=3)),
])
def test_values_follow_the_stated_distribution(given: dict[str, object], law: object) -> None:
    axis = Axis(Dimension('x', **given))  # type: ignore[arg-type]
    shares = np.linspace(0.01, 0.99, 25)
    values = [axis.value(share) for share in shares]
    assert values == pytest.approx(law.ppf(shares), rel=1e-5)  # type: ignore[attr-defined]
    assert [axis.share(value) for value in values] == pytest.approx(shares, abs=1e-5)


def test_whole_numbers_and_listed_values_are_equally_likely() -> None:
    shares = (np.arange(4000) + 0.5) / 4000
    whole = Axis(Dimension('x', start=1.0, end=4.0, whole=True))
    assert np.unique([whole.value(share) for share in shares], return_counts=True)[1].tolist() \
        == [1000] * 4
    assert whole.levels == [1, 2, 3, 4]
    listed = Axis(Dimension('x', values=('a', 'b')))
    assert [listed.value(share) for share in (0.0, 0.49, 0.51, 1.0)] == ['a', 'a', 'b', 'b']


def test_keys_are_set_by_ids_names_and_indices() -> None:
    made = game_of(load_game(FAMILY), {'gap': 10.0, 'difference': 5.0, 'deceleration': 4.0}, '')
    car = made.objects[0]
    assert car.path[0] == (24.508, 0.0)
    assert car.path[2][0] == pytest.approx(24.508 + 15.0 ** 2 / 8.0)
    assert (car.speeds, car.deceleration) == ((15.0, 15.0, 0.0), 4.0)
    assert made.vary == ()


def test_a_game_whose_value_a_lognormal_distribution_cannot_have_is_refused() -> None:
    entry = {'name': 'seed', 'key': 'seed', 'mean': 3.0, 'deviation': 0.4,
             'distribution': 'lognormal'}
    with pytest.raises(InputError, match=r'"seed" is 0 in the game as it is; give a `nominal`'):
        space(entry, seed=0)
    assert space(entry | {'nominal': 1.0}, seed=0).distance({'seed': 1.0}, {'seed': 1.0}) == 0.0


def test_a_game_as_it_is_has_the_values_of_its_file() -> None:
    game = load_game(FAMILY)
    nominal = space_of(write(game, game.base), '').nominal
    assert nominal == {'gap': 30, 'difference': 0, 'deceleration': 2}
    made = game_of(game, nominal, '')
    assert made.objects[0].path[0][0] == pytest.approx(game.objects[0].path[0][0], abs=0.01)


@pytest.mark.parametrize('sampling', ['sobol', 'lhs', 'random'])
def test_samples_fill_the_space_and_keep_its_constraints(sampling: str) -> None:
    made = space({'name': 'a', 'from': 0, 'to': 1}, {'name': 'b', 'from': 0, 'to': 1},
                 {'where': 'a + b < 1.5'})
    found = sample(made, sampling, 500, 3, '')  # type: ignore[arg-type]
    assert found == sample(made, sampling, 500, 3, '')  # type: ignore[arg-type]
    assert found != sample(made, sampling, 500, 4, '')  # type: ignore[arg-type]
    points = np.array([list(each.values()) for each in found])
    assert len(points) == 500 and (points.sum(axis=1) < 1.5).all()
    # Each quarter below the line has 2/7 of the area.
    quarter = np.mean((points < 0.5).all(axis=1))
    assert quarter == pytest.approx(2.0 / 7.0, abs=0.06)


def test_a_grid_has_all_combinations_that_keep_the_constraints() -> None:
    made = space({'name': 'a', 'from': 0, 'to': 4}, {'name': 'b', 'values': [1, 2]},
                 {'where': 'a >= b'})
    assert sample(made, 'grid', 1, 0, '') == [
        {'a': a, 'b': b} for a in (0.0, 1.0, 2.0, 3.0, 4.0) for b in (1, 2) if a >= b]


def test_constraints_that_nothing_keeps_are_refused() -> None:
    made = space({'name': 'a', 'from': 0, 'to': 1}, {'where': 'a > 2'})
    with pytest.raises(InputError, match='keep the constraints'):
        sample(made, 'random', 4, 0, 'game.yaml')


@pytest.mark.parametrize(('entries', 'told'), [
    ([{'name': 'a'}], r'vary\[0\]: has no range; give from and to, or values'),
    ([{'name': 'a', 'from': 3, 'to': 1}], 'let "from" be less than "to"'),
    ([{'name': 'a', 'from': 0, 'to': 1, 'values': [1]}], 'leave one out'),
    ([{'name': 'a', 'from': 0, 'to': 1, 'distribution': 'loguniform'}], 'above 0'),
    ([{'name': 'a', 'distribution': 'normal'}], 'give both'),
    ([{'name': 'a', 'from': 0, 'to': 1}] * 2, 'name "a" is there already'),
    ([{'where': 'a > 1'}], 'nothing varies'),
    ([{'name': 'a', 'from': 0, 'to': 1}, {'where': 'b > 1'}], 'there are a'),
    ([{'name': 'a', 'from': 0, 'to': 1}, {'where': 'a >'}], 'is no expression'),
    ([{'name': 'a', 'from': 0, 'to': 1}, {'where': 'open("x")'}], 'has no value'),
    ([{'name': 'a', 'from': 0, 'to': 1}, {'where': '().__class__'}], 'has no value'),
    ([{'name': 'a', 'from': 0, 'to': 1, 'key': 'humans.hv7.spawn'}], "no entry 'hv7'"),
])
def test_what_cannot_vary_is_refused_in_one_line(entries: list[dict[str, object]],
                                                 told: str) -> None:
    with pytest.raises(InputError, match=told) as refused:
        space(*entries, humans=[{'id': 'hv0'}])
    assert '\n' not in str(refused.value)


def test_a_value_that_the_game_refuses_is_told_with_its_dimension() -> None:
    made = space_of({'scenario': 'x.xml', 'vary': [
        {'name': 'rate', 'from': 1, 'to': 20000, 'key': 'timing.rate'}]}, 'game.yaml')
    with pytest.raises(InputError, match=r'with rate = 20000.0: "rate" is 20000'):
        made.check(Path(), 'game.yaml')


def test_two_entries_for_one_key_are_refused_with_the_game() -> None:
    with pytest.raises(InputError, match='key "duration" is there already'):
        parse_game({'scenario': 'x.xml', 'vary': [
            {'name': 'a', 'from': 1, 'to': 2, 'key': 'duration'},
            {'value': 'a', 'key': 'duration'}]}, 'game.yaml', Path())
