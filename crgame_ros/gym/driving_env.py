# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A game for one agent, as Gymnasium's environment."""

from typing import Any, TYPE_CHECKING

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.gym.agent_game import AgentGame, Episodes, make_experiment
from crgame_ros.gym.agent_spaces import action_space, observation_space
from crgame_ros.gym.episode_options import read_options
from crgame_ros.gym.episode_setups import SEEDS
from crgame_ros.gym.scene_painter import FRAMES_PER_S
from crgame_ros.policy.observation_spec import Numbers
import gymnasium
from gymnasium import spaces
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from crgame_ros.gym.page_viewer import PageViewer

Seen = dict[str, Numbers]


class DrivingEnv(gymnasium.Env[Seen, NDArray[np.float32] | np.int64]):
    """
    An environment in which an agent drives one vehicle; all others drive as in an offline run.

    :param seat: id of the agent's vehicle: a human's (hv0, …) or an AV (av0, …).
    :param render_mode: `rgb_array` draws a picture, `human` shows the cockpit's page.
    :param keywords: those of `make_experiment`: game or scenario, action, observation, reward,
        ends, duration, ticks, drivers, planners, vary, worlds, difficulty; or, in place of a game,
        scenes, split and test_share.
    :raises InputError: if a keyword is wrong.
    """

    metadata = {'render_modes': ['human', 'rgb_array'], 'render_fps': FRAMES_PER_S}

    def __init__(self, seat: str = 'av0', render_mode: str | None = None, **keywords: Any) -> None:
        check_render_mode(render_mode, self.metadata['render_modes'])
        self.experiment = make_experiment((seat,), **keywords)
        self.render_mode = render_mode
        self._episodes = Episodes(self.experiment)
        self.observation_space: spaces.Dict = observation_space(  # type: ignore[assignment]
            self.experiment.observation, self.experiment.action)
        self.action_space: spaces.Box | spaces.Discrete = action_space(  # type: ignore[assignment]
            self.experiment.action)
        self._viewer: PageViewer | None = None
        self._begun = False

    @property
    def agent(self) -> AgentGame:
        """Return the game of the present episode."""
        return self._episodes.agent

    def reset(self, *, seed: int | None = None,
              options: dict[str, object] | None = None) -> tuple[Seen, dict[str, object]]:
        """
        Begin an episode; equal seeds and equal actions give equal episodes.

        :param options: keys of `EpisodeOptions`: scene, start, difficulty.
        :raises InputError: if an option is unknown or wrong.
        """
        wanted = read_options(options)
        super().reset(seed=seed)
        self._episodes.begin(int(self.np_random.integers(SEEDS)), wanted)
        self._begun = True
        if self.render_mode == 'human':
            self._show(begin=True)
        return self.agent.observed(0), self.agent.info()

    def step(self, action: NDArray[np.float32] | np.int64
             ) -> tuple[Seen, float, bool, bool, dict[str, object]]:
        """
        Drive until the next decision.

        :raises PlanningError: if the action is invalid.
        """
        self._need_begun()
        self.agent.act({self.agent.seats[0].id: action})
        outcome = self.agent.outcomes()[0]
        if self.render_mode == 'human':
            self._show()
        return (self.agent.observed(0), outcome.reward, outcome.terminated, outcome.truncated,
                outcome.info)

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture (H, W, 3) in the mode `rgb_array`; None in the mode `human`."""
        self._need_begun()
        return self.agent.paint() if self.render_mode == 'rgb_array' else None

    def action_masks(self) -> NDArray[np.bool_]:
        """
        Return which manoeuvres there are, (5): the method that sb3-contrib calls.

        :raises InputError: if the actions are no manoeuvres.
        """
        self._need_begun()
        if self.agent.seats[0].manoeuvres is None:
            raise InputError(f'actions "{self.experiment.action}" have no mask', 'environment',
                             'use the action manoeuvre')
        return self.agent.seats[0].mask

    def close(self) -> None:
        """Stop the page's server, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    @property
    def page(self) -> str | None:
        """Return the address of the page; None before the first reset and in other modes."""
        return None if self._viewer is None else self._viewer.url

    def _show(self, begin: bool = False) -> None:
        if self._viewer is None:
            # The server needs aiohttp and a thread: it starts only for this mode.
            from crgame_ros.gym.page_viewer import PageViewer
            self._viewer = PageViewer()
        if begin:
            self._viewer.begin(self.agent.game)
        self._viewer.show(self.agent.game)

    def _need_begun(self) -> None:
        if not self._begun:
            raise CrgameError('the environment has not begun: call reset first')


def check_render_mode(mode: str | None, modes: list[str]) -> None:
    """
    Check the render mode.

    :raises InputError: naming the known modes, if it is unknown.
    """
    if mode is not None and mode not in modes:
        raise InputError(f'"render_mode" is {mode!r}', 'environment', 'use ' + ', '.join(modes))
