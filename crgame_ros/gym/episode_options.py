# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The options of one episode: `reset(options=…)`."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

from crgame_ros.errors import InputError
from crgame_ros.game.game import Game
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Within
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write
from crgame_ros.variation.space import game_of, VariantSpace
import numpy as np

# Points that are drawn until one keeps the constraints of the game's variants.
_DRAWN = 1000
Difficulty = Annotated[float, Within(0.0, 1.0)]


@dataclass(frozen=True)
class Start:
    """
    A stated start of the agents' vehicles, relative to that of the game.

    :param speed: added to the speed [m/s]; no vehicle starts backwards
    :param along: shift along the route [m]
    """

    speed: Annotated[float, Within(-50.0, 50.0)] = 0.0
    along: Annotated[float, Within(-100.0, 100.0)] = 0.0


@dataclass(frozen=True)
class EpisodeOptions:
    """
    The options of one episode.

    :param scene: scene by its name; None leaves it to the seed.
    :param start: start of the agents' vehicles; None leaves it to the seed.
    :param difficulty: how much of what may vary does, and share of the game's traffic; None takes
        the environment's.
    """

    FORM: ClassVar[Form] = Form('see docs/gym.md for the keys')

    scene: str | None = None
    start: Start | None = None
    difficulty: Difficulty | None = None


def read_options(options: Mapping[str, object] | None) -> EpisodeOptions:
    """
    Read the options of `reset`.

    :raises InputError: if a key is unknown, or a value is wrong.
    """
    return read(EpisodeOptions, options or {}, 'options of reset')


def game_at(game: Game, difficulty: float, seed: int) -> Game:
    """
    Return the game of a difficulty.

    Traffic is thinned: agents at the start and arrivals are the share `difficulty` of the game's.
    What the game's `vary:` section lists is drawn by the seed, between its nominal values (0) and
    its full ranges (1); in the unit cube of its distributions, each coordinate is moved from the
    nominal towards the drawn one by the share `difficulty`.

    :raises InputError: if no variant keeps the constraints.
    """
    if game.vary:
        game = _varied(game, difficulty, seed)
    if game.traffic is not None:
        game = replace(game, traffic=replace(
            game.traffic, agents=round(difficulty * game.traffic.agents),
            flow=difficulty * game.traffic.flow))
    return game


def _varied(game: Game, difficulty: float, seed: int) -> Game:
    where = str(game.scenario)
    space = VariantSpace(game.vary, write(game, game.base), where)
    if not difficulty:
        return game_of(game, space.nominal, where)
    nominal = space.point(space.nominal)
    random = np.random.Generator(np.random.PCG64((seed, 2)))
    for _ in range(_DRAWN):
        drawn = random.random(len(space.axes))
        variant = space.variant(nominal + difficulty * (drawn - nominal))
        if space.is_allowed(variant):
            return game_of(game, variant, where)
    raise InputError(f'none of {_DRAWN} variants keeps the constraints', where, 'loosen them')
