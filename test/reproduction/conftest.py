# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs that the tests of the reproduction share: each takes seconds."""

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.paths import scenarios_directory
from crgame_ros.reproduction.recorded_human import record_offline, RecordedHuman
import pytest


@pytest.fixture(scope='session')
def cut_in() -> RecordedHuman:
    """Record the cut-in offline, as long as the IDM needs to stop."""
    return record_offline(scenarios_directory() / 'cut_in.yaml', 'idm', 18.0)


@pytest.fixture(scope='session')
def idm(cut_in: RecordedHuman) -> Alternative:
    """Drive its human against the IDM planner."""
    return cut_in.against('idm')


@pytest.fixture(scope='session')
def unmoved(cut_in: RecordedHuman) -> Alternative:
    """Drive its human against a planner that does not react."""
    return cut_in.against('constant-velocity')
