# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Light and air of a run: what its game says, else what its scenario says."""

from commonroad.scenario.scenario import Environment, Scenario, TimeOfDay, Weather
from crgame_ros.game.environment_spec import CLEAR_M, EnvironmentSpec

# By definition fog is less than 1 km [m]; a rear fog lamp is allowed below 50 m.
FOG_M = 200.0
_DARK = (TimeOfDay.NIGHT, TimeOfDay.SUNSET)


def environment_of(scenario: Scenario, game: EnvironmentSpec | None) -> EnvironmentSpec:
    """
    Resolve light and air.

    CommonRoad's night is shown as dusk, and of its weathers only fog.

    :param game: what the game says; None for nothing
    :return: one in which nothing is None
    """
    location = scenario.location
    said = Environment() if location is None or location.environment is None \
        else location.environment
    game = EnvironmentSpec() if game is None else game
    return EnvironmentSpec(
        game.light or ('dusk' if said.time_of_day in _DARK else 'day'),
        game.visibility or (FOG_M if said.weather is Weather.FOG else CLEAR_M))
