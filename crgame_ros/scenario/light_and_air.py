# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The light and weather of a run, from its game, or else from its scenario."""

from commonroad.scenario.scenario import Environment, Scenario, TimeOfDay, Weather
from crgame_ros.game.game import CLEAR_M, EnvironmentSpec

# By definition fog is less than 1 km [m]; a rear fog lamp is allowed below 50 m.
FOG_M = 200.0
_DARK = (TimeOfDay.NIGHT, TimeOfDay.SUNSET)


def environment_of(scenario: Scenario, game: EnvironmentSpec | None) -> EnvironmentSpec:
    """
    Resolve light and weather.

    CommonRoad's night is shown as dusk; of its weathers only fog is shown.

    :param game: the game's values; None for none
    :return: with light and visibility, and the game's friction
    """
    location = scenario.location
    said = Environment() if location is None or location.environment is None \
        else location.environment
    game = EnvironmentSpec() if game is None else game
    return EnvironmentSpec(
        game.light or ('dusk' if said.time_of_day in _DARK else 'day'),
        game.visibility or (FOG_M if said.weather is Weather.FOG else CLEAR_M),
        game.friction)
