# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Intervals against closed forms, SciPy's, and their coverage of the true value."""

from crgame_ros.evaluation.summary.group_bootstrap import DrawnUnits, GroupBootstrap
import numpy as np
from numpy.typing import NDArray
import pytest
from scipy import stats

# Standard deviations of the 2.5 % and 97.5 % points of a normal distribution.
HALF = float(stats.norm.ppf(0.975))


def _cells(values: NDArray[np.float64], blocks: int = 1, resamples: int = 20_000,
           ) -> tuple[float, float, float]:
    """Draw cells of one scenario, in so many blocks."""
    parts = np.array_split(values, blocks)
    found = GroupBootstrap('idm', DrawnUnits([len(part) for part in parts], {0}), 1, resamples, 0)
    for number, part in enumerate(parts):
        found.add(number, part[:, None], np.ones((len(part), 1)), np.zeros(len(part), np.int64))
    estimate, = found.estimates()
    return estimate.value, estimate.low, estimate.high


@pytest.mark.parametrize('blocks', [1, 4])
def test_intervals_of_cells_are_those_of_scipy(blocks: int) -> None:
    """A skewed sample, so that an interval of normal theory would be elsewhere."""
    values = np.random.default_rng(3).exponential(2.0, 15)
    value, low, high = _cells(values, blocks)
    theirs = stats.bootstrap((values,), np.mean, n_resamples=20_000, method='percentile',
                             rng=np.random.default_rng(4)).confidence_interval
    assert value == pytest.approx(values.mean())
    # The points of 20,000 resamples have a standard error of about 0.01.
    assert (low, high) == pytest.approx((theirs.low, theirs.high), abs=0.04)
    normal = values.mean() - HALF * values.std() / np.sqrt(15)
    assert abs(low - normal) > 0.08


@pytest.mark.parametrize('blocks', [1, 8])
def test_intervals_of_cells_have_the_width_of_theory(blocks: int) -> None:
    """The bootstrap's standard error is that of the mean of the given sample."""
    values = np.random.default_rng(5).normal(10.0, 2.0, 400)
    _, low, high = _cells(values, blocks)
    assert (high - low) / 2.0 == pytest.approx(HALF * values.std() / 20.0, rel=0.03)


def test_a_share_is_drawn_as_a_binomial_count() -> None:
    values = np.repeat([1.0, 0.0], [15, 85])
    _, low, high = _cells(values)
    expected = stats.binom.ppf([0.025, 0.975], 100, 0.15) / 100.0
    assert (low, high) == pytest.approx(tuple(expected), abs=0.0101)


def _scenarios(means: NDArray[np.float64], cells: NDArray[np.float64], resamples: int = 20_000,
               seed: int = 0) -> tuple[float, float, float]:
    """Draw scenarios (S) of (S, cells) values around their means."""
    values = means[:, None] + cells
    count, each = values.shape
    found = GroupBootstrap('idm', DrawnUnits([values.size], set(range(count))), 1, resamples, seed)
    found.add(0, values.reshape(-1, 1), np.ones((values.size, 1)),
              np.repeat(np.arange(count), each))
    estimate, = found.estimates()
    assert (estimate.n, estimate.units) == (values.size, count)
    return estimate.value, estimate.low, estimate.high


def test_intervals_of_scenarios_have_the_width_of_theory() -> None:
    """With as many cells in each, the mean is that of the scenarios' means."""
    random = np.random.default_rng(6)
    means, cells = random.normal(0.0, 1.0, 100), random.normal(0.0, 0.5, (100, 7))
    value, low, high = _scenarios(means, cells)
    of_scenarios = (means[:, None] + cells).mean(axis=1)
    assert value == pytest.approx(of_scenarios.mean())
    assert (high - low) / 2.0 == pytest.approx(HALF * of_scenarios.std() / 10.0, rel=0.03)


def test_unequal_scenarios_weigh_as_their_cells() -> None:
    """SciPy's, of the ratio of two sums over scenarios that are drawn."""
    random = np.random.default_rng(7)
    sizes = random.integers(1, 20, 30)
    clusters = np.repeat(np.arange(30), sizes)
    values = random.normal(0.0, 1.0, 30)[clusters] + random.normal(0.0, 0.2, len(clusters))
    found = GroupBootstrap('idm', DrawnUnits([len(values)], set(range(30))), 1, 20_000, 0)
    found.add(0, values[:, None], np.ones((len(values), 1)), clusters)
    estimate, = found.estimates()
    theirs = stats.bootstrap(
        (np.bincount(clusters, values), sizes.astype(float)), lambda total, count, axis:
        total.sum(axis) / count.sum(axis), paired=True, n_resamples=20_000, method='percentile',
        rng=np.random.default_rng(8)).confidence_interval
    assert (estimate.low, estimate.high) == pytest.approx((theirs.low, theirs.high), abs=0.02)


def test_intervals_of_scenarios_hold_the_truth_and_those_of_cells_do_not() -> None:
    """Of 300 evaluations with 30 scenarios, of 20 cells each."""
    random = np.random.default_rng(9)
    held = np.zeros(2)
    for seed in range(300):
        means, cells = random.normal(0.0, 1.0, 30), random.normal(0.0, 1.0, (30, 20))
        for kind, (_, low, high) in enumerate((
                _scenarios(means, cells, 400, seed),
                _cells((means[:, None] + cells).reshape(-1), resamples=100))):
            held[kind] += low <= 0.0 <= high
    # Percentile intervals of 30 values hold it in about 94 %; cells count each value 20 times.
    assert 0.91 < held[0] / 300 < 0.98
    assert held[1] / 300 < 0.65


def test_a_single_value_has_no_interval() -> None:
    value, low, high = _cells(np.array([2.0]), resamples=100)
    assert value == 2.0 and np.isnan([low, high]).all()


def test_values_that_are_missing_are_left_out_of_each_resample() -> None:
    """The mean of those that are there, which number differently in each."""
    random = np.random.default_rng(10)
    values, there = random.normal(5.0, 1.0, 200), random.random(200) < 0.5
    found = GroupBootstrap('idm', DrawnUnits([200], {0}), 1, 20_000, 0)
    found.add(0, np.where(there, values, 0.0)[:, None], there[:, None].astype(float),
              np.zeros(200, np.int64))
    estimate, = found.estimates()
    assert estimate.n == estimate.units == there.sum()
    assert estimate.value == pytest.approx(values[there].mean())
    expected = HALF * values[there].std() / np.sqrt(there.sum())
    assert (estimate.high - estimate.low) / 2.0 == pytest.approx(expected, rel=0.04)
