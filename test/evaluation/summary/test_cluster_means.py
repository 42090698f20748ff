# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Means and intervals against SciPy's, and how often chance alone is taken for a difference."""

from crgame_ros.evaluation.summary.cluster_means import CellClusters, ClusterMeans, holm
from crgame_ros.evaluation.summary.summary import Estimate
import numpy as np
from numpy.typing import NDArray
import pytest
from scipy import stats

Array = NDArray[np.float64]


def _estimate(values: Array, clusters: NDArray[np.int64], blocks: int = 1,
              crossed: NDArray[np.int64] | None = None) -> Estimate:
    found = ClusterMeans(1)
    across = clusters if crossed is None else crossed
    for rows in np.array_split(np.arange(len(values)), blocks):
        found.add(values[rows, None], clusters[rows], across[rows])
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

    def clusters() -> NDArray[np.int64]:
        none = np.zeros(8, np.int64)
        return CellClusters(none, none, runs).crossed('runs')[0]
    one = _estimate(np.full(8, 2.0), clusters())
    assert (one.value, one.n, one.clusters) == (2.0, 8, 1) and np.isnan([one.low, one.p]).all()
    runs[4:] += np.uint64(1)
    two = _estimate(np.repeat([2.0, 3.0], 4), clusters())
    low, high = stats.ttest_1samp([2.0, 3.0], 0.0).confidence_interval(0.95)
    assert (two.clusters, two.low, two.high) == (2, pytest.approx(low), pytest.approx(high))


def test_what_is_missing_is_left_out() -> None:
    """Clusters are counted for each measure: those with a value."""
    values = np.array([(1.0, np.nan), (2.0, np.nan), (3.0, 5.0), (4.0, 7.0), (5.0, np.nan)])
    found = ClusterMeans(2)
    clusters = np.array([0, 0, 1, 2, 3])
    found.add(values, clusters, clusters)
    first, second = found.estimates()
    assert (first.value, first.n, first.clusters) == (np.mean([1.5, 3.0, 4.0, 5.0]), 5, 4)
    assert (second.value, second.n, second.clusters) == (6.0, 2, 2)


@pytest.mark.parametrize('blocks', [1, 4])
def test_crossed_clusters_are_those_of_a_regression(blocks: int) -> None:
    """
    Of values on a constant: V = V(scenarios) + V(participants) - V(both), each by its sandwich.

    In a balanced table the mean of the scenarios' means is that of the regression.
    """
    random = np.random.default_rng(19)
    scenarios, participants = (each.reshape(-1) for each in np.mgrid[:6, :9])
    values = random.normal(0.0, 1.0, 6)[scenarios] + random.normal(0.3, 1.0, 9)[participants] \
        + random.normal(0.0, 1.0, 54)
    residuals = np.diag(values - values.mean())

    def sandwich(clusters: NDArray[np.int64]) -> float:
        within = np.equal.outer(clusters, clusters)
        count = len(np.unique(clusters))
        return float(count / (count - 1) * (residuals @ within @ residuals).sum() / 54 ** 2)
    error = np.sqrt(sandwich(scenarios) + sandwich(participants) - sandwich(np.arange(54)))
    low, high = stats.t(df=5, loc=values.mean(), scale=error).interval(0.95)
    found = _estimate(values, scenarios, blocks, participants)
    assert (found.value, found.low, found.high) == pytest.approx((values.mean(), low, high))
    assert (found.n, found.clusters) == (54, 6)
    assert found.p == pytest.approx(2.0 * stats.t.sf(abs(values.mean()) / error, 5))


def test_without_participants_in_common_scenarios_alone_count() -> None:
    """Each cell of a participant of its own, or of none, leaves the interval of the scenarios."""
    random = np.random.default_rng(23)
    scenarios = np.repeat(np.arange(1, 6), 4)
    values = random.normal(0.0, 1.0, 5)[scenarios - 1] + random.normal(0.0, 1.0, 20)
    none = CellClusters(scenarios, np.zeros(20, np.int64), np.arange(20, dtype=np.uint64))
    alone = _estimate(values, *none.crossed('scenarios')[:1])
    crossed = none.crossed('scenarios and participants')
    assert _estimate(values, crossed[0], 1, crossed[1]) == alone
    one = np.where(np.arange(20) < 1, 1, 0)
    crossed = none._replace(participants=one).crossed('scenarios and participants')
    assert _estimate(values, crossed[0], 1, crossed[1]).p == pytest.approx(alone.p, abs=0.2)


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


def alarms(random: np.random.Generator, scenarios: int, draw: str, participants: int = 0,
           measures: int = 15) -> bool:
    """
    Compare two equals in so many scenarios; return whether any measure is told apart.

    :param participants: each drives in two of three scenarios; 0 for one to eight cells without
        participants in a scenario.
    """
    if participants:
        clusters, crossed = np.nonzero(random.random((scenarios, participants)) < 2.0 / 3.0)
    else:
        clusters = crossed = np.repeat(np.arange(scenarios), random.integers(1, 9, scenarios))

    def drawn(*shape: int) -> Array:
        if draw == 'heavy tails':
            return random.standard_t(3.0, shape)
        # The difference of two skewed values; and of events that happen now and then.
        return np.subtract(*random.lognormal(0.0, 1.0, (2, *shape))) if draw == 'skewed' \
            else np.subtract(*(random.random((2, *shape)) < 0.2).astype(float))
    found = ClusterMeans(measures)
    values = drawn(scenarios, measures)[clusters] + drawn(len(clusters), measures)
    if participants:
        values += drawn(participants, measures)[crossed]
    found.add(values, clusters, crossed)
    return any(each.beyond_chance for each in holm(found.estimates()))


@pytest.mark.matrix('0-events', '8-events')
@pytest.mark.parametrize('draw', ['heavy tails', 'skewed', 'events'])
@pytest.mark.parametrize('participants', [0, 4, 8, 20])
def test_equals_are_seldom_told_apart(draw: str, participants: int) -> None:
    """By any of 15 measures, in 300 comparisons of 3 to 50 scenarios: seldom beyond 5 %."""
    random = np.random.default_rng(11)
    found = sum(alarms(random, scenarios, draw, participants)
                for scenarios in (3, 5, 6, 10, 20, 50) for _ in range(50))
    # Of 300 with a probability of 5 % more than 25 are found in one of 500 trials.
    assert found <= 25
