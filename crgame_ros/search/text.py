# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a search found, in words and as data."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
import json

from crgame_ros.evaluation.variants_page import VariantPoint, Verdict
from crgame_ros.search.boundary import pool_of
from crgame_ros.search.search import SearchResult
from crgame_ros.search.trials import Outcome
from crgame_ros.variation.space import Variant, VariantSpace

# Of a slice through the boundary, in each direction.
_GRID = 24
# For a line through the boundary.
_POINTS = 401


def changes(space: VariantSpace, variant: Variant) -> str:
    """Return what a variant changes in the game, in words."""
    changed = [f'{name} {space.nominal[name]} → {variant[name]}' for name in space.names
               if variant[name] != space.nominal[name]]
    return ', '.join(changed) or 'nothing'


def lines(result: SearchResult) -> Iterator[str]:
    """Yield what was found, a line each."""
    failures, outcomes = result.failures, result.outcomes
    excused = [outcome for outcome in outcomes if outcome.excused]
    unknown = [outcome for outcome in outcomes if not outcome.is_known]
    yield f'{len(outcomes)} runs ({", ".join(f"{name} {runs}" for name, runs in result.phases)})'
    yield f'{len(failures)} failures' + (
        f'; the first in run {min(outcome.number for outcome in failures) + 1}'
        if failures else '')
    if excused:
        kinds = sorted({outcome.excused for outcome in excused})
        yield f'{len(excused)} more of which no AV can be blamed ({", ".join(kinds)})'
    if unknown:
        yield f'{len(unknown)} could not be run, such as: {unknown[0].reason}'
    for place, goal in enumerate(result.settings.goals):
        found = [(goal.sign * value, outcome) for outcome in outcomes
                 if (value := outcome.values[place]) is not None and not outcome.excused]
        if found:
            value, outcome = min(found, key=lambda pair: (pair[0], pair[1].number))
            yield f'{goal.told}: {goal.sign * value:.4g} ({values_text(outcome.variant)})'
    if len(result.settings.goals) > 1:
        front = worst_compromises(result)
        shown = '; '.join(values_text(outcome.variant) for outcome in front[:3])
        yield (f'{len(front)} on the Pareto front, where no other variant is as bad in all and '
               f'worse in one: {shown}{" …" if len(front) > 3 else ""}')
    if result.smallest is not None:
        yield f'smallest change that fails: {changes(result.space, result.smallest.variant)}'
    if result.boundary is not None:
        yield from _thresholds(result)
    estimate = result.probability
    if estimate is not None:
        yield (f'probability of a failure: {_share(estimate.value)} '
               f'(95 % interval {_share(estimate.low)} to {_share(estimate.high)}; '
               f'{estimate.runs} runs, {estimate.failures} of them failed)')


def worst_compromises(result: SearchResult) -> list[Outcome]:
    """Return the variants of which no other is as bad in all goals and worse in one (Pareto)."""
    signs = [goal.sign for goal in result.settings.goals]
    rated = [(tuple(sign * value for sign, value in zip(signs, outcome.values, strict=True)
                    if value is not None), outcome)
             for outcome in result.outcomes if None not in outcome.values and not outcome.excused]
    return [outcome for values, outcome in rated if not any(
        other != values and all(a <= b for a, b in zip(other, values, strict=True))
        for other, _ in rated)]


def _share(value: float) -> str:
    return f'{100.0 * value:.3g} %'


def values_text(variant: Variant) -> str:
    """Return the values of a variant for people."""
    return ', '.join(f'{name} {value}' for name, value in variant.items())


def _thresholds(result: SearchResult) -> Iterator[str]:
    """Yield for each dimension where the boundary is, if all else is as in the game."""
    assert result.boundary is not None
    for axis in result.space.axes:
        if axis.spec.values:
            continue
        values = [axis.value(index / (_POINTS - 1)) for index in range(_POINTS)]
        fails = result.boundary.probabilities(
            [result.space.nominal | {axis.name: value} for value in values]) > 0.5
        at = [values[place] for place in range(1, _POINTS) if fails[place] != fails[place - 1]]
        if at:
            sense = 'below' if fails[0] else 'above'
            yield f'alone, {axis.name} fails {sense} about ' + ', '.join(f'{x:.3g}' for x in at)


def points(result: SearchResult) -> list[VariantPoint]:
    """Return all variants with the verdicts on them."""
    return [VariantPoint(
        outcome.key, outcome.variant, outcome.values, _verdict(outcome),
        outcome.excused or '; '.join(outcome.broken) or outcome.reason)
        for outcome in result.outcomes]


def _verdict(outcome: Outcome) -> Verdict:
    if not outcome.is_known:
        return 'unknown'
    return 'failure' if outcome.is_failure else 'excused' if outcome.excused else 'pass'


def results_text(result: SearchResult, found: Sequence[str]) -> str:
    """
    Return what was found as JSON.

    :param found: the same in words, as `lines` yields it.
    """
    return json.dumps({
        'game': result.settings.game, 'planner': result.settings.planner or 'own',
        'goals': [asdict(goal) for goal in result.settings.goals],
        'expectations': [each.told() for each in result.expectations],
        'lines': list(found), 'nominal': result.space.nominal,
        'outcomes': [asdict(point) for point in points(result)],
        'probability': None if result.probability is None else asdict(result.probability),
        'smallest': None if result.smallest is None else result.smallest.key},
        ensure_ascii=False, allow_nan=False) + '\n'


def boundary_slices(result: SearchResult) -> Iterator[dict[str, object]]:
    """Yield the boundary's probabilities over each pair of ranges, averaged over all others."""
    if result.boundary is None:
        return
    space = result.space
    ranges = [axis for axis in space.axes if not axis.spec.values]
    others = pool_of(space, 16, result.settings.seed)
    for first, x in enumerate(ranges):
        for y in ranges[first + 1:]:
            shares = [(index + 0.5) / _GRID for index in range(_GRID)]
            variants = [dict(other) | {x.name: x.value(a), y.name: y.value(b)}
                        for b in shares for a in shares for other in others]
            found = result.boundary.probabilities(variants).reshape(_GRID, _GRID, len(others))
            yield {'x': x.name, 'y': y.name,
                   'probabilities': found.mean(axis=2).round(3).tolist()}
