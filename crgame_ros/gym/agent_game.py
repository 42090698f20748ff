# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A game from the view of its agents: observations, rewards and the end of episodes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
import math
from pathlib import Path
from typing import NamedTuple

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.errors import InputError, PlanningError
from crgame_ros.game.game import Game
from crgame_ros.gym.driving_game import AgentSeat, DrivingGame
from crgame_ros.gym.episode_options import EpisodeOptions, read_options
from crgame_ros.gym.episode_setups import EpisodeSetups, StartVariation
from crgame_ros.gym.reward import Decision, Reward, USUAL_REWARD
from crgame_ros.gym.scene_painter import ScenePainter
from crgame_ros.gym.scenes import (
    adapted,
    folder_scenes,
    one_scene,
    Scenes,
    SceneSetups,
    TEST_SHARE,
)
from crgame_ros.policy.actions import ACTION_KINDS, ActionKind
from crgame_ros.policy.observation import Observation, ObservationHistory, Observed
from crgame_ros.policy.observation_spec import Depths, ObservationSpec
from crgame_ros.schema.reading import read
from crgame_ros.simulation.offline import observed_run
from crgame_ros.simulation.setup import Setup
import numpy as np
from numpy.typing import NDArray

ENDS = ('collision', 'off_road', 'goal')
# Games of an environment that stay in memory.
_KEPT = 8


@dataclass(frozen=True)
class Experiment:
    """
    The settings that all episodes of an environment share; see `docs/gym.md`.

    :param observation: content of the observations.
    :param reward: terms of the reward.
    :param ends: events that terminate an episode.
    :param ticks: number of scenario steps for which an action holds.
    :param difficulty: of episodes whose options have none; None is the game as it is.
    """

    setups: SceneSetups
    seats: tuple[str, ...]
    action: ActionKind
    observation: ObservationSpec
    reward: Reward
    ends: tuple[str, ...]
    ticks: int
    difficulty: float | None


def make_experiment(
    seats: Sequence[str], game: Game | Path | str | None = None,
    scenario: Path | str | None = None, action: ActionKind = 'acceleration',
    observation: Mapping[str, object] | None = None, reward: Mapping[str, float] | None = None,
    ends: Sequence[str] = ENDS, duration: float | None = None, ticks: int = 1,
    drivers: Mapping[str, str] | None = None, planners: Mapping[str, str] | None = None,
    vary: Mapping[str, float] | None = None, worlds: int | None = None,
    scenes: Path | str | None = None, split: str = 'all', test_share: float = TEST_SHARE,
    difficulty: float | None = None,
) -> Experiment:
    """
    Build an experiment from the keywords of an environment, and check these.

    :param seats: ids of the vehicles that agents drive.
    :param vary: keys of `StartVariation`.
    :param worlds: as for `EpisodeSetups`.
    :param scenes: folder of scenes, in place of a game or a scenario.
    :param split: which of its scenes: `train`, `test` or `all`.
    :param test_share: as for `is_for_test`.
    :param difficulty: as for `EpisodeOptions`.
    :raises InputError: if a keyword is wrong, or the game cannot be used.
    """
    if action not in ACTION_KINDS:
        raise InputError(f'"action" is {action!r}', 'environment',
                         'use one of ' + ', '.join(ACTION_KINDS))
    for end in ends:
        if end not in ENDS:
            raise InputError(f'there is no end "{end}"', 'environment', 'use ' + ', '.join(ENDS))
    if duration is not None and not 0.0 < duration < math.inf:
        raise InputError(f'"duration" is {duration}', 'environment',
                         'give a positive number of seconds')
    if sum(item is not None for item in (game, scenario, scenes)) != 1:
        raise InputError('name a game or a scenario or a folder of scenes, one of them',
                         'environment', "such as game='cut_in'")
    if difficulty is not None:
        difficulty = read_options({'difficulty': difficulty}).difficulty
    chosen = one_scene(game, scenario, seats) if scenes is None else folder_scenes(
        scenes, split, test_share, seats)
    drivers, planners = dict(drivers or {}), dict(planners or {})

    def load(name: str) -> Game:
        try:
            return adapted(chosen.load(name), drivers, planners, duration)
        except InputError as error:
            if scenes is None:
                raise
            raise InputError(error.what, f'{name}: {error.where}', error.remedy) from error

    return Experiment(
        SceneSetups(Scenes(chosen.names, load),
                    read(StartVariation, vary or {}, 'vary'), worlds),
        tuple(seats), action, read(ObservationSpec, observation or {}, 'observation'),
        Reward(USUAL_REWARD if reward is None else reward), tuple(ends), ticks, difficulty)


class AgentOutcome(NamedTuple):
    """
    The outcome of a decision for an agent, besides the observation.

    :param terminated: whether an event ended the episode.
    :param truncated: whether the time limit ended the episode.
    """

    reward: float
    terminated: bool
    truncated: bool
    info: dict[str, object]


class AgentGame:
    """
    One game and its agents.

    :param experiment: settings that its episodes share.
    :param driving: makes the game, which moves all vehicles and objects.
    :ivar game: this game.
    """

    def __init__(self, experiment: Experiment, setups: EpisodeSetups, scene: str,
                 driving: type[DrivingGame] = DrivingGame) -> None:
        self.experiment, self.setups, self.scene = experiment, setups, scene
        self.game = driving(setups.base, experiment.seats, experiment.action, experiment.ticks)
        self._observations = [
            Observation(experiment.observation, seat.vehicle.vehicle, setups.base.loaded.scenario)
            for seat in self.game.seats]
        self._histories = [ObservationHistory(experiment.observation) for _ in self.game.seats]
        self._criticality: Criticality | None = None

    @property
    def has_present_alone(self) -> bool:
        """Return whether observations need neither a history nor a mask."""
        return self.experiment.action != 'manoeuvre' and \
            self.experiment.observation.history == Depths()

    @property
    def seats(self) -> list[AgentSeat]:
        """Return the agents' seats."""
        return self.game.seats

    def begin(self, setup: Setup) -> None:
        """Begin an episode."""
        if self.experiment.reward.is_measured:
            self._criticality = Criticality(observed_run(setup))
        for history in self._histories:
            history.begin()
        self.game.begin(setup, [] if self._criticality is None else [self._criticality])

    def act(self, actions: Mapping[str, object]) -> None:
        """Advance to the next decision (`DrivingGame.act`)."""
        self.game.act(actions)

    def observed(self, number: int) -> Observed:
        """Return an agent's observation, by part, once for each decision."""
        seat = self.seats[number]
        return self.completed(number, self._observations[number].observe_one(
            seat.around, seat.place, seat.guide))

    def observe(self, number: int, seats: Sequence[AgentSeat]) -> Observed:
        """
        Return the present parts of the observations of an agent in several games like this.

        :return: (B, …) by part
        """
        return self._observations[number].observe(
            [seat.around for seat in seats], [seat.place for seat in seats],
            [seat.guide for seat in seats])

    def completed(self, number: int, seen: Observed) -> Observed:
        """Return an agent's observation with its history and the mask of its manoeuvres."""
        whole = self._histories[number].add(seen)
        if self.seats[number].manoeuvres is not None:
            whole['mask'] = self.seats[number].mask.astype(np.float32)
        return whole

    def outcomes(self) -> list[AgentOutcome]:
        """Return the outcome of the last decision for each agent."""
        return [self._outcome(seat, off) for seat, off in zip(
            self.seats, self.game.off_road(), strict=True)]

    def paint(self) -> NDArray[np.uint8]:
        """Return a picture (H, W, 3) around the first agent."""
        return self._painter.paint(self.game)

    @cached_property
    def _painter(self) -> ScenePainter:
        return ScenePainter(self.setups.base.loaded.scenario.lanelet_network)

    def info(self, number: int = 0) -> dict[str, object]:
        """Return an agent's information on the start of the episode."""
        return {'time_s': self.game.time_s, 'seed': self.game.setup.game.seed,
                'scene': self.scene, **_mask_info(self.seats[number])}

    def _outcome(self, seat: AgentSeat, off_road: bool) -> AgentOutcome:
        game, experiment = self.game, self.experiment
        scheduler = game.simulation.scheduler
        measures = None if self._criticality is None else next(
            tick for tick in self._criticality.latest if tick.subject == seat.row)
        collision = bool(seat.hit)
        reward, terms = experiment.reward.compute(Decision(
            experiment.ticks * scheduler.time_step_s, seat.before[0], seat.state, seat.place,
            collision, off_road, seat.goal, measures))
        happened = {'collision': collision, 'off_road': off_road, 'goal': seat.goal}
        terminated = any(happened[end] for end in experiment.ends)
        time_s = game.time_s
        info = {'time_s': time_s, **happened, 'hit': ','.join(seat.hit), 'terms': terms,
                **_mask_info(seat)}
        if seat.refusal is not None:
            info['refusal'] = seat.refusal
        return AgentOutcome(reward, terminated, time_s >= self.setups.duration_s - 1e-9, info)


class Episodes:
    """
    The episodes of one environment, each in the game of its scene and difficulty.

    The games used last are kept.

    :param experiment: settings that the episodes share.
    :ivar agent: the game of the present episode; before the first one, that of the first scene.
    """

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        self._game = lru_cache(_KEPT)(self._make_game)
        first = experiment.setups.scenes.names[0]
        self.agent = self._game(experiment.setups.of(first, None, 0), first)

    def begin(self, seed: int, options: EpisodeOptions) -> AgentGame:
        """
        Begin an episode; equal seeds and options give equal episodes.

        :raises InputError: if there is no such scene, or its file cannot be used.
        """
        scenes, difficulty = self.experiment.setups.scenes, options.difficulty
        if options.scene is not None:
            scenes.check(options.scene)
        if difficulty is None:
            difficulty = self.experiment.difficulty
        scene = options.scene or scenes.pick(seed)
        self.agent = self._game(self.experiment.setups.of(scene, difficulty, seed), scene)
        guides = {seat.id: seat.guide for seat in self.agent.seats}
        self.agent.begin(self.agent.setups.make(
            seed, guides, options.start, 1.0 if difficulty is None else difficulty))
        return self.agent

    def _make_game(self, setups: EpisodeSetups, scene: str) -> AgentGame:
        try:
            return AgentGame(self.experiment, setups, scene)
        except PlanningError as error:
            raise InputError(str(error), scene, 'move it out of the scenes') from error


def observed_together(games: Sequence[AgentGame]) -> Observed:
    """
    Return the observations of the first agents of several games, (B, …) by part.

    Those of games with the same setups are computed at once.
    """
    first = games[0]
    if not all(game.setups is first.setups for game in games):
        return _stacked([game.observed(0) for game in games])
    seen = first.observe(0, [game.seats[0] for game in games])
    if first.has_present_alone:
        return seen
    return _stacked([game.completed(0, {part: values[row] for part, values in seen.items()})
                     for row, game in enumerate(games)])


def _stacked(seen: Sequence[Observed]) -> Observed:
    return {part: np.stack([each[part] for each in seen]) for part in seen[0]}


def _mask_info(seat: AgentSeat) -> dict[str, object]:
    return {} if seat.manoeuvres is None else {'action_mask': seat.mask.astype(np.int8)}
