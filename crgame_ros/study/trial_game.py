# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Builds the game of a trial: its game file, overridden by the trial's settings."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from crgame_ros.driver.source import COCKPIT
from crgame_ros.errors import InputError
from crgame_ros.game.file import load_game
from crgame_ros.game.game import Game, HumanSpec
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.schema.reading import read
from crgame_ros.simulation.av_assignment import adapt_game, OWN
from crgame_ros.study.trial_settings import tasks_over, TrialSettings
from crgame_ros.yaml_text import read_yaml

PERFECT, NONE = 'perfect', 'none'


def seat_of(settings: TrialSettings, game: Game) -> str:
    """
    Return the participant's vehicle: a human's, or an AV that may be taken over.

    :param game: whose AVs are listed.
    :raises InputError: if the game has no human, or no vehicle of that name.
    """
    humans = [human.id for human in game.humans]
    ids = [*humans, *(av.id for av in game.avs or ())]
    if settings.seat is None and not humans:
        raise InputError('has no human', settings.game or 'trial', 'give the game one: humans: '
                         '[{id: hv0, driver: cockpit}], or name an AV as "seat"')
    seat = humans[0] if settings.seat is None else settings.seat
    if seat not in ids:
        raise InputError(f'has no human or AV "{seat}"', settings.game or 'trial',
                         f'name {" or ".join(ids)} as "seat"')
    return seat


def trial_game(settings: TrialSettings, driver: str) -> Game:
    """
    Build the game of a trial.

    :param settings: of the trial, combined with all outer settings.
    :param driver: of the participant's seat.
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
    """Return the game with driver, tasks and gaze in the participant's vehicle, alone."""
    seat = seat_of(settings, game)
    for human in game.humans:
        if human.id != seat and human.driver == COCKPIT:
            raise InputError(f'{human.id} waits for a second person', settings.game or 'trial',
                             'give it another driver, such as idle, or take it out of the game')
    for task in game.tasks:
        if task.seat not in (None, seat):
            raise InputError(f'task {task.name} is for {task.seat}, and the participant sits in '
                             f'{seat}', settings.game or 'trial', 'leave out its "seat"')
    for gaze in game.instruments.gaze if game.instruments is not None else ():
        if gaze.seat not in (None, seat):
            raise InputError(f'gaze {gaze.stream} is of {gaze.seat}, and the participant sits in '
                             f'{seat}', settings.game or 'trial', 'leave out its "seat"')
    return replace(
        game, instruments=game.instruments and game.instruments.seated([seat]),
        tasks=tuple(replace(task, seat=seat) for task in game.tasks),
        humans=tuple(replace(human, driver=driver) if human.id == seat else human
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
    humans = (HumanSpec('hv0'),) if settings.seat in (None, 'hv0') else ()
    return Game(scenario, humans=humans)


def _spec(kind: type[object], name: str | None, nothing: str, what: str) -> Any:
    if name in (None, OWN):
        return OWN
    if name == nothing:
        return None
    file = Path(str(name))
    return read(kind, read_yaml(file, what), str(file), file.parent)
