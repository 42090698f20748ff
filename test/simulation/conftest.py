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
"""Fixtures of the engine's tests; helpers are in simulation_support.py beside this file."""

from pathlib import Path
import sys

from crgame_ros.game.game_file import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
import pytest

sys.path.insert(0, str(Path(__file__).parent))


def scenario_of(game: str) -> LoadedScenario:
    """Load the scenario of one of the package's own games."""
    return load_scenario(load_game(scenarios_directory() / f'{game}.yaml').scenario)


@pytest.fixture(scope='session')
def cut_in() -> LoadedScenario:
    """Load a straight motorway with one planning problem and no obstacle."""
    return scenario_of('cut_in')


@pytest.fixture(scope='session')
def two_avs() -> LoadedScenario:
    """Load a curved motorway with two planning problems."""
    return scenario_of('two_avs')


@pytest.fixture(scope='session')
def traffic() -> LoadedScenario:
    """Load a motorway with one planning problem and recorded obstacles."""
    return scenario_of('traffic')
