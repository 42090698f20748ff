# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded people as demonstrations: a data set in the format of Minari."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from crgame_ros.driver.source import ReplayDriver
from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectStates
from crgame_ros.gym.agent_game import AgentGame, make_experiment
from crgame_ros.gym.agent_spaces import action_space, observation_space
from crgame_ros.gym.driving_game import DrivingGame
from crgame_ros.gym.episode_setups import EpisodeSetups, StartVariation
from crgame_ros.paths import extra_install
from crgame_ros.policy.observation import Observed
from crgame_ros.policy.observation_spec import ObservationSpec
from crgame_ros.recording.recorded_game import read_recorded_game
from crgame_ros.recording.run_cycles import replay_inputs
from crgame_ros.recording.run_folder import recording_in, run_name
from crgame_ros.recording.run_points import recorded_states
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.schema.reading import read
from crgame_ros.simulation.engine import StepResult
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Largest difference of the person's replayed states to those recorded, in any column.
TOLERANCE = 1e-6
# AVs are where they were recorded: what would plan for them has no effect.
_UNHEEDED = 'constant-velocity'


@dataclass(frozen=True)
class Recorded:
    """
    A recorded run, from the view of one person.

    :param seat: id of the person's vehicle.
    :param states: (N, V, 8) published states of all driven vehicles at the steps n = 0, 1, …
    :param objects: states of all other objects at the scenario steps.
    :param driver: commands of the person.
    :param intervals_s: (N - 1) interval of each step [s]
    :param where: the recording, for messages.
    """

    seat: str
    states: Array
    objects: Sequence[ObjectStates]
    driver: ReplayDriver
    intervals_s: Array
    where: str


@dataclass(frozen=True)
class Demonstration:
    """
    An episode of a person who drove.

    :param seed: of the run's game.
    :param observations: (T + 1) by part.
    :param actions: (T, 2) `pedals`: means over the steps of each decision.
    :param rewards: (T)
    :param terminated: whether it ends by an event, and not with the recording or by time.
    :param times_s: (T + 1) simulated time of each observation [s]
    :param deviation: largest difference of the replayed states to those recorded.
    """

    run: str
    seed: int
    observations: tuple[Observed, ...]
    actions: NDArray[np.float32]
    rewards: Array
    terminated: bool
    times_s: Array
    deviation: float


class PlayedGame(DrivingGame):
    """
    A game in which one person's vehicle is replayed, and all others are where they were recorded.

    The person's recorded commands drive the vehicle in the engine; its states are compared to
    those recorded at every step.
    """

    recorded: Recorded
    deviation = 0.0

    @property
    def objects(self) -> ObjectStates:
        """Return the recorded states of everything that is not a driven vehicle."""
        ticks = self.simulation.n // self.simulation.scheduler.steps_per_tick
        return self.recorded.objects[ticks]

    def command(self, n: int) -> DriverCommand:
        """Return the person's command of the step from n to n + 1."""
        return self.recorded.driver.command(n, self.simulation.scheduler.dt_s)

    def _step(self) -> tuple[StepResult, Sequence[VehicleState]]:
        recorded, simulation, n = self.recorded, self.simulation, self.simulation.n
        row = self.seats[0].row
        commands: list[DriverCommand | None] = [None] * recorded.states.shape[1]
        for other, hand in self._hands.items():
            commands[other] = hand.command(n, simulation.scheduler.dt_s)
        commands[row] = self.command(n)
        result = simulation.step(float(recorded.intervals_s[n]), commands)
        there = recorded.states[n + 1]
        self.deviation = max(self.deviation, float(np.abs(
            np.array(simulation.states[row]) - there[row]).max()))
        if not self.deviation <= TOLERANCE:
            raise InputError(
                f'the replayed states differ from those recorded by {self.deviation:.2g} at step '
                f'{n + 1}', f'{recorded.where}, {recorded.seat}',
                'record the run with this version, and without events that move the vehicle')
        return result, [VehicleState(*state) for state in there.tolist()]


def demonstration(run: Path, seat: str = 'hv0', **keywords: object) -> Demonstration:
    """
    Return the drive of a recorded person as an episode of an environment.

    The person's vehicle is replayed by the engine, from the recorded commands and intervals; its
    states equal those recorded within `TOLERANCE`, or the run is refused. All others are where
    they were recorded. Observations, rewards and ends are those of the environment's own code.

    :param run: folder of the run, or its recording.
    :param seat: the person's vehicle.
    :param keywords: observation, reward, ends, ticks and duration, as for `make_experiment`.
    :raises InputError: if the recording cannot be used, or the person drove in reverse, which
        actions do not have.
    """
    bag = recording_in(run)
    game, loaded = read_recorded_game(bag, other_planners=True)
    game = replace(game, humans=tuple(replace(human, driver='idle') for human in game.humans),
                   avs=None if game.avs is None else tuple(
                       replace(av, planner=_UNHEEDED, options={}, perception=None)
                       for av in game.avs))
    experiment = make_experiment((seat,), game, action='pedals',
                                 **keywords)  # type: ignore[arg-type]
    setups = EpisodeSetups(experiment.setups.scenes.load(''), StartVariation(), None, loaded)
    agent = AgentGame(experiment, setups, run_name(run), PlayedGame)
    played = agent.game
    assert isinstance(played, PlayedGame)
    played.recorded = recorded = _recorded(bag, seat, setups)
    agent.begin(setups.base)
    steps = setups.base.scheduler.steps_per_tick * experiment.ticks
    last = min(len(recorded.intervals_s), len(recorded.states) - 1,
               (len(recorded.objects) - 1) * setups.base.scheduler.steps_per_tick)
    seen, times_s = [agent.observed(0)], [0.0]
    actions, rewards = [], []
    terminated = truncated = False
    for n in range(0, last - steps + 1, steps):
        action = _action([played.command(step) for step in range(n, n + steps)], recorded)
        agent.act({seat: action})
        outcome = agent.outcomes()[0]
        actions.append(action)
        rewards.append(outcome.reward)
        seen.append(agent.observed(0))
        times_s.append(played.time_s)
        terminated, truncated = outcome.terminated, outcome.truncated
        if terminated or truncated:
            break
    if not actions:
        raise InputError('is shorter than a decision', str(bag), 'take longer runs')
    return Demonstration(run_name(run), game.seed, tuple(seen), np.array(actions, np.float32),
                         np.array(rewards), terminated, np.array(times_s), played.deviation)


def _recorded(bag: Path, seat: str, setups: EpisodeSetups) -> Recorded:
    inputs, states, log = replay_inputs(bag), recorded_states(bag), read_trajectories(bag)
    if seat not in inputs.commands:
        raise InputError(f'{seat} took no part', str(bag), 'it has ' + ', '.join(inputs.commands))
    columns = {item.id: column for column, item in enumerate(log.objects)}
    wanted = [columns.get(item.id, -1) for item in setups.base.obstacles.descriptions]
    # An object that was never recorded is absent.
    absent = np.full((len(log.ks), 1, 3), np.nan)
    poses, velocities = (np.concatenate((values, absent), axis=1)[:, wanted]
                         for values in (log.object_poses, log.object_velocities))
    return Recorded(seat, np.stack([states[name] for name in setups.base.vehicle_ids], axis=1),
                    tuple(map(ObjectStates, poses, velocities)), ReplayDriver(
                        inputs.commands[seat]), inputs.dt_eff_s, str(bag))


def _action(commands: Sequence[DriverCommand], recorded: Recorded) -> NDArray[np.float32]:
    """Return the action `pedals` that stands for the commands of a decision: their mean."""
    if any(command.reverse for command in commands):
        raise InputError('drove in reverse, which actions do not have',
                         f'{recorded.where}, {recorded.seat}', 'leave this run out')
    mean = np.mean([(command.throttle - command.brake, command.steering)
                    for command in commands], axis=0)
    return np.clip(mean, -1.0, 1.0).astype(np.float32)


def write_demonstrations(dataset_id: str, runs: Sequence[Path], seat: str = 'hv0',
                         author: str | None = None,
                         observation: Mapping[str, object] | None = None,
                         **keywords: object) -> list[Demonstration]:
    """
    Write the drives of recorded people as a data set of Minari, among the user's own ones.

    Each run is an episode; its name is in the episode's infos, as are the times [s]. Nothing is
    written if a run cannot be used.

    :param dataset_id: such as `cut_in/people-v0`.
    :param runs: folders of runs, or recordings.
    :param seat: the people's vehicle.
    :param observation: parts of the observation.
    :param keywords: as for `demonstration`.
    :return: the episodes.
    :raises InputError: if a run cannot be used, the data set exists, or Minari is missing.
    """
    try:
        # An extra of its own; all other parts of environments work without it.
        import minari
        from minari.data_collector import EpisodeBuffer
        from minari.dataset.minari_dataset import parse_dataset_id
    except ImportError as error:
        raise InputError('needs the package minari, which is not installed', 'demonstrations',
                         extra_install('minari')) from error
    if not runs:
        raise InputError('there are no runs', dataset_id, 'name one at least')
    try:
        parse_dataset_id(dataset_id)
    except ValueError as error:
        raise InputError('is no name of a data set', dataset_id,
                         'write it like cut_in/people-v0') from error
    if dataset_id in minari.list_local_datasets():
        raise InputError('this data set exists', dataset_id, 'choose another name or version')
    episodes = [demonstration(run, seat, observation=observation, **keywords) for run in runs]
    spec = read(ObservationSpec, observation or {}, 'observation')
    buffers = [EpisodeBuffer(
        id=number, seed=item.seed, options=None, observations=_by_part(item.observations),
        actions=list(item.actions), rewards=item.rewards.tolist(),
        terminations=[*[False] * (len(item.rewards) - 1), item.terminated],
        truncations=[*[False] * (len(item.rewards) - 1), not item.terminated],
        infos={'run': [item.run] * len(item.times_s), 'time_s': item.times_s.tolist()})
        for number, item in enumerate(episodes)]
    minari.create_dataset_from_buffers(
        dataset_id, buffers, data_format='arrow', jpeg_encoding=False, author=author,
        observation_space=observation_space(spec, 'pedals'),
        action_space=action_space('pedals'), algorithm_name='recorded people',
        description='Recorded people in crgame_ros; actions are the means of their commands.')
    return episodes


def _by_part(seen: Sequence[Observed]) -> Mapping[str, list[NDArray[np.generic]]]:
    return {part: [each[part] for each in seen] for part in seen[0]}
