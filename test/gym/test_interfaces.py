# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The interfaces of Gymnasium and PettingZoo, by their own checkers, of every environment."""

import subprocess
import sys
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.gym.driving_env import DrivingEnv
from crgame_ros.gym.games_together import GamesTogether
from crgame_ros.gym.parallel_env import ParallelDrivingEnv
from crgame_ros.gym.shipped_environments import ANY_GAME, environment_id
from crgame_ros.paths import extra_install, own_games
import gymnasium
from gymnasium.utils.env_checker import check_env
import numpy as np
from pettingzoo.test import parallel_api_test
import pytest

pytestmark = pytest.mark.filterwarnings('error')


@pytest.mark.matrix('cut_in', 'traffic')
@pytest.mark.slow
@pytest.mark.parametrize('game', own_games())
def test_gymnasium_accepts_every_environment(game: str) -> None:
    # The checker begins a dozen episodes, which share a placement of traffic.
    check_env(gymnasium.make(environment_id(game), worlds=1).unwrapped, skip_render_check=True)


class WithoutOptions(ParallelDrivingEnv):
    """An environment for PettingZoo's checker, which resets with `{'options': 1}`."""

    def reset(self, seed: int | None = None,
              options: object = None) -> tuple[dict[str, Any], dict[str, dict[str, object]]]:
        """Reset, if the options are those of the checker."""
        assert options in (None, {'options': 1})
        return super().reset(seed)


@pytest.mark.matrix('two_avs')
@pytest.mark.slow
@pytest.mark.parametrize('game', own_games())
def test_pettingzoo_accepts_every_game_with_all_its_seats(game: str) -> None:
    parallel_api_test(WithoutOptions(game=game, duration=1.0, worlds=1), num_cycles=12)


@pytest.mark.slow
@pytest.mark.parametrize('keywords', [
    {'seat': 'hv0'}, {'seat': 'hv0', 'action': 'pedals'}, {'action': 'pedals'},
    {'observation': {'parts': ['lidar', 'state'], 'rays': 8}}, {'ticks': 5},
    {'observation': {'scaled': True, 'history': {'state': 3, 'objects': 2}}},
    {'observation': {'parts': ['image', 'state'], 'history': {'image': 2}}, 'seat': 'hv0'},
    {'action': 'manoeuvre', 'ticks': 5},
    {'vary': {'speed': 3.0, 'along': 10.0}}, {'reward': {'ttc': -1.0, 'a_req': -0.1}}])
def test_gymnasium_accepts_every_choice(keywords: dict[str, object]) -> None:
    check_env(gymnasium.make('crgame/Merge-v0', **keywords).unwrapped, skip_render_check=True)


# The checker's own warning: a plan is no vector that could be normalised.
@pytest.mark.filterwarnings('ignore:.*normalized space')
def test_gymnasium_accepts_plans_and_perception() -> None:
    check_env(gymnasium.make('crgame/Fog-v0', action='plan').unwrapped, skip_render_check=True)
    check_env(gymnasium.make('crgame/OccludedPedestrian-v0', action='pedals').unwrapped,
              skip_render_check=True)


@pytest.mark.parametrize(('keywords', 'said'), [
    ({'game': 'no_game'}, 'no_game'), ({}, 'a game or a scenario'),
    ({'game': 'cut_in', 'scenario': 'x.xml'}, 'one of them'),
    ({'game': 'cut_in', 'seat': 'av7'}, 'take one of hv0, av0'),
    ({'game': 'cut_in', 'seat': 'hv0', 'action': 'plan'}, 'by pedals, not by plans'),
    ({'game': 'cut_in', 'seat': 'hv0', 'action': 'manoeuvre'}, 'by pedals, not by plans'),
    ({'game': 'cut_in', 'action': 'fly'}, 'acceleration, pedals, plan, manoeuvre'),
    ({'game': 'cut_in', 'reward': {'joy': 1.0}}, 'there is no term "joy"'),
    ({'game': 'cut_in', 'reward': {'goal': float('nan')}}, 'finite'),
    ({'game': 'cut_in', 'ends': ['boredom']}, 'collision, off_road, goal'),
    ({'game': 'cut_in', 'observation': {'part': []}}, 'unknown'),
    ({'game': 'cut_in', 'vary': {'speed': -1.0}}, 'speed'),
    ({'game': 'cut_in', 'duration': 0.0}, 'positive'), ({'game': 'cut_in', 'ticks': 0}, 'ticks'),
    ({'game': 'cut_in', 'worlds': 0}, 'worlds'), ({'game': 'cut_in', 'worlds': 2.5}, 'worlds'),
    ({'game': 'cut_in', 'ticks': 2.5}, 'ticks'),
    ({'game': 'cut_in', 'observation': ['state']}, 'is no mapping'),
    ({'game': 'cut_in', 'drivers': {'hv7': 'idle'}}, 'hv7'),
    ({'game': 'cut_in', 'render_mode': 'ansi'}, 'rgb_array')])
def test_wrong_keywords_are_refused_in_a_line(keywords: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        DrivingEnv(**keywords)


@pytest.mark.slow
def test_games_together_are_the_same_as_one_after_the_other() -> None:
    keywords = {'game': 'merge', 'duration': 4.0, 'vary': {'speed': 4.0, 'along': 20.0}}
    together = GamesTogether(3, **keywords)
    apart = gymnasium.make_vec(ANY_GAME, 3, vectorization_mode='sync', **keywords)
    action = np.random.default_rng(0).uniform(-0.3, 0.3, (60, 3, 2)).astype(np.float32)
    first, second = together.reset(seed=5), apart.reset(seed=5)
    # Each game ends in between and restarts.
    for given in (*action, None):
        for part, values in first[0].items():
            assert (values == second[0][part]).all()
        for one, other in zip(first[1:-1], second[1:-1], strict=True):
            assert (one == other).all()
        assert first[-1].keys() == second[-1].keys()
        if given is not None:
            first, second = together.step(given), apart.step(given)
    assert first[-1]['time_s'].max() < 2.1


def test_seeds_of_several_games_are_one_or_one_for_each() -> None:
    together = GamesTogether(2, game='cut_in', vary={'speed': 4.0})
    first = together.reset(seed=3)[0]['state']
    for seed in (np.int64(3), [3, 4], [np.int64(3), 4]):
        assert (together.reset(seed=seed)[0]['state'] == first).all()
    for seeds in ([1], [1, 2, 3]):
        with pytest.raises(InputError, match='one for each of the 2 games'):
            together.reset(seed=seeds)
    with pytest.raises(InputError, match='num_envs'):
        GamesTogether(2.5, game='cut_in')  # type: ignore[arg-type]


def test_manoeuvres_and_histories_together_are_those_of_single_games() -> None:
    keywords = {'game': 'merge', 'action': 'manoeuvre', 'ticks': 5, 'duration': 3.0,
                'observation': {'history': {'state': 2}}, 'vary': {'speed': 4.0}}
    together = GamesTogether(2, **keywords)
    apart = gymnasium.make_vec(ANY_GAME, 2, vectorization_mode='sync', **keywords)
    first, second = together.reset(seed=5), apart.reset(seed=5)
    for actions in ((0, 3), (4, 3), (1, 0), (0, 0), (2, 1), (0, 0), (0, 0), (3, 0)):
        for part, values in first[0].items():
            assert (values == second[0][part]).all()
        assert (first[-1]['action_mask'] == second[-1]['action_mask']).all()
        first, second = together.step(np.array(actions)), apart.step(np.array(actions))


def test_pettingzoo_accepts_manoeuvres() -> None:
    parallel_api_test(WithoutOptions(game='two_avs', seats=('av0', 'av1'), action='manoeuvre',
                                     duration=1.0), num_cycles=12)


def test_processes_give_the_same_episodes_as_one() -> None:
    keywords = {'game': 'cut_in', 'vary': {'speed': 2.0}}
    together = gymnasium.make_vec(ANY_GAME, 2, **keywords)
    assert isinstance(together, GamesTogether)
    apart = gymnasium.make_vec(ANY_GAME, 2, vectorization_mode='async', **keywords)
    action = np.array(((0.2, 0.0), (-0.3, 0.01)), np.float32)
    try:
        for environment in (together, apart):
            environment.reset(seed=3)
        for _ in range(5):
            first, second = together.step(action), apart.step(action)
            for part, values in first[0].items():
                assert (values == second[0][part]).all()
            assert first[1] == pytest.approx(second[1], abs=0.0)
    finally:
        apart.close()


def test_the_package_says_what_to_install_where_gymnasium_is_missing() -> None:
    done = subprocess.run(
        [sys.executable, '-c', 'import sys; sys.modules["gymnasium"] = None\n'
         'import crgame_ros.cli, crgame_ros.policy.planner\n'
         'try:\n    import crgame_ros.gym\nexcept ImportError as e:\n    print(e)'],
        capture_output=True, text=True, check=True)
    assert done.stdout == ('crgame_ros.gym needs the package gymnasium, which is not installed: '
                           f'{extra_install("gym")}\n')
