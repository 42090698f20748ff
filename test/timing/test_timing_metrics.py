# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The metrics of CRG table I on series whose values are known by hand."""

import dataclasses
import math

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.game import TimingSpec
from crgame_ros.timing.metrics import LogHistogram, TimingMetrics, TimingSummary
from crgame_ros.timing.time_controller import TimeController
import numpy as np
from numpy.typing import NDArray
import pytest

DT = 0.01
TABLE_I = ['final_error_ms', 'mean_step_error_ms', 'max_cumulative_error_ms', 'timeout_ratio',
           'real_time_ratio', 'time_efficiency', 'precision_ratio']


def rows_of(actual: NDArray[np.float64], busy: float | NDArray[np.float64] = 0.002,
            dropped: float | NDArray[np.float64] = 0.0) -> NDArray[np.float64]:
    """Build cycle rows 0, 1, … whose original schedule is n dt."""
    scheduled = np.arange(len(actual)) * DT
    return np.stack(np.broadcast_arrays(scheduled + dropped, actual, busy, dropped), axis=1)


def summarise(rows: NDArray[np.float64]) -> TimingSummary:
    """Feed all rows at once."""
    metrics = TimingMetrics(DT)
    metrics.add_rows(rows)
    return metrics.summary()


def noisy_rows(seed: int, count: int = 4000) -> NDArray[np.float64]:
    """Draw a run with jitter, stalls and two drift resets, one of them forward."""
    random = np.random.default_rng(seed)
    lag = random.exponential(2e-4, count)
    lag[::317] += 0.08
    dropped = np.zeros(count)
    dropped[1500:] = 0.3
    dropped[2500:] = 0.27
    actual = np.maximum.accumulate(np.arange(count) * DT + dropped + lag)
    return rows_of(actual, random.exponential(0.004, count), dropped)


def test_perfect_run_has_no_error() -> None:
    """On the schedule every error is 0 and every ratio 1."""
    summary = summarise(rows_of(np.arange(1001) * DT))
    assert summary.final_error_ms == pytest.approx(0.0, abs=1e-9)
    assert summary.mean_step_error_ms == pytest.approx(0.0, abs=1e-9)
    assert summary.max_cumulative_error_ms == pytest.approx(0.0, abs=1e-9)
    assert (summary.timeout_ratio, summary.resets, summary.cycles) == (0.0, 0, 1001)
    assert dataclasses.astuple(summary.real_time_ratio) == pytest.approx((1.0, 1.0, 1.0))
    assert summary.time_efficiency == pytest.approx(1.0)
    assert summary.rate_hz == pytest.approx(100.0)
    assert summary.duration_s == pytest.approx(10.0)


def test_constant_lag_is_an_error_of_the_schedule_not_of_the_steps() -> None:
    """A lag of 2 ms everywhere: E_f = E_max = 2 ms, while all steps are exact."""
    summary = summarise(rows_of(np.arange(501) * DT + 0.002))
    assert summary.final_error_ms == pytest.approx(2.0)
    assert summary.max_cumulative_error_ms == pytest.approx(2.0)
    assert summary.worst_lag_ms == pytest.approx(2.0)
    assert summary.mean_step_error_ms == pytest.approx(0.0, abs=1e-9)
    assert summary.precision_ratio == pytest.approx(0.002 / 5.0)


def test_paper_precision_ratio() -> None:
    """CRG table I: E_f = 1.48 ms over about 14.8 s is P_r = 1.00e-4."""
    actual = np.arange(1481) * DT
    actual[-1] += 0.00148
    summary = summarise(rows_of(actual))
    assert summary.final_error_ms == pytest.approx(1.48)
    assert summary.precision_ratio == pytest.approx(1.00e-4, rel=1e-3)


def test_early_finish_is_an_error_too() -> None:
    """E_f is an absolute difference (CRG IV-C): 3 ms early counts like 3 ms late."""
    actual = np.arange(101) * DT
    actual[-1] -= 0.003
    summary = summarise(rows_of(actual))
    assert summary.final_error_ms == pytest.approx(3.0)
    assert summary.worst_lag_ms == pytest.approx(0.0, abs=1e-9)
    assert summary.real_time_ratio.final > 1.0


def test_one_stall_with_catch_up() -> None:
    """
    Cycle 50 starts 40 ms late, then steps of 2 ms gain 8 ms each until the lag is gone.

    |e_50| = 40 ms and 5 steps of 8 ms: the sum is 80 ms over 100 steps. The slowest step takes
    50 ms: ratio 0.2. The mean of the ratio since the start is summed by hand.
    """
    lag = np.zeros(101)
    lag[50:55] = 0.04 - 0.008 * np.arange(5)
    busy = np.full(101, 0.002)
    busy[49] = 0.05
    busy[60] = 0.0101
    summary = summarise(rows_of(np.arange(101) * DT + lag, busy))
    assert summary.final_error_ms == pytest.approx(0.0, abs=1e-9)
    assert summary.mean_step_error_ms == pytest.approx(0.8)
    assert summary.max_cumulative_error_ms == pytest.approx(40.0)
    assert summary.worst_lag_ms == pytest.approx(40.0)
    # Lags of 40, 32, 24, 16; the 8 ms left are less than a step.
    assert summary.catch_up_steps == 4
    assert summary.timeout_ratio == pytest.approx(2 / 101)
    assert summary.real_time_ratio.min == pytest.approx(0.2)
    assert summary.real_time_ratio.final == pytest.approx(1.0)
    late = [0.50 / 0.54, 0.51 / 0.542, 0.52 / 0.544, 0.53 / 0.546, 0.54 / 0.548]
    assert summary.real_time_ratio.mean == pytest.approx((95 + sum(late)) / 100)


def test_busy_time_equal_to_the_budget_is_no_timeout() -> None:
    """R_timeout counts what exceeds the budget (CRG IV-C)."""
    assert summarise(rows_of(np.arange(11) * DT, DT)).timeout_ratio == 0.0
    assert summarise(rows_of(np.arange(11) * DT, np.nextafter(DT, 1.0))).timeout_ratio == 1.0


def test_reset_is_added_back() -> None:
    """A stall of 300 ms, forgiven at once by a reset, still counts in E_f, E_max and eta_t."""
    count, stall = 201, 0.3
    dropped = np.where(np.arange(count) >= 100, stall, 0.0)
    rows = rows_of(np.arange(count) * DT + dropped, dropped=dropped)
    assert (rows[:, 0] == rows[:, 1]).all()  # nothing shows in the lag behind the present schedule
    summary = summarise(rows)
    assert summary.final_error_ms == pytest.approx(300.0)
    assert summary.max_cumulative_error_ms == pytest.approx(300.0)
    assert summary.mean_step_error_ms == pytest.approx(300.0 / 200)
    assert (summary.resets, summary.dropped_ms) == (1, pytest.approx(300.0))
    assert summary.worst_lag_ms == pytest.approx(300.0)
    assert summary.time_efficiency == pytest.approx(2.0 / 2.3)
    assert summary.real_time_ratio.min == pytest.approx(0.01 / 0.31)
    assert summary.precision_ratio == pytest.approx(0.3 / 2.3)


@pytest.mark.parametrize('factor', [1.0, 0.5, 4.0])
def test_time_controller_feeds_the_metrics(factor: float) -> None:
    """A 400 ms stall on the run's time line is dropped by a reset, whatever the factor."""
    controller = TimeController(TimingSpec(), DT)
    controller.start(0)
    metrics = TimingMetrics(DT)
    wall_ns = 0
    controller.resume(0, factor)
    for n in range(1, 401):
        wall_ns = max(wall_ns, controller.deadline_ns())
        wall_ns += round(0.4e9 / factor) if n == 200 else 0
        cycle = controller.begin_cycle(wall_ns)
        metrics.add_rows(np.array([
            [cycle.ideal_s, cycle.actual_s, 0.001, cycle.dropped_s]]))
    summary = metrics.summary()
    assert summary.resets == 1
    assert summary.final_error_ms == pytest.approx(400.0, abs=1e-4)
    assert summary.worst_lag_ms == pytest.approx(400.0, abs=1e-4)
    assert summary.real_time_ratio.min == pytest.approx(0.01 / 0.41, rel=1e-4)


@pytest.mark.parametrize('seed', range(3))
def test_blocks_equal_the_whole(seed: int) -> None:
    """Reading a bag in blocks gives the same bits as the live supervisor got."""
    rows = noisy_rows(seed)
    metrics = TimingMetrics(DT)
    for block in np.split(rows, [0, 1, 2, 700, 701, 1500, 1501]):
        metrics.add_rows(block)
    assert metrics.summary() == summarise(rows)
    assert metrics.cycles == len(rows)


def test_step_errors_add_up_to_the_lag() -> None:
    """The signed e_n of CRG 12 sum to L_K - L_0, so their mean size is at least that."""
    rows = noisy_rows(7)
    lag = rows[:, 1] - (rows[:, 0] - rows[:, 3])
    summary = summarise(rows)
    assert summary.final_error_ms == pytest.approx(1e3 * abs(lag[-1]))
    assert summary.max_cumulative_error_ms == pytest.approx(1e3 * np.abs(lag).max())
    assert summary.mean_step_error_ms == pytest.approx(1e3 * np.abs(np.diff(lag)).mean())
    assert summary.resets == 2


def test_quantiles_against_numpy() -> None:
    """A bin is 2.3 % wide, so its middle is within 1.2 % of the exact quantile."""
    rows = noisy_rows(11)
    summary = summarise(rows)
    errors = np.abs(np.diff(rows[:, 1] - (rows[:, 0] - rows[:, 3])))
    for value, data, share in ((summary.step_error_p50_ms, errors, 0.5),
                               (summary.step_error_p99_ms, errors, 0.99),
                               (summary.busy_p50_ms, rows[:, 2], 0.5),
                               (summary.busy_p99_ms, rows[:, 2], 0.99)):
        exact = 1e3 * float(np.quantile(data, share, method='inverted_cdf'))
        assert value == pytest.approx(exact, rel=0.012)


def test_histogram_ends() -> None:
    """Zero and huge durations are counted, and a constant comes back exactly."""
    histogram = LogHistogram()
    assert histogram.quantile(0.5) == 0.0
    histogram.add_all(np.array([0.0, 0.0, 5e3]))
    assert (histogram.quantile(0.5), histogram.quantile(1.0)) == (0.0, 5e3)
    constant = LogHistogram()
    constant.add_all(np.full(10, 0.00123))
    assert constant.quantile(0.99) == 0.00123


def test_memory_does_not_grow() -> None:
    """A day at 100 Hz must not fill memory: no container gets longer with the cycles."""
    metrics = TimingMetrics(DT)
    metrics.add_rows(noisy_rows(1, 10))

    def sizes() -> list[int]:
        return [len(value._counts) for value in vars(metrics).values()
                if isinstance(value, LogHistogram)]

    before = sizes()
    metrics.add_rows(noisy_rows(1, 4000) + [1.0, 1.0, 0.0, 0.0])
    assert sizes() == before
    assert not any(isinstance(value, list | dict | set | np.ndarray)
                   for value in vars(metrics).values())


def test_keys_of_timing_json() -> None:
    """The keys of table I come first, in its order, with the three real-time ratios nested."""
    values = summarise(noisy_rows(2)).as_dict()
    assert list(values)[:7] == TABLE_I
    assert list(values['real_time_ratio']) == ['final', 'mean', 'min']
    numbers = [value for value in values.values() if not isinstance(value, dict)]
    assert all(math.isfinite(value) for value in numbers)
    assert values['cycles'] == 4000


@pytest.mark.parametrize('row', [(math.nan, 0.0, 0.0, 0.0), (0.0, math.inf, 0.0, 0.0),
                                 (0.03, 0.019, 0.0, 0.0)])
def test_bad_rows_are_refused(row: tuple[float, ...]) -> None:
    """NaN, infinity and time that runs backwards."""
    metrics = TimingMetrics(DT)
    metrics.add_rows(rows_of(np.arange(3) * DT))
    with pytest.raises(InputError, match='timing cycle'):
        metrics.add_rows(np.array([row]))
    assert metrics.cycles == 3


def test_other_bad_input() -> None:
    """A wrong shape, a wrong step and a run of one cycle each say what is wrong."""
    with pytest.raises(InputError, match='ideal_s, actual_s'):
        TimingMetrics(DT).add_rows(np.zeros((3, 5)))
    with pytest.raises(InputError, match='positive'):
        TimingMetrics(0.0)
    metrics = TimingMetrics(DT)
    metrics.add_rows(np.zeros((1, 4)))
    with pytest.raises(CrgameError, match='too few'):
        metrics.summary()
