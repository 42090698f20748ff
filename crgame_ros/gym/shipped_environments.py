# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ids of the environments: one for each shipped game, one for any other, one for folders."""

from crgame_ros.paths import own_games
import gymnasium

NAMESPACE = 'crgame'
ANY_GAME = f'{NAMESPACE}/Game-v0'
# With the keyword `scenes`.
FOLDER = f'{NAMESPACE}/Scenes-v0'
_ENTRY = 'crgame_ros.gym.driving_env:DrivingEnv'
_VECTOR_ENTRY = 'crgame_ros.gym.games_together:GamesTogether'


def environment_id(game: str) -> str:
    """Return the id of a shipped game's environment, such as crgame/CutIn-v0."""
    return f'{NAMESPACE}/{"".join(word.capitalize() for word in game.split("_"))}-v0'


def register_all() -> None:
    """Register every environment with Gymnasium, unless it is registered already."""
    shipped = {environment_id(game): {'game': game} for game in own_games()}
    for name, keywords in {ANY_GAME: {}, FOLDER: {}, **shipped}.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=_ENTRY, vector_entry_point=_VECTOR_ENTRY,
                               kwargs=keywords)
