# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A drive that was disturbed from outside does not count."""

from crgame_ros.study.conduct.study_drive import Disturbance
import pytest


class Clocks:
    """Two clocks, one of which stops while the machine sleeps."""

    def __init__(self) -> None:
        self.steady_s = 100.0
        self.boot_s = 130.0

    def pass_s(self, seconds: float, asleep: bool = False) -> None:
        """Advance the time."""
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
        assert disturbance.check(False) is None


def test_a_closed_lid_is_noticed(clocks: Clocks, disturbance: Disturbance) -> None:
    clocks.pass_s(3.0)
    clocks.pass_s(600.0, asleep=True)
    assert disturbance.check(False) == 'the machine slept for 600 s'


def test_a_page_may_come_back(clocks: Clocks, disturbance: Disturbance) -> None:
    for lost in (True, True, False, True, True):
        assert disturbance.check(lost) is None
        clocks.pass_s(1.0)
    clocks.pass_s(0.5)
    assert disturbance.check(True) == "the participant's page was gone for 2 s"


def test_the_clocks_of_this_machine_agree() -> None:
    assert Disturbance(2.0).check(False) is None
