# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The game that an environment's keywords name."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.game import Game, HumanSpec
from crgame_ros.game.game_file import load_game
from crgame_ros.paths import scenarios_directory


def chosen_game(game: Game | Path | str | None, scenario: Path | str | None,
                seats: Sequence[str], drivers: Mapping[str, str], planners: Mapping[str, str],
                duration: float | None) -> Game:
    """
    Find the game.

    :param game: a game, its file, or the name of a shipped one, such as `cut_in`.
    :param scenario: a CommonRoad file instead: each planning problem is an AV, and the only humans
        are agents.
    :param seats: that agents take.
    :param drivers: other driver sources than the game's, by human.
    :param planners: other planners, by AV.
    :param duration: until an episode is truncated, instead of the game's [s]
    :raises InputError: if there is none, or both are named.
    """
    if (game is None) == (scenario is None):
        raise InputError('name a game or a scenario, one of them', 'environment',
                         "such as game='cut_in'")
    if scenario is not None:
        chosen = Game(Path(scenario).expanduser(), humans=tuple(
            HumanSpec(seat, 'idle') for seat in seats if seat.startswith('hv')))
    elif isinstance(game, Game):
        chosen = game
    else:
        assert game is not None
        chosen = load_game(_file(game))
    chosen = replace(chosen, humans=tuple(
        replace(human, driver=drivers.get(human.id, human.driver)) for human in chosen.humans))
    if planners:
        if chosen.avs is None:
            raise InputError('the game does not list its AVs', 'planners',
                             'list them in a game file')
        chosen = replace(chosen, avs=tuple(
            replace(av, planner=planners[av.id], options={}) if av.id in planners else av
            for av in chosen.avs))
    known = {human.id for human in chosen.humans} | {av.id for av in chosen.avs or ()}
    for name in (*drivers, *planners):
        if name not in known:
            raise InputError(f'there is no "{name}" in the game', 'drivers or planners',
                             'use ' + ', '.join(sorted(known)))
    if duration is not None:
        if not 0.0 < duration < float('inf'):
            raise InputError(f'"duration" is {duration}', 'environment',
                             'give a positive number of seconds')
        chosen = replace(chosen, duration=float(duration))
    return chosen


def _file(game: Path | str) -> Path:
    """Return the file of a game: a shipped one by its name alone."""
    shipped = scenarios_directory() / f'{game}.yaml'
    if isinstance(game, str) and '/' not in game and shipped.is_file():
        return shipped
    return Path(game).expanduser()
