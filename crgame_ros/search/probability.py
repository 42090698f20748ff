# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The probability that a planner fails, under the stated distributions."""

from dataclasses import dataclass
import math

from crgame_ros.search.boundary import Boundary, can_learn
from crgame_ros.search.features import pool_of
from crgame_ros.search.settings import SearchSettings
from crgame_ros.search.trials import Trials
from crgame_ros.variation.space import VariantSpace
import numpy as np
from numpy.typing import NDArray
from scipy import stats

# Variants among which the sample is drawn: their mean is that of the distributions.
POOL = 1 << 14
# Share of the proposal that is the stated distribution itself, so that no weight exceeds 1/share,
# wherever the model is wrong (defensive importance sampling, Hesterberg 1995).
DEFENSIVE = 0.3
# 95 %, two-sided.
_Z = 1.959964


@dataclass(frozen=True)
class FailureProbability:
    """
    An estimate.

    :param value: of the probability.
    :param low: lower bound of its 95 % interval.
    :param high: upper bound.
    :param runs: number of runs that it rests on.
    :param failures: how many of them failed.
    """

    value: float
    low: float
    high: float
    runs: int
    failures: int


def estimate(space: VariantSpace, trials: Trials, settings: SearchSettings,
             runs: int) -> FailureProbability | None:
    """
    Estimate the probability of a failure by importance sampling.

    Variants are drawn with replacement, more often where the boundary's model expects a failure,
    and weighted by how much more often that is. Runs of before count only in the model, so that
    the estimate is unbiased.

    :param runs: number of runs.
    :return: None without runs.
    """
    if runs <= 0 or trials.left <= 0:
        return None
    pool = pool_of(space, POOL, settings.seed + 7919)
    even = np.full(len(pool), 1.0 / len(pool))
    proposal = even
    if can_learn(trials.known):
        expected = Boundary(space, trials.known).probabilities(pool)
        # The deviation of an outcome is the square root of p: the proposal of least variance.
        expected = np.sqrt(np.maximum(expected, 1e-9))
        proposal = DEFENSIVE * even + (1.0 - DEFENSIVE) * expected / expected.sum()
    drawn = np.random.default_rng(settings.seed).choice(
        len(pool), min(runs, trials.left), p=proposal)
    outcomes = trials.run([pool[place] for place in drawn])
    used = [(outcome, float(even[place] / proposal[place]))
            for outcome, place in zip(outcomes, drawn, strict=False) if outcome.is_known]
    if not used:
        return None
    terms = np.array([weight * outcome.is_failure for outcome, weight in used])
    failures = sum(outcome.is_failure for outcome, _ in used)
    return importance_interval(terms, failures, max(weight for _, weight in used))


def importance_interval(terms: NDArray[np.float64], failures: int,
                        heaviest: float) -> FailureProbability:
    """
    Return the mean of weighted outcomes with its interval.

    Student's, of the terms; of no failure the exact bound.

    :param terms: (N) weight of each failure, 0 for others.
    :param failures: their number.
    :param heaviest: greatest weight that a failure could have.
    """
    count = len(terms)
    mean = float(terms.mean())
    if failures == 0:
        # The exact bound of a share of none, each of them worth the heaviest weight at most.
        high = heaviest * (1.0 - 0.05 ** (1.0 / count))
        return FailureProbability(0.0, 0.0, min(1.0, high), count, 0)
    if failures == count and heaviest == 1.0:
        return FailureProbability(1.0, 0.05 ** (1.0 / count), 1.0, count, failures)
    error = float(terms.std(ddof=1)) / math.sqrt(count) if count > 1 else math.inf
    half = float(stats.t.ppf(0.975, max(count - 1, 1))) * error if count < 1000 else _Z * error
    return FailureProbability(mean, max(0.0, mean - half), min(1.0, mean + half), count, failures)
