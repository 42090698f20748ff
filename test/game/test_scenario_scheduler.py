# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The two time grids and their relation (CRG 14)."""

from fractions import Fraction
import math

from crgame_ros.errors import InputError
from crgame_ros.game.scenario_scheduler import replanning_period, ScenarioScheduler
import pytest


@pytest.mark.parametrize(('time_step', 'dt', 'period'), [
    (0.1, 0.01, 10), (0.04, 0.01, 4), (0.2, 0.01, 20), (0.1, 0.03, 3), (0.1, 0.001, 100),
    (0.1, 0.5, 1), (0.04, 1.0 / 60.0, 2)])
def test_replanning_period(time_step: float, dt: float, period: int) -> None:
    """CRG 14: N = max(1, round(dt_c / dt)); 10 for the paper's 0.1 s and 10 ms."""
    assert replanning_period(time_step, dt) == period


@pytest.mark.parametrize(('time_step', 'rate', 'period', 'dt_ns'), [
    (0.1, 100.0, 10, Fraction(10_000_000)), (0.04, 100.0, 4, Fraction(10_000_000)),
    (0.2, 100.0, 20, Fraction(10_000_000)), (0.1, 30.0, 3, Fraction(100_000_000, 3)),
    (0.1, 70.0, 7, Fraction(100_000_000, 7)), (0.04, 1000.0, 40, Fraction(1_000_000)),
    (0.1, 3.0, 1, Fraction(100_000_000))])
def test_step_divides_the_scenario_step_exactly(time_step: float, rate: float, period: int,
                                                dt_ns: Fraction) -> None:
    """If the rate doesn't divide dt_c, dt becomes dt_c / N: 14.29 ms for 70 Hz."""
    scheduler = ScenarioScheduler.from_rate(time_step, rate)
    assert scheduler.steps_per_tick == period
    assert scheduler.dt_s == pytest.approx(float(dt_ns) * 1e-9, rel=1e-15)
    assert scheduler.time_step_s == time_step
    assert scheduler.stamp_ns(period) == round(time_step * 1e9)


@pytest.mark.parametrize('rate', [100.0, 30.0, 70.0, 1000.0])
def test_stamps_do_not_drift(rate: float) -> None:
    """After 10^6 steps a stamp is the exact quotient rounded down, and its tick exact."""
    scheduler = ScenarioScheduler.from_rate(0.1, rate, clock_offset_ns=123_456_789)
    period = scheduler.steps_per_tick
    exact = Fraction(100_000_000, period)
    for n in (1, 2, 3, 999_999, 1_000_000, 1_000_001):
        assert scheduler.stamp_ns(n) == 123_456_789 + math.floor(n * exact)
    ticks = 1_000_000
    assert scheduler.stamp_ns(ticks * period) == 123_456_789 + ticks * 100_000_000


def test_million_float_additions_would_have_drifted() -> None:
    """Integers avoid this error: ten additions of 0.1 floor to 0 (CRG 15 as printed)."""
    progress = 0.0
    for _ in range(10):
        progress += 0.1
    assert math.floor(progress) == 0
    scheduler = ScenarioScheduler.from_rate(0.1, 100.0)
    assert scheduler.k(10) == 1
    clock = 0.0
    for _ in range(1_000_000):
        clock += 0.01
    assert abs(clock - 10_000.0) > 1e-7
    assert scheduler.stamp_ns(1_000_000) == 10_000 * 10**9


def test_scenario_time_advances_every_n_steps() -> None:
    """K starts at k0 and counts whole scenario steps; a tick is a step at which it advances."""
    scheduler = ScenarioScheduler.from_rate(0.1, 100.0, k0=7)
    assert [scheduler.k(n) for n in (0, 1, 9, 10, 19, 20)] == [7, 7, 7, 8, 8, 9]
    assert [n for n in range(31) if scheduler.is_tick(n)] == [0, 10, 20, 30]


@pytest.mark.parametrize('rate', [100.0, 30.0, 70.0])
def test_stamp_leads_back_to_its_step(rate: float) -> None:
    """Every step is found by its stamp, and only stamps of ticks are ticks."""
    scheduler = ScenarioScheduler.from_rate(0.1, rate, 4, clock_offset_ns=5_000_000_001)
    for n in range(1000):
        stamp = scheduler.stamp_ns(n)
        assert scheduler.step_of_stamp(stamp) == n
        assert scheduler.tick_of_stamp(stamp) == (n if scheduler.is_tick(n) else None)


def test_stamps_of_other_runs_are_no_ticks() -> None:
    """Stamps before the run (an older epoch) or a nanosecond beside a tick are no ticks."""
    scheduler = ScenarioScheduler.from_rate(0.1, 100.0, clock_offset_ns=10**9)
    assert scheduler.tick_of_stamp(9 * 10**8) is None
    assert scheduler.tick_of_stamp(10**9 + 1) is None
    assert scheduler.tick_of_stamp(10**9) == 0
    assert scheduler.step_of_stamp(9 * 10**8) == -10


def test_steps_for_a_duration() -> None:
    """20 s are 2000 steps at 100 Hz and 600 at 30 Hz."""
    assert ScenarioScheduler.from_rate(0.1, 100.0).steps_for(20.0) == 2000
    assert ScenarioScheduler.from_rate(0.1, 30.0).steps_for(20.0) == 600
    assert ScenarioScheduler.from_rate(0.04, 100.0).steps_for(0.04) == 4


@pytest.mark.parametrize('time_step', [0.0, -0.1, 1e-12])
def test_scenario_step_must_be_positive(time_step: float) -> None:
    """A step of less than a nanosecond is refused."""
    with pytest.raises(InputError, match='timeStepSize.*is not positive'):
        ScenarioScheduler.from_rate(time_step, 100.0)
