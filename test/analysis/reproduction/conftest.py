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
"""Runs that the tests of the reproduction share: they take seconds to make."""

from crgame_ros.analysis.counterfactual import Alternative
from crgame_ros.analysis.reproduction.recorded_human import record_offline, RecordedHuman
from crgame_ros.paths import scenarios_directory
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
