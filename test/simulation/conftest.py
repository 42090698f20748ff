# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the engine's tests; helpers are in simulation_support.py beside this file."""

from pathlib import Path
import sys

import pytest

from crgame_ros.scenario.loading import load_scenario, LoadedScenario

sys.path.insert(0, str(Path(__file__).parent))

import simulation_support as support  # noqa: E402, I001


@pytest.fixture(scope='session')
def cut_in() -> LoadedScenario:
    """Load a straight motorway with one planning problem and no obstacle."""
    return load_scenario(support.scenario_file('cut_in'))


@pytest.fixture(scope='session')
def two_avs() -> LoadedScenario:
    """Load a curved motorway with two planning problems."""
    return load_scenario(support.scenario_file('two_avs'))


@pytest.fixture(scope='session')
def traffic() -> LoadedScenario:
    """Load a motorway with one planning problem and recorded obstacles."""
    return load_scenario(support.scenario_file('traffic'))
