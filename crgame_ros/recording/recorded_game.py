# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the game in a recording, to run it again without any other file."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.documents import GAME, GameDocument
from crgame_ros.game.events import PlannerSwap
from crgame_ros.game.file import parse_game
from crgame_ros.game.game import Game, PoseSpawn
from crgame_ros.recording.epochs import read_epoch, XML_TOPIC
from crgame_ros.recording.reader import BagReader
from crgame_ros.scenario.loading import LoadedScenario, parse_scenario
from crgame_ros.yaml_text import parse_yaml


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
    with BagReader(bag) as reader:
        return read_epoch(reader).game


def read_recorded_game(bag: Path, *, other_planners: bool = False) -> RecordedGame:
    """
    Read the game of the last run in a recording.

    :param other_planners: whether the user names the planners, so that the recorded ones are not
        needed.
    :raises InputError: if it is not in the recording, or names code outside this package: only the
        user may choose code to execute, not a file of unknown origin.
    """
    with BagReader(bag) as reader:
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
