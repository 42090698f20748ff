# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A game from the view of its agents: observations, rewards and the end of episodes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import math
from pathlib import Path
from typing import Any, NamedTuple

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.errors import InputError
from crgame_ros.game.game import Game
from crgame_ros.gym.driving_game import AgentSeat, DrivingGame
from crgame_ros.gym.episode_setups import chosen_game, EpisodeSetups, StartVariation
from crgame_ros.gym.reward import Decision, GoalWatch, Reward, USUAL_REWARD
from crgame_ros.policy.actions import ACTION_KINDS, ActionKind
from crgame_ros.policy.observation import Observation, Observed
from crgame_ros.policy.observation_spec import ObservationSpec
from crgame_ros.schema.reading import read
from crgame_ros.simulation.offline import DEFAULT_DURATION_S, observed_run
from crgame_ros.simulation.setup import AvSetup
import numpy as np
from numpy.typing import NDArray

ENDS = ('collision', 'off_road', 'goal')


@dataclass(frozen=True)
class Experiment:
    """
    The settings that all episodes of an environment share; see `docs/gym.md`.

    :param setups: setups of the episodes.
    :param seats: seats of the agents.
    :param action: kind of the actions.
    :param observation: content of the observations.
    :param reward: terms of the reward.
    :param ends: events that terminate an episode.
    :param ticks: number of scenario steps for which an action holds.
    :param duration_s: simulated time after which an episode is truncated [s]
    """

    setups: EpisodeSetups
    seats: tuple[str, ...]
    action: ActionKind
    observation: ObservationSpec
    reward: Reward
    ends: tuple[str, ...]
    ticks: int
    duration_s: float


def make_experiment(
    seats: Sequence[str], game: Game | Path | str | None = None,
    scenario: Path | str | None = None, action: ActionKind = 'acceleration',
    observation: Mapping[str, object] | None = None, reward: Mapping[str, float] | None = None,
    ends: Sequence[str] = ENDS, duration: float | None = None, ticks: int = 1,
    drivers: Mapping[str, str] | None = None, planners: Mapping[str, str] | None = None,
    vary: Mapping[str, float] | None = None, worlds: int | None = None,
) -> Experiment:
    """
    Build an experiment from the keywords of an environment, and check these.

    :param seats: ids of the vehicles that agents drive.
    :param vary: keys of `StartVariation`.
    :param worlds: as for `EpisodeSetups`.
    :raises InputError: if a keyword is wrong, or the game cannot be used.
    """
    if action not in ACTION_KINDS:
        raise InputError(f'"action" is {action!r}', 'environment',
                         'use one of ' + ', '.join(ACTION_KINDS))
    for end in ends:
        if end not in ENDS:
            raise InputError(f'there is no end "{end}"', 'environment', 'use ' + ', '.join(ENDS))
    chosen = chosen_game(game, scenario, seats, drivers or {}, planners or {}, duration)
    setups = EpisodeSetups(chosen, read(StartVariation, dict(vary or {}), 'vary'), worlds)
    return Experiment(
        setups, tuple(seats), action,
        read(ObservationSpec, dict(observation or {}), 'observation'),
        Reward(USUAL_REWARD if reward is None else reward), tuple(ends), ticks,
        DEFAULT_DURATION_S if math.isinf(chosen.duration) else chosen.duration)


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
    :ivar game: the game, which moves all vehicles and objects.
    """

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        self.game = DrivingGame(experiment.setups, experiment.seats, experiment.action,
                                experiment.ticks)
        self._observations = [
            Observation(experiment.observation, seat.vehicle.vehicle, seat.view.things)
            for seat in self.game.seats]
        self._goals = {seat.id: GoalWatch(
            seat.vehicle.planning_problem if isinstance(seat.vehicle, AvSetup) else None,
            seat.vehicle.vehicle.rear_to_center) for seat in self.game.seats}
        self._criticality: Criticality | None = None

    @property
    def seats(self) -> list[AgentSeat]:
        """Return the agents' seats."""
        return self.game.seats

    def begin(self, seed: int) -> None:
        """Begin an episode."""
        if self.experiment.reward.is_measured:
            self._criticality = Criticality(observed_run(self.game.setup))
        self.game.begin(seed, [] if self._criticality is None else [self._criticality])

    def act(self, actions: Mapping[str, Any]) -> None:
        """Advance to the next decision (`DrivingGame.act`)."""
        self.game.act(actions)

    def observed(self, number: int) -> Observed:
        """Return an agent's observation, by part."""
        seen = observe_together(self._observations[number], [self.seats[number]])
        return {part: values[0] for part, values in seen.items()}

    def outcomes(self) -> list[AgentOutcome]:
        """Return the outcome of the last decision for each agent."""
        return [self._outcome(seat, off) for seat, off in zip(
            self.seats, self.game.off_road(), strict=True)]

    def info(self) -> dict[str, object]:
        """Return information on the start of the episode."""
        return {'time_s': self.game.time_s, 'seed': self.game.setup.game.seed}

    def _outcome(self, seat: AgentSeat, off_road: bool) -> AgentOutcome:
        game, experiment = self.game, self.experiment
        scheduler = game.simulation.scheduler
        measures = None if self._criticality is None else next(
            tick for tick in self._criticality.latest if tick.subject == seat.row)
        goal = self._goals[seat.id].is_met(
            seat.state, scheduler.k(game.simulation.n))
        collision = bool(seat.hit)
        reward, terms = experiment.reward.compute(Decision(
            experiment.ticks * scheduler.time_step_s, seat.before[0], seat.state, seat.place,
            collision, off_road, goal, measures))
        happened = {'collision': collision, 'off_road': off_road, 'goal': goal}
        terminated = any(happened[end] for end in experiment.ends)
        time_s = game.time_s
        info = {'time_s': time_s, **happened, 'hit': ','.join(seat.hit), 'terms': terms}
        if seat.refusal is not None:
            info['refusal'] = seat.refusal
        return AgentOutcome(reward, terminated, time_s >= experiment.duration_s - 1e-9, info)


def observe_together(observation: Observation, seats: Sequence[AgentSeat]) -> Observed:
    """Return the observations of the agents of several games, (B, …) by part."""
    poses: NDArray[np.float64] = np.stack([seat.around.poses for seat in seats])
    velocities = np.stack([seat.around.velocities for seat in seats])
    return observation.observe([seat.state for seat in seats], [seat.place for seat in seats],
                               [seat.guide for seat in seats], poses, velocities)
