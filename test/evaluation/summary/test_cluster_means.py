# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Means and intervals against SciPy's, and how often chance alone is taken for a difference."""

from crgame_ros.evaluation.summary.cluster_means import ClusterMeans, holm, run_clusters
from crgame_ros.evaluation.summary.summary import Estimate
import numpy as np
from numpy.typing import NDArray
import pytest
from scipy import stats

Array = NDArray[np.float64]


def _estimate(values: Array, clusters: NDArray[np.int64], blocks: int = 1) -> Estimate:
    found = ClusterMeans(1)
    for rows in np.array_split(np.arange(len(values)), blocks):
        found.add(values[rows, None], clusters[rows])
    estimate, = found.estimates()
    return estimate


@pytest.mark.parametrize('scenarios', [2, 3, 5, 30])
@pytest.mark.parametrize('blocks', [1, 4])
def test_the_interval_is_students(scenarios: int, blocks: int) -> None:
    """Of the scenarios' means, from SciPy."""
    random = np.random.default_rng(3)
    values = random.normal(0.4, 1.0, (scenarios, 1)) + random.normal(0.0, 0.5, (scenarios, 7))
    found = _estimate(values.reshape(-1), np.repeat(np.arange(scenarios), 7), blocks)
    theirs = stats.ttest_1samp(values.mean(axis=1), 0.0)
    low, high = theirs.confidence_interval(0.95)
    assert (found.value, found.low, found.high, found.p) == pytest.approx(
        (values.mean(), low, high, theirs.pvalue))
    assert (found.n, found.clusters) == (values.size, scenarios)


def test_scenarios_weigh_alike_whatever_their_cells() -> None:
    """The mean is that of their means, and so is the interval."""
    random = np.random.default_rng(7)
    clusters = np.repeat(np.arange(12), random.integers(1, 20, 12))
    values = random.normal(0.0, 1.0, 12)[clusters] + random.normal(0.0, 0.2, len(clusters))
    found = _estimate(values, clusters, 3)
    means = [values[clusters == each].mean() for each in range(12)]
    low, high = stats.ttest_1samp(means, 0.0).confidence_interval(0.95)
    assert (found.value, found.low, found.high) == pytest.approx((np.mean(means), low, high))


def test_equal_runs_are_one() -> None:
    """Eight seeds of one run have no interval; of two runs they have that of two values."""
    runs = np.full(8, 12345678901234567890, np.uint64)
    one = _estimate(np.full(8, 2.0), run_clusters(runs))
    assert (one.value, one.n, one.clusters) == (2.0, 8, 1) and np.isnan([one.low, one.p]).all()
    runs[4:] += np.uint64(1)
    two = _estimate(np.repeat([2.0, 3.0], 4), run_clusters(runs))
    low, high = stats.ttest_1samp([2.0, 3.0], 0.0).confidence_interval(0.95)
    assert (two.clusters, two.low, two.high) == (2, pytest.approx(low), pytest.approx(high))


def test_what_is_missing_is_left_out() -> None:
    """Clusters are counted for each measure: those with a value."""
    values = np.array([(1.0, np.nan), (2.0, np.nan), (3.0, 5.0), (4.0, 7.0), (5.0, np.nan)])
    found = ClusterMeans(2)
    found.add(values, np.array([0, 0, 1, 2, 3]))
    first, second = found.estimates()
    assert (first.value, first.n, first.clusters) == (np.mean([1.5, 3.0, 4.0, 5.0]), 5, 4)
    assert (second.value, second.n, second.clusters) == (6.0, 2, 2)


def test_rounding_is_no_difference() -> None:
    """The same value everywhere has an interval of zero width; zero is zero for certain."""
    found = _estimate(np.full(9, 0.1) + np.array([0.0, 1e-17, 0.0] * 3), np.arange(9))
    assert found.low == found.value == found.high and found.p == 0.0
    assert _estimate(np.zeros(6), np.arange(6)).p == 1.0


def test_holm_is_that_of_the_paper() -> None:
    """The k-th smallest of m is compared with 5 % / (m - k + 1), up to the first that is not."""
    def marked(*ps: float) -> list[bool]:
        return [each.beyond_chance for each in holm(
            Estimate(1.0, 0.0, 2.0, 9, 9, p) for p in ps)]
    assert marked(0.01, 0.04, 0.03, 0.005) == [True, False, False, True]
    assert marked(0.012, 0.016, 0.024, 0.04) == [True] * 4
    assert marked(0.02, 0.016, 0.024, 0.04) == [False] * 4
    assert marked(0.04, float('nan'), float('nan')) == [True, False, False]


def alarms(random: np.random.Generator, scenarios: int, draw: str, measures: int = 15) -> bool:
    """Compare two equals in so many scenarios; return whether any measure is told apart."""
    sizes = random.integers(1, 9, scenarios)
    clusters = np.repeat(np.arange(scenarios), sizes)

    def drawn(*shape: int) -> Array:
        if draw == 'heavy tails':
            return random.standard_t(3.0, shape)
        # The difference of two skewed values; and of events that happen now and then.
        return np.subtract(*random.lognormal(0.0, 1.0, (2, *shape))) if draw == 'skewed' \
            else np.subtract(*(random.random((2, *shape)) < 0.2).astype(float))
    found = ClusterMeans(measures)
    found.add(drawn(scenarios, measures)[clusters] + drawn(len(clusters), measures), clusters)
    return any(each.beyond_chance for each in holm(found.estimates()))


@pytest.mark.matrix('events')
@pytest.mark.parametrize('draw', ['heavy tails', 'skewed', 'events'])
def test_equals_are_seldom_told_apart(draw: str) -> None:
    """By any of 15 measures, in 300 comparisons of 3 to 50 scenarios: seldom beyond 5 %."""
    random = np.random.default_rng(11)
    found = sum(alarms(random, scenarios, draw) for scenarios in (3, 5, 6, 10, 20, 50)
                for _ in range(50))
    # Of 300 with a probability of 5 % more than 25 are found in one of 500 trials.
    assert found <= 25
