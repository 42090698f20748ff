# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A game for several agents, as PettingZoo's parallel environment."""

from collections.abc import Sequence
from typing import Any, ClassVar

from crgame_ros.errors import InputError
from crgame_ros.gym.agent_game import AgentGame, Episodes, make_experiment
from crgame_ros.gym.agent_spaces import action_space, observation_space
from crgame_ros.gym.driving_env import check_render_mode, Seen
from crgame_ros.gym.episode_options import read_options
from crgame_ros.gym.episode_setups import SEEDS
from crgame_ros.gym.scene_painter import FRAMES_PER_S
from crgame_ros.paths import extra_install
from gymnasium import spaces
import numpy as np
from numpy.typing import NDArray

try:
    from pettingzoo import ParallelEnv
except ImportError as _error:
    raise ImportError('crgame_ros.gym.parallel_env needs the package pettingzoo, which is not '
                      f'installed: {extra_install("gym")}', name='pettingzoo') from _error


class ParallelDrivingEnv(ParallelEnv[str, Seen, NDArray[np.float32]]):
    """
    An environment in which several vehicles are each driven by an agent, at the same time.

    When one agent's episode is terminated, those of all others are truncated: they would
    otherwise continue with a vehicle that has no driver.

    :param seats: ids of the agents' vehicles; None takes all.
    :param render_mode: `rgb_array` or None.
    :param keywords: those of `make_experiment`.
    :raises InputError: if a keyword is wrong.
    """

    metadata: ClassVar[dict[str, object]] = {
        'name': 'crgame_v0', 'render_modes': ['rgb_array'], 'render_fps': FRAMES_PER_S,
        'is_parallelizable': True}

    def __init__(self, seats: Sequence[str] | None = None, render_mode: str | None = None,
                 **keywords: Any) -> None:
        check_render_mode(render_mode, ['rgb_array'])
        if seats is None:
            # Without seats of agents, a game has those of its file.
            seats = Episodes(make_experiment((), **keywords)).agent.setups.base.vehicle_ids
        if not seats or len(set(seats)) < len(seats):
            raise InputError(f'"seats" are {list(seats)}', 'environment',
                             'name each vehicle once, and one at least')
        self.experiment = make_experiment(seats, **keywords)
        self.render_mode = render_mode
        self.possible_agents = list(seats)
        self.agents: list[str] = []
        self._episodes = Episodes(self.experiment)
        self.observation_spaces = {
            seat: observation_space(self.experiment.observation, self.experiment.action)
            for seat in seats}
        self.action_spaces = {seat: action_space(self.experiment.action) for seat in seats}
        self._random = np.random.Generator(np.random.PCG64())

    def observation_space(self, agent: str) -> spaces.Dict:
        """Return the space of an agent's observations."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Box | spaces.Discrete:
        """Return the space of an agent's actions."""
        return self.action_spaces[agent]

    @property
    def _together(self) -> AgentGame:
        return self._episodes.agent

    def reset(self, seed: int | None = None, options: dict[str, object] | None = None
              ) -> tuple[dict[str, Seen], dict[str, dict[str, object]]]:
        """
        Begin an episode; equal seeds and equal actions give equal episodes.

        :param options: keys of `EpisodeOptions`: scene, start, difficulty.
        :raises InputError: if an option is unknown or wrong.
        """
        wanted = read_options(options)
        if seed is not None:
            self._random = np.random.Generator(np.random.PCG64(seed))
        self._episodes.begin(int(self._random.integers(SEEDS)), wanted)
        self.agents = list(self.possible_agents)
        return self._seen(), {agent: self._together.info(number)
                              for number, agent in enumerate(self.agents)}

    def step(self, actions: dict[str, NDArray[np.float32]]) -> tuple[
            dict[str, Seen], dict[str, float], dict[str, bool], dict[str, bool],
            dict[str, dict[str, object]]]:
        """
        Drive until the next decision.

        :raises PlanningError: if an action is invalid.
        :raises InputError: if an agent's action is missing.
        """
        agents = self.agents
        if not agents:
            return {}, {}, {}, {}, {}
        missing = [agent for agent in agents if agent not in actions]
        if missing:
            raise InputError('has no action', missing[0], 'give one for each agent')
        self._together.act(actions)
        outcomes = dict(zip(agents, self._together.outcomes(), strict=True))
        over = any(item.terminated or item.truncated for item in outcomes.values())
        if over:
            self.agents = []
        return (self._seen(), {agent: item.reward for agent, item in outcomes.items()},
                {agent: item.terminated for agent, item in outcomes.items()},
                {agent: over and not item.terminated for agent, item in outcomes.items()},
                {agent: item.info for agent, item in outcomes.items()})

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture (H, W, 3) around the first agent in the mode `rgb_array`."""
        return None if self.render_mode is None else self._together.paint()

    def _seen(self) -> dict[str, Seen]:
        return {agent: self._together.observed(number)
                for number, agent in enumerate(self.possible_agents)}
