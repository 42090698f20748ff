# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The smallest change of a game as it is with which a planner fails."""

from collections.abc import Sequence

from crgame_ros.search.settings import SearchSettings
from crgame_ros.search.trials import Outcome, Trials
from crgame_ros.variation.space import Variant, VariantSpace
import numpy as np

# Points between two variants that are run together: the interval shrinks by one more than these.
_BETWEEN = 3
# Failures that are nearest to the game as it is, from which lines are drawn to it.
_STARTS = 3


def shrink(space: VariantSpace, trials: Trials, settings: SearchSettings,
           runs: int) -> Outcome | None:
    """
    Search for the failure that is nearest to the game as it is.

    From the nearest failures that are known: single values are put back while it still fails, then
    the line to the game as it is is halved, then the neighbourhood is tried.

    :param runs: number of runs.
    :return: the nearest failure that is known; None without failures, or where the game as it is
        fails.
    """
    end = len(trials.outcomes) + runs
    if not trials.failures:
        return None
    for start in _nearest(space, trials)[:_STARTS]:
        best = _put_back(space, trials, start, end)
        _along_line(space, trials, best, end)
    rng = np.random.default_rng(settings.seed)
    while len(trials.outcomes) < end:
        before = len(trials.outcomes)
        best = _nearest(space, trials)[0]
        _around(space, trials, best, rng, end)
        if len(trials.outcomes) == before:
            break
    return _nearest(space, trials)[0]


def _nearest(space: VariantSpace, trials: Trials) -> list[Outcome]:
    return sorted(trials.failures, key=lambda outcome: (
        space.distance(outcome.variant, space.nominal), outcome.number))


def _run(space: VariantSpace, trials: Trials, variants: Sequence[Variant],
         end: int) -> list[Outcome]:
    left = max(0, end - len(trials.outcomes))
    return trials.run([variant for variant in variants if space.is_allowed(variant)][:left])


def _put_back(space: VariantSpace, trials: Trials, best: Outcome, end: int) -> Outcome:
    """Put single values back to those of the game, as long as it still fails."""
    while True:
        changed = [name for name in space.names if best.variant[name] != space.nominal[name]]
        tried = _run(space, trials, [dict(best.variant) | {name: space.nominal[name]}
                                     for name in changed], end)
        better = [outcome for outcome in tried if outcome.is_failure]
        if not better:
            return best
        best = min(better, key=lambda outcome: space.distance(outcome.variant, space.nominal))


def _along_line(space: VariantSpace, trials: Trials, best: Outcome, end: int) -> None:
    """Halve the line from a failure to the game as it is, until both ends are side by side."""
    failing, passing = space.point(best.variant), space.point(space.nominal)
    names = [axis.is_numeric for axis in space.axes]
    while len(trials.outcomes) < end and np.max(np.abs(failing - passing)) > 1e-3:
        shares = [(index + 1) / (_BETWEEN + 1) for index in range(_BETWEEN)]
        points = [np.where(names, failing + share * (passing - failing), failing)
                  for share in shares]
        tried = _run(space, trials, [space.variant(point) for point in points], end)
        before = (failing, passing)
        for point, outcome in zip(points, tried, strict=False):
            if outcome.is_failure:
                failing = point
            else:
                passing = point
                break
        if before[0] is failing and before[1] is passing:
            return


def _around(space: VariantSpace, trials: Trials, best: Outcome, rng: np.random.Generator,
            end: int) -> None:
    """Try points that are nearer to the game as it is, near the line to the best one."""
    middle, nominal = space.point(best.variant), space.point(space.nominal)
    size = float(np.linalg.norm(middle - nominal))
    points = middle + 0.1 * size * rng.standard_normal((64, len(middle)))
    variants = [space.variant(point) for point in points.clip(0.0, 1.0)]
    reach = space.distance(best.variant, space.nominal)
    nearer = [variant for variant in variants if space.distance(variant, space.nominal) < reach]
    _run(space, trials, nearer[:8], end)
