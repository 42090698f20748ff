# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Builds the game of a trial: its game file, overridden by the trial's settings."""

from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeVar

from crgame_ros.driver.source import COCKPIT
from crgame_ros.errors import InputError
from crgame_ros.game.game import Game, HumanSpec, load_game
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.schema.reading import read
from crgame_ros.simulation.av_assignment import adapt_game, OWN
from crgame_ros.study.trial_settings import tasks_over, TrialSettings
from crgame_ros.yaml_text import read_yaml

PERFECT, NONE = 'perfect', 'none'
T = TypeVar('T')


def seats_of(settings: TrialSettings, game: Game) -> tuple[str, ...]:
    """
    Return the participants' vehicles: each a human's, or an AV that may be taken over.

    :param game: whose AVs are listed.
    :raises InputError: if the game has no human, or no vehicle of that name.
    """
    humans = [human.id for human in game.humans]
    ids = [*humans, *(av.id for av in game.avs or ())]
    if settings.seats is None and settings.seat is None and not humans:
        raise InputError('has no human', settings.game or 'trial', 'give the game one: humans: '
                         '[{id: hv0, driver: cockpit}], or name an AV as "seat"')
    seats = settings.seats or (settings.seat or humans[0],)
    for seat in seats:
        if seat not in ids:
            raise InputError(f'has no human or AV "{seat}"', settings.game or 'trial',
                             f'name {" or ".join(ids)} as a seat')
    if settings.confederate in seats:
        raise InputError(f'gives {settings.confederate} to a participant and the experimenter',
                         settings.game or 'trial', 'name another human as "confederate"')
    if settings.confederate is not None and settings.confederate not in humans:
        raise InputError(f'has no human "{settings.confederate}"', settings.game or 'trial',
                         f'name {" or ".join(humans) or "none"} as "confederate"')
    return seats


def trial_game(settings: TrialSettings, driver: str) -> Game:
    """
    Build the game of a trial.

    :param settings: of the trial, combined with all outer settings.
    :param driver: of the seats of participants and of the experimenter.
    :raises InputError: if a file cannot be used, or the settings do not fit the game.
    """
    game = _written_game(settings)
    game = replace(
        game, events=(*game.events, *settings.events),
        tasks=tasks_over(game.tasks, settings.tasks),
        sound='on' if settings.sound else 'none',
        instruments=settings.instruments or game.instruments)
    if settings.duration is not None:
        game = replace(game, duration=settings.duration)
    seed = settings.seed if isinstance(settings.seed, int) else 0
    return _seated(settings, driver, adapt_game(
        game, load_scenario(game.scenario), seed=seed,
        planner=settings.planner or OWN, options=settings.options,
        perception=_spec(PerceptionSpec, settings.perception, PERFECT, 'perception'),
        traffic=_spec(TrafficSpec, settings.traffic, NONE, 'traffic')))


def _seated(settings: TrialSettings, driver: str, game: Game) -> Game:
    """Return the game with driver, tasks and gaze in the participants' vehicles, alone."""
    seats = seats_of(settings, game)
    driven = {*seats, settings.confederate}
    for human in game.humans:
        if human.id not in driven and human.driver == COCKPIT:
            raise InputError(f'{human.id} waits for another person', settings.game or 'trial',
                             'give it another driver, such as idle, name it in "seats" or as '
                             '"confederate", or take it out of the game')
    gazes = game.instruments.gaze if game.instruments is not None else ()
    for what, seat in (*((f'task {task.name}', task.seat) for task in game.tasks),
                       *((f'gaze {gaze.stream}', gaze.seat) for gaze in gazes)):
        if seat is None and len(seats) > 1:
            raise InputError(f'{what} does not say whose it is', settings.game or 'trial',
                             f'give it "seat": {" or ".join(seats)}')
        if seat is not None and seat not in seats:
            raise InputError(f'{what} is for {seat}, and nobody who takes part sits there',
                             settings.game or 'trial', f'name {" or ".join(seats)} as its "seat"')
    return replace(
        game, instruments=game.instruments and game.instruments.seated(seats),
        tasks=tuple(replace(task, seat=task.seat or seats[0]) for task in game.tasks),
        humans=tuple(replace(human, driver=driver) if human.id in driven else human
                     for human in game.humans))


def _written_game(settings: TrialSettings) -> Game:
    """Return the game from the files: a game, a scenario, or a game on a scenario's roads."""
    scenario = settings.scenario
    if settings.game is not None:
        game = load_game(Path(settings.game))
        return game if scenario is None else replace(game, scenario=scenario)
    if scenario is None:
        raise InputError('names no game', 'trial', 'give "game" or "scenario" to the study, a '
                         'block or a level')
    # Without a human all vehicles are AVs, and the participant sits in one of them.
    humans = (HumanSpec('hv0'),) if settings.seat in (None, 'hv0') \
        or 'hv0' in (settings.seats or ()) else ()
    return Game(scenario, humans=humans)


def _spec(kind: type[T], name: str | None, nothing: str, what: str) -> T | Literal['own'] | None:
    if name in (None, OWN):
        return OWN
    if name == nothing:
        return None
    file = Path(str(name))
    return read(kind, read_yaml(file, what), str(file), file.parent)
