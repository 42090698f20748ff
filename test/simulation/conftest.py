# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the engine's tests; helpers are in simulation_support.py beside this file."""

from pathlib import Path
import sys

from crgame_ros.game.game import load_game
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
