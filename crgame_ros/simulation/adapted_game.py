# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A game with other AVs and other traffic than its file says."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from crgame_ros.game.game import Game
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.simulation.cast import cast_avs

# Leaves what the game says.
OWN: Final = 'own'


def adapt_game(game: Game, loaded: LoadedScenario, *, seed: int, planner: str = OWN,
               options: Mapping[str, Any] | None = None,
               perception: PerceptionSpec | str | None = OWN,
               traffic: TrafficSpec | str | None = OWN) -> Game:
    """
    Let a game's AVs and traffic be others.

    :param seed: of everything random.
    :param planner: of all AVs, or OWN.
    :param options: of that planner.
    :param perception: of all AVs; None is perfect, OWN the game's.
    :param traffic: None is none, OWN the game's.
    :raises InputError: if the scenario has no planning problems for the game's AVs.
    """
    specs = [spec for spec, _ in cast_avs(game, loaded)[0]]
    if planner != OWN:
        specs = [replace(spec, planner=planner, options=dict(options or {})) for spec in specs]
    if not isinstance(perception, str):
        specs = [replace(spec, perception=perception) for spec in specs]
    if not isinstance(traffic, str):
        game = replace(game, traffic=traffic)
    return replace(game, avs=tuple(specs), seed=seed)
