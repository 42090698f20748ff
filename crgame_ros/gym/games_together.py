# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Several games of one agent each in one process, as Gymnasium's vector environment."""

from collections.abc import Sequence
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.gym.agent_game import AgentGame, Episodes, make_experiment, observed_together
from crgame_ros.gym.agent_spaces import action_space, observation_space
from crgame_ros.gym.driving_env import check_render_mode, Seen
from crgame_ros.gym.episode_options import EpisodeOptions, read_options
from crgame_ros.gym.episode_setups import check_count, SEEDS
from crgame_ros.gym.scene_painter import FRAMES_PER_S
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class GamesTogether(VectorEnv[Seen, NDArray[np.float32], Array]):
    """
    A vector environment with the same results as several `DrivingEnv`, to the last bit.

    The engines step one by one. The observations of all games are computed at once, and the
    scenario is loaded once.

    :param num_envs: number of games.
    :param seat: id of the agent's vehicle in each game.
    :param render_mode: `rgb_array` or None.
    :param keywords: those of `make_experiment`.
    :raises InputError: if a keyword is wrong.
    """

    metadata = {'render_modes': ['rgb_array'], 'render_fps': FRAMES_PER_S,
                'autoreset_mode': AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs: int = 1, seat: str = 'av0', render_mode: str | None = None,
                 **keywords: Any) -> None:
        check_render_mode(render_mode, self.metadata['render_modes'])
        check_count('num_envs', num_envs)
        self.num_envs, self.render_mode = num_envs, render_mode
        self.experiment = make_experiment((seat,), **keywords)
        self._episodes = [Episodes(self.experiment) for _ in range(num_envs)]
        self.single_observation_space = observation_space(
            self.experiment.observation, self.experiment.action)
        self.single_action_space = action_space(self.experiment.action)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._randoms = [seeding.np_random()[0] for _ in range(num_envs)]
        self._over = np.zeros(num_envs, dtype=bool)

    def reset(self, *, seed: int | Sequence[int | None] | None = None,
              options: dict[str, object] | None = None) -> tuple[Seen, dict[str, object]]:
        """
        Begin an episode in every game.

        :param seed: seed of the first game, which increases by 1 for each next game; or one seed
            for each.
        :param options: keys of `EpisodeOptions`, for every game: scene, start, difficulty. Games
            that begin anew in `step` have none.
        :raises InputError: if an option is unknown or wrong, or there are more or fewer seeds
            than games.
        """
        wanted = read_options(options)
        seeds: Sequence[int | None]
        if seed is None or isinstance(seed, int | np.integer):
            seeds = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        elif len(seed) == self.num_envs:
            seeds = seed
        else:
            raise InputError(f'"seed" has {len(seed)} seeds', 'reset',
                             f'give one for each of the {self.num_envs} games, or one number')
        infos: dict[str, object] = {}
        for index, own in enumerate(seeds):
            if own is not None:
                self._randoms[index] = seeding.np_random(int(own))[0]
            infos = self._begin(index, infos, wanted)
        self._over[:] = False
        return self._seen(), infos

    def step(self, actions: NDArray[np.float32]) -> tuple[  # type: ignore[override]
            Seen, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, object]]:
        """Drive every game until its next decision; a game that is over is reset instead."""
        begun = self._over.copy()
        rewards = np.zeros(self.num_envs)
        terminated, truncated = np.zeros((2, self.num_envs), dtype=bool)
        infos: dict[str, object] = {}
        for index, game in enumerate(self._games):
            if begun[index]:
                infos = self._begin(index, infos, EpisodeOptions())
                continue
            game.act({game.seats[0].id: actions[index]})
            outcome = game.outcomes()[0]
            rewards[index], terminated[index], truncated[index] = outcome[:3]
            infos = self._add_info(infos, outcome.info, index)
        self._over = terminated | truncated
        return self._seen(), rewards, terminated, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return a picture of each game in the mode `rgb_array`."""
        if self.render_mode is None:
            return None
        return tuple(game.paint() for game in self._games)

    @property
    def _games(self) -> list[AgentGame]:
        return [episodes.agent for episodes in self._episodes]

    def _begin(self, index: int, infos: dict[str, object],
               options: EpisodeOptions) -> dict[str, object]:
        game = self._episodes[index].begin(int(self._randoms[index].integers(SEEDS)), options)
        return self._add_info(infos, game.info(), index)

    def _seen(self) -> Seen:
        return observed_together(self._games)
