# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The boundary between the variants that a planner passes and those that it fails."""

from collections.abc import Sequence
import warnings

from crgame_ros.search.features import features, pool_of
from crgame_ros.search.settings import SearchSettings
from crgame_ros.search.trials import Outcome, Trials
from crgame_ros.variation.space import Variant, VariantSpace
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Candidates for the next runs, of which those nearest to the boundary are run.
_POOL = 2048
# Variants that are chosen with one model, at least: to learn it takes as long as some runs.
_TOGETHER = 16
# The model learns from so many runs at most: its cost grows with their cube.
_MOST = 400
# Candidates of one batch are at least so far apart, in the unit cube.
_APART = 0.05
# A variant in this range of probabilities is uncertain.
UNCERTAIN = (0.05, 0.95)


class Boundary:
    """
    A Gaussian-process classifier of failing and passing variants.

    :param space: of the variants.
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
        found: Array = self._model.predict_proba(features(self._space, variants))[:, 1]
        return found


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
    """
    Run variants near the boundary, where the model is least certain.

    :param runs: number of runs.
    """
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
