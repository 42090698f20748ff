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
"""A drive that was disturbed from outside does not count."""

from crgame_ros.study.conduct.disturbance import Disturbance
import pytest


class Clocks:
    """Two clocks, one of which stands while the machine sleeps."""

    def __init__(self) -> None:
        self.steady_s = 100.0
        self.boot_s = 130.0

    def pass_s(self, seconds: float, asleep: bool = False) -> None:
        """Let time pass."""
        self.boot_s += seconds
        self.steady_s += 0.0 if asleep else seconds


@pytest.fixture
def clocks() -> Clocks:
    return Clocks()


@pytest.fixture
def disturbance(clocks: Clocks) -> Disturbance:
    return Disturbance(2.0, lambda: clocks.steady_s, lambda: clocks.boot_s)


def test_time_alone_disturbs_nothing(clocks: Clocks, disturbance: Disturbance) -> None:
    for _ in range(100):
        clocks.pass_s(0.5)
        assert disturbance.look(False) is None


def test_a_closed_lid_is_noticed(clocks: Clocks, disturbance: Disturbance) -> None:
    clocks.pass_s(3.0)
    clocks.pass_s(600.0, asleep=True)
    assert disturbance.look(False) == 'the machine slept for 600 s'


def test_a_page_may_come_back(clocks: Clocks, disturbance: Disturbance) -> None:
    for lost in (True, True, False, True, True):
        assert disturbance.look(lost) is None
        clocks.pass_s(1.0)
    clocks.pass_s(0.5)
    assert disturbance.look(True) == "the participant's page was gone for 2 s"


def test_the_clocks_of_this_machine_agree() -> None:
    assert Disturbance(2.0).look(False) is None
