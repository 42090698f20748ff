# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the inputs of recorded humans, to replay them in both runners."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from crgame_ros.driver.source import parse_source, ReplayDriver, SourceSpec
from crgame_ros.errors import InputError
from crgame_ros.game.documents import GameDocument
from crgame_ros.game.events import AtStep, FiredEvent
from crgame_ros.game.game import Game
from crgame_ros.recording.recorded_events import read_run_events
from crgame_ros.recording.recorded_game import read_game_document
from crgame_ros.recording.run_cycles import replay_inputs
from crgame_ros.recording.run_folder import recording_in
from crgame_ros.simulation.game_description import describe_game
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.simulation.setup import Setup
import numpy as np
from numpy.typing import NDArray


class RecordedInputs(NamedTuple):
    """
    The inputs of recorded humans, by the cycle in which the recorded run consumed them.

    :param drivers: by human, and by AV that a driver took over.
    :param intervals_s: (n) Delta t_eff that reproduce the recorded states bit for bit [s]; None
        without a recording.
    """

    drivers: dict[str, ReplayDriver]
    intervals_s: NDArray[np.float64] | None


def recorded_inputs(setup: Setup) -> RecordedInputs:
    """
    Find the inputs of every human whose driver is `replay:BAG`.

    :raises InputError: if a recording cannot be used, is of another scenario or rate, or if two of
        them differ in their intervals.
    """
    drivers: dict[str, ReplayDriver] = {}
    intervals: NDArray[np.float64] | None = None
    for human in setup.humans:
        source = parse_source(human.driver)
        if source.kind != 'replay':
            continue
        bag = _bag(setup, source)
        _check_same(setup, read_game_document(bag), bag)
        commands, measured = replay_inputs(bag)
        if human.id not in commands:
            raise InputError(f'{human.id} took no part', source.argument,
                             'it has ' + ', '.join(commands))
        if intervals is not None and not np.array_equal(intervals, measured):
            raise InputError('was recorded with other intervals than the other replay',
                             source.argument, 'replay humans of one recording together')
        drivers[human.id], intervals = ReplayDriver(commands[human.id]), measured
        drivers.update({av.id: ReplayDriver(commands[av.id])
                        for av in setup.avs if av.id in commands})
    return RecordedInputs(drivers, intervals)


def inputs_of(result: OfflineResult) -> RecordedInputs:
    """Return the inputs of an offline run's humans, and of drivers who took over its AVs."""
    # No step consumed row 0.
    drivers = {human.id: ReplayDriver(result.commands[1:, place])
               for place, human in enumerate(result.setup.humans)}
    drivers.update({av.id: ReplayDriver(result.av_commands[1:, place])
                    for place, av in enumerate(result.setup.avs)
                    if np.isfinite(result.av_commands[1:, place, 0]).any()})
    return RecordedInputs(drivers, result.intervals_s[1:, 0])


def _check_same(setup: Setup, recorded: GameDocument, bag: Path) -> None:
    """Refuse a recording of another scenario or rate than this run's."""
    if recorded.scenario_sha256 != setup.loaded.sha256:
        raise InputError(
            f'was recorded in another scenario ({recorded.benchmark_id}) than '
            f'{setup.loaded.source}',
            str(bag), 'leave the game out: the recording carries its own')
    here, there = setup.scheduler, recorded.scheduler
    if (here.time_step_ns, here.steps_per_tick) != (there.time_step_ns, there.steps_per_tick):
        raise InputError(f'was recorded at {1.0 / there.dt_s:g} Hz, not {1.0 / here.dt_s:g} Hz',
                         str(bag), f'give --rate {1.0 / there.dt_s:g}')


def replay_notices(setup: Setup) -> tuple[str, ...]:
    """
    Return a line for each recorded human who will not drive the recorded path, with the reason.

    :raises InputError: if a recording cannot be used, or is of another scenario or rate.
    """
    notices = []
    for human in setup.humans:
        source = parse_source(human.driver)
        if source.kind != 'replay':
            continue
        bag = _bag(setup, source)
        recorded = read_game_document(bag)
        _check_same(setup, recorded, bag)
        present = describe_game(setup)
        here, there = (document.human(human.id) for document in (present, recorded))
        other = [name for key, name in (('state', 'start'), ('vehicle', 'vehicle'),
                                        ('dynamics', 'vehicle model'))
                 if getattr(here, key, None) != getattr(there, key, None)]
        if other:
            notices.append(f'{human.id} has another {" and ".join(other)} than in {bag}: '
                           'its commands are repeated, its way is not')
    return tuple(notices)


def with_recorded_events(game: Game, fired: Sequence[FiredEvent],
                         known: Collection[str] | None = None) -> Game:
    """
    Return a game whose events take effect when they did in a recorded run, and only then.

    :param game: the game to play.
    :param fired: the events that took effect in the recorded run.
    :param known: names of the recorded game's events, others are unchanged; None for all of the
        game to play.
    """
    steps = {event.name: event.k for event in fired}
    return replace(game, events=tuple(
        event if known is not None and event.name not in known
        else replace(event, when=AtStep(steps[event.name]) if event.name in steps else None)
        for event in game.events))


def with_replayed_events(setup: Setup) -> Setup:
    """
    Return the setup with the recorded events, if a human's driver is `replay:BAG`.

    :raises InputError: if the recording cannot be used.
    """
    for human in setup.humans if setup.game.events else ():
        source = parse_source(human.driver)
        if source.kind == 'replay':
            known, fired = read_run_events(_bag(setup, source))
            return replace(setup, game=with_recorded_events(setup.game, fired, known))
    return setup


def _bag(setup: Setup, source: SourceSpec) -> Path:
    """Return the recording that a source names, relative to the game file."""
    return recording_in(setup.game.base / Path(source.argument).expanduser())
