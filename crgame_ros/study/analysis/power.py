# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Computes the power of a study's planned tests by simulation of the whole plan."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from crgame_ros.errors import InputError
from crgame_ros.study.analysis.planned_tests import planned_tests
from crgame_ros.study.analysis.simulated_trials import (
    measure_models,
    planned_people,
    SimulatedTrials,
)
from crgame_ros.study.file import StudyFile
import numpy as np

# The power that a number of participants is to reach.
WANTED = 0.8


@dataclass(frozen=True)
class Power:
    """
    The power of a test with a number of participants.

    :param participants: their number.
    :param name: of the test: the measure, and the levels.
    :param effect: as the plan states it.
    :param found: share of the simulated studies in which the test was significant, after Holm's
        correction.
    :param low: end of Wilson's 95 % interval of this share.
    :param high: the other end.
    """

    participants: int
    name: str
    effect: str
    found: float
    low: float
    high: float


def power_of(study: StudyFile, counts: Sequence[int], runs: int, seed: int,
             progress: Callable[[float], object] = lambda _: None) -> Iterator[list[Power]]:
    """
    Yield the power of each test with a stated effect, for each number of participants.

    Comparisons without an effect are simulated without one: they are tests of the family.
    Equal arguments give equal results.

    :param counts: numbers of participants.
    :param runs: simulated studies for each.
    :param progress: called with the share that is done, 0 to 1.
    :raises InputError: if no comparison states an effect.
    """
    if all(each.effect is None for each in study.analysis.comparisons):
        raise InputError('states no effect', 'analysis: comparisons',
                         'give "effect" to at least one comparison')
    models = measure_models(study)
    columns = {factor.name: factor.name for factor in study.all_factors}
    alpha = study.analysis.alpha
    for place, count in enumerate(counts):
        trials = SimulatedTrials(study, planned_people(study, count), models)
        rng = np.random.default_rng((seed, count))
        hits: dict[tuple[str, str], int] = {}
        for run in range(runs):
            for each in planned_tests(study, trials.draw(rng), columns):
                if each.comparison.effect is not None:
                    first, second = each.pair
                    unit = 'sd of the participants in a group' \
                        if each.comparison.factor == study.between else 'sd of the differences'
                    unit = unit if each.comparison.sd is None \
                        else f"in the measure's unit, sd {each.comparison.sd:g}"
                    key = (f'{each.comparison.measure}, {each.comparison.factor}: '
                           f'{second} - {first}', f'{each.comparison.effect:g} {unit}')
                    hits[key] = hits.get(key, 0) + (each.p_holm < alpha)
            progress((place + (run + 1) / runs) / len(counts))
        yield [Power(count, name, effect, found / runs, *_interval(found, runs))
               for (name, effect), found in hits.items()]


def _interval(found: int, runs: int) -> tuple[float, float]:
    from scipy.stats import binomtest
    interval = binomtest(found, runs).proportion_ci(0.95, 'wilson')
    return float(interval.low), float(interval.high)


def smallest(powers: Sequence[Sequence[Power]]) -> int | None:
    """Return the least number of participants with which every test reaches `WANTED`, if any."""
    return min((each[0].participants for each in powers
                if each and min(power.found for power in each) >= WANTED), default=None)


def power_lines(powers: Sequence[Sequence[Power]], runs: int) -> Iterator[str]:
    """Yield the lines of a table of powers, and the smallest number of participants."""
    for number, power in enumerate(powers[0] if powers else ()):
        yield f'{power.name} ({power.effect})'
        yield f'{"participants":>14} {"power":>7}   95 % interval'
        for each in powers:
            of_test = each[number]
            yield f'{of_test.participants:>14} {of_test.found:>7.3f}   ' \
                f'[{of_test.low:.3f}; {of_test.high:.3f}]'
    found = smallest(powers)
    yield f'{runs} simulated studies for each number. ' + (
        f'None of these numbers reaches a power of {WANTED:g} in every test.' if found is None
        else f'{found} participants are the fewest of these with a power of {WANTED:g} in every '
        'test.')
