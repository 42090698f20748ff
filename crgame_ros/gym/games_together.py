# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Several games of one agent each in one process, as Gymnasium's vector environment."""

from collections.abc import Sequence
from typing import Any, ClassVar

from crgame_ros.errors import InputError
from crgame_ros.gym.agent_game import AgentGame, make_experiment, observe_together
from crgame_ros.gym.agent_spaces import action_space, observation_space
from crgame_ros.gym.driving_env import check_render_mode, Seen
from crgame_ros.gym.episode_setups import SEEDS
from crgame_ros.gym.scene_painter import FRAMES_PER_S, ScenePainter
from crgame_ros.policy.observation import Observation
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

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        'render_modes': ['rgb_array'], 'render_fps': FRAMES_PER_S,
        'autoreset_mode': AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs: int = 1, seat: str = 'av0', render_mode: str | None = None,
                 **keywords: Any) -> None:
        check_render_mode(render_mode, self.metadata['render_modes'])
        if num_envs < 1:
            raise InputError(f'"num_envs" is {num_envs}', 'environment', 'give a number from 1')
        self.num_envs, self.render_mode = num_envs, render_mode
        self.experiment = make_experiment((seat,), **keywords)
        self._games = [AgentGame(self.experiment) for _ in range(num_envs)]
        agent = self._games[0].seats[0]
        self._observation = Observation(
            self.experiment.observation, agent.vehicle.vehicle, agent.view.things)
        self.single_observation_space = observation_space(self.experiment.observation)
        self.single_action_space = action_space(self.experiment.action)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._randoms = [seeding.np_random()[0] for _ in range(num_envs)]
        self._over = np.zeros(num_envs, dtype=bool)
        self._painter: ScenePainter | None = None

    def reset(self, *, seed: int | Sequence[int | None] | None = None,
              options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, object]]:
        """
        Begin an episode in every game.

        :param seed: seed of the first game, which increases by 1 for each next game; or one seed
            for each.
        """
        seeds: Sequence[int | None]
        if seed is None or isinstance(seed, int):
            seeds = [None if seed is None else seed + i for i in range(self.num_envs)]
        else:
            seeds = seed
        infos: dict[str, object] = {}
        for index, own in enumerate(seeds):
            if own is not None:
                self._randoms[index] = seeding.np_random(own)[0]
            infos = self._begin(index, infos)
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
                infos = self._begin(index, infos)
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
        if self._painter is None:
            self._painter = ScenePainter(self._games[0].game.setup)
        return tuple(self._painter.paint(game.game) for game in self._games)

    def _begin(self, index: int, infos: dict[str, object]) -> dict[str, object]:
        game = self._games[index]
        game.begin(int(self._randoms[index].integers(SEEDS)))
        return self._add_info(infos, game.info(), index)

    def _seen(self) -> Seen:
        return observe_together(self._observation, [game.seats[0] for game in self._games])
