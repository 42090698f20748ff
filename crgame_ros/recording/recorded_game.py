# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What repeats a recorded run: its game, its events, and the inputs of its humans."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from crgame_ros.driver.source import parse_source, ReplayDriver
from crgame_ros.errors import InputError
from crgame_ros.game.documents import DrivenHuman, EVENTS, GAME, GameDocument
from crgame_ros.game.events import AtStep, FiredEvent, PlannerSwap
from crgame_ros.game.game import Game, parse_game, PoseSpawn
from crgame_ros.paths import expanded
from crgame_ros.recording.epochs import Epoch, read_epoch, XML_TOPIC
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_cycles import replay_inputs
from crgame_ros.recording.run_folder import recording_in
from crgame_ros.scenario.loading import LoadedScenario, parse_scenario
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import Setup
from crgame_ros.yaml_text import parse_yaml
import numpy as np
from numpy.typing import NDArray


class RecordedGame(NamedTuple):
    """
    A game from a recording.

    :param game: the game, with every human driven by the recording from the recorded start; its
        scenario path is the recording itself, which is not an XML file.
    :param loaded: the recorded scenario.
    """

    game: Game
    loaded: LoadedScenario


def read_game_document(bag: Path) -> GameDocument:
    """
    Read the game document of a recording.

    :raises InputError: if a document of the run is missing.
    """
    with BagReader(bag, parts=True) as reader:
        return read_epoch(reader).game


def read_recorded_game(bag: Path, *, other_planners: bool = False) -> RecordedGame:
    """
    Read the game of the last run in a recording.

    :param other_planners: whether the user names the planners, so that the recorded ones are not
        needed.
    :raises InputError: if it is not in the recording, or names code outside this package: only the
        user may choose code to execute, not a file of unknown origin.
    """
    with BagReader(bag, parts=True) as reader:
        run = read_epoch(reader)
    where = f'{bag}, {GAME.topic}'
    text = run.game.file
    if not text:
        raise InputError('does not hold the game file', where,
                         'name the game that was recorded before --driver')
    game = parse_game(parse_yaml(text, f'{where}, its game file', 'record again'), where,
                      bag.parent)
    starts = {human.id: PoseSpawn(*human.state[:4]) for human in run.game.humans}
    humans = tuple(replace(human, driver=f'replay:{bag.resolve()}', spawn=starts[human.id])
                   for human in game.humans if human.id in starts)
    code = _named_code(game, other_planners)
    if code:
        raise InputError(f'names code outside this package ({code[0]})', where,
                         'name the planners with --planner, or the game file of that run')
    return RecordedGame(replace(game, scenario=bag, humans=humans),
                        parse_scenario(run.xml_text, f'{bag}, {XML_TOPIC}'))


def _named_code(game: Game, other_planners: bool) -> list[str]:
    """Return the models of the form `module:Class` or `file.py:Class`."""
    avs = game.avs or ()
    names = [model.name for av in avs for model in (av.tracker.model, av.dynamics)]
    names += [human.dynamics.name for human in game.humans if human.dynamics is not None]
    names += [sensor.model for av in avs if av.perception is not None
              for sensor in av.perception.sensors]
    names += [event.action.planner for event in game.events
              if isinstance(event.action, PlannerSwap)]
    names += [game.traffic.model] if game.traffic is not None else []
    names += [] if other_planners else [av.planner for av in avs]
    return [name for name in names if ':' in name]


class RecordedInputs(NamedTuple):
    """
    The inputs of recorded humans, by the cycle in which the recorded run consumed them.

    :param drivers: by human, and by AV that a driver took over.
    :param intervals_s: (n) Delta t_eff that reproduce the recorded states bit for bit [s]; None
        without a recording.
    """

    drivers: dict[str, ReplayDriver]
    intervals_s: NDArray[np.float64] | None


def _replayed(setup: Setup) -> Iterator[tuple[DrivenHuman, str, Path]]:
    """Yield each human whose driver is a recording, with its name and its path."""
    for human in setup.humans:
        source = parse_source(human.driver)
        if source.kind == 'replay':
            # It is named relative to the game file.
            yield human, source.argument, recording_in(
                setup.game.base / expanded(source.argument))


def recorded_inputs(setup: Setup) -> RecordedInputs:
    """
    Find the inputs of every human whose driver is `replay:BAG`.

    :raises InputError: if a recording cannot be used, is of another scenario or rate, or if two of
        them differ in their intervals.
    """
    drivers: dict[str, ReplayDriver] = {}
    intervals: NDArray[np.float64] | None = None
    for human, name, bag in _replayed(setup):
        recorded = _recorded_in(bag, setup)
        commands, measured = replay_inputs(bag, recorded.epoch)
        if human.id not in commands:
            raise InputError(f'{human.id} took no part', name, 'it has ' + ', '.join(commands))
        if intervals is not None and not np.array_equal(intervals, measured):
            raise InputError('was recorded with other intervals than the other replay',
                             name, 'replay humans of one recording together')
        drivers[human.id], intervals = ReplayDriver(commands[human.id]), measured
        drivers.update({av.id: ReplayDriver(commands[av.id])
                        for av in setup.avs if av.id in commands})
    return RecordedInputs(drivers, intervals)


def inputs_of(result: OfflineResult) -> RecordedInputs:
    """Return the inputs of an offline run's humans, and of drivers who took over its AVs."""
    # No step consumed row 0.
    commands = dict(zip(result.setup.vehicle_ids, result.commands[1:].swapaxes(0, 1), strict=True))
    return RecordedInputs({name: ReplayDriver(given) for name, given in commands.items()
                           if np.isfinite(given[:, 0]).any()}, result.intervals_s[1:, 0])


def _recorded_in(bag: Path, setup: Setup) -> GameDocument:
    """Return the game in a recording; refuse one of another scenario or rate than this run's."""
    recorded = read_game_document(bag)
    if recorded.scenario_sha256 != setup.loaded.sha256:
        raise InputError(
            f'was recorded in another scenario ({recorded.benchmark_id}) than '
            f'{setup.loaded.source}',
            str(bag), 'leave the game out and give --driver replay:BAG: it carries its own')
    here, there = setup.scheduler, recorded.scheduler
    if (here.time_step_ns, here.steps_per_tick) != (there.time_step_ns, there.steps_per_tick):
        raise InputError(f'was recorded at {1.0 / there.dt_s:g} Hz, not {1.0 / here.dt_s:g} Hz',
                         str(bag), f'give --rate {1.0 / there.dt_s:g}')
    return recorded


def replay_notices(setup: Setup) -> tuple[str, ...]:
    """
    Return a line for each recorded human who will not drive the recorded path, with the reason.

    :raises InputError: if a recording cannot be used, or is of another scenario or rate.
    """
    notices = []
    for human, _, bag in _replayed(setup):
        recorded = _recorded_in(bag, setup)
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
    for _, _, bag in _replayed(setup) if setup.game.events else ():
        known, fired = read_run_events(bag)
        return replace(setup, game=with_recorded_events(setup.game, fired, known))
    return setup


class RecordedEvents(NamedTuple):
    """
    The events of a recorded run.

    :param known: names of the events of the recorded game.
    :param fired: the events that took effect, in order.
    """

    known: frozenset[str]
    fired: tuple[FiredEvent, ...]


def run_events(reader: BagReader, run: Epoch) -> RecordedEvents:
    """
    Return the events of a run in a recording.

    :raises InputError: if the recording cannot be read.
    """
    fired: tuple[FiredEvent, ...] = ()
    for log_ns, document in reader.documents(EVENTS):
        # Each message holds all events since the start of its run.
        if document.epoch == run.game.epoch and (run.from_log_ns is None
                                                 or log_ns >= run.from_log_ns):
            fired = document.fired
    return RecordedEvents(frozenset(event.name for event in run.game.events), fired)


def read_run_events(path: Path, epoch: int | None = None) -> RecordedEvents:
    """
    Read the events of a run from its recording.

    :param epoch: which run, where a recording holds several; None for the last.
    :raises InputError: if there is no such run in it.
    """
    with BagReader(path, parts=True) as reader:
        return run_events(reader, read_epoch(reader, epoch))
