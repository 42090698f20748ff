# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The boundary between variants that pass and those that fail, and the probability to fail."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
import warnings

from crgame_ros.errors import InputError
from crgame_ros.search.settings import SearchSettings
from crgame_ros.search.trials import Outcome, Trials
from crgame_ros.variation.space import Variant, VariantSpace
import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.stats import qmc

Array = NDArray[np.float64]
# Candidates for the next runs, of which those nearest to the boundary are run.
_POOL = 2048
# Variants that are chosen with one model, at least: to learn it takes as long as some runs.
_TOGETHER = 16
# The model learns from so many runs at most: its cost grows with their cube.
_MOST = 400
# Candidates of one batch are at least so far apart, in the unit cube.
_APART = 0.05
# Variants among which the sample is drawn: their mean is that of the distributions.
POOL = 1 << 14
# Share of the proposal that is the stated distribution itself, so that no weight exceeds 1/share,
# wherever the model is wrong (defensive importance sampling, Hesterberg 1995).
DEFENSIVE = 0.3
# 95 %, two-sided.
_Z = 1.959964


class Boundary:
    """
    A Gaussian-process classifier of failing and passing variants.

    :param outcomes: of variants that could be run; some fail, and some do not.
    """

    def __init__(self, space: VariantSpace, outcomes: Sequence[Outcome]) -> None:
        from sklearn.gaussian_process import GaussianProcessClassifier
        from sklearn.gaussian_process.kernels import ConstantKernel, Matern
        self._space = space
        rows = features(space, [outcome.variant for outcome in outcomes])
        fails = np.array([outcome.is_failure for outcome in outcomes])
        chosen = _nearest_to_boundary(rows, fails)
        kernel = ConstantKernel(10.0, (1e-1, 1e4)) * Matern(
            np.full(rows.shape[1], 0.3), (3e-2, 1e2), nu=2.5)
        self._model = GaussianProcessClassifier(kernel, random_state=0)
        with warnings.catch_warnings():
            # A length scale at its bound: a dimension without effect.
            warnings.simplefilter('ignore')
            self._model.fit(rows[chosen], fails[chosen])

    def probabilities(self, variants: Sequence[Variant]) -> Array:
        """Return the probability (N) that each of some variants fails."""
        return self._model.predict_proba(features(self._space, variants))[:, 1]


def _nearest_to_boundary(rows: Array, fails: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the rows to learn from: of too many, those with one of the other kind nearby."""
    if len(rows) <= _MOST:
        return np.arange(len(rows))
    distances = np.empty(len(rows))
    for kind in (True, False):
        own, other = rows[fails == kind], rows[fails != kind]
        distances[fails == kind] = np.array([
            np.min(np.linalg.norm(other - row, axis=1)) for row in own])
    # Half of each kind, so that a rare one is not lost; the rest is spread over what is far.
    near: list[int] = []
    for kind in (True, False):
        places = np.flatnonzero(fails == kind)
        near += places[np.argsort(distances[places], kind='stable')][:_MOST // 2].tolist()
    return np.array(sorted(near), dtype=np.intp)


def can_learn(outcomes: Sequence[Outcome]) -> bool:
    """Return whether outcomes have failing and passing variants."""
    return len({outcome.is_failure for outcome in outcomes}) == 2


def refine_boundary(space: VariantSpace, trials: Trials, settings: SearchSettings,
                    runs: int) -> None:
    """Run variants near the boundary, where the model is least certain."""
    end = len(trials.outcomes) + runs
    turn = 0
    while (count := min(max(_TOGETHER, settings.batch), end - len(trials.outcomes))) > 0 \
            and can_learn(trials.known):
        turn += 1
        pool = pool_of(space, _POOL, settings.seed + turn)
        before = len(trials.outcomes)
        model = Boundary(space, trials.known)
        trials.run(_uncertain(space, model.probabilities(pool), pool, count))
        if len(trials.outcomes) == before:
            break


def _uncertain(space: VariantSpace, probabilities: Array, pool: Sequence[Variant],
               count: int) -> list[Variant]:
    """Return the variants whose outcome is least certain, and which are not side by side."""
    rows = features(space, pool)
    chosen: list[int] = []
    order = np.argsort(np.abs(probabilities - 0.5), kind='stable')
    for apart in (_APART, 0.0):
        for place in order:
            if len(chosen) == count:
                break
            if place not in chosen and all(
                    np.linalg.norm(rows[place] - rows[other]) > apart for other in chosen):
                chosen.append(int(place))
    return [pool[place] for place in chosen]


def features(space: VariantSpace, variants: Sequence[Variant]) -> Array:
    """
    Return the points of variants as rows (N, F); a dimension of names has a column for each.

    :return: numbers from 0 to 1.
    """
    columns = []
    for axis in space.axes:
        if axis.is_numeric:
            columns.append([axis.share(variant[axis.name]) for variant in variants])
        else:
            columns += [[float(variant[axis.name] == value) for variant in variants]
                        for value in axis.spec.values]
    return np.array(columns, dtype=float).T.reshape(len(variants), -1)


def pool_of(space: VariantSpace, number: int, seed: int) -> list[dict[str, object]]:
    """
    Return variants that fill the space evenly, by its distributions.

    :param number: of points drawn, a power of two; those that break a constraint are left out.
    :param seed: of a scrambled Sobol sequence.
    :raises InputError: if all of them do.
    """
    points = qmc.Sobol(len(space.axes), rng=seed).random(number)
    pool = [variant for variant in map(space.variant, points) if space.is_allowed(variant)]
    if not pool:
        raise InputError(f'none of {number} points keeps the constraints', 'vary', 'loosen them')
    return pool


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
