# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The power of a plan: against the noncentral t distribution."""

import math
from pathlib import Path
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.schema.reading import read
from crgame_ros.study.analysis.power import measure_models, power_lines, power_of, smallest
from crgame_ros.study.file import StudyFile
import numpy as np
import pytest
from scipy import stats

RUNS = 600


def study_of(*comparisons: dict[str, Any], repetitions: int = 2, **analysis: Any) -> StudyFile:
    """Return a study with two crossed factors."""
    return read(StudyFile, {
        'name': 'power', 'factors': [
            {'name': 'load', 'levels': [{'name': 'none'}, {'name': 'high'}]},
            {'name': 'scene', 'levels': [{'name': 'a'}, {'name': 'b'}, {'name': 'c'}]}],
        'blocks': [{'name': 'main', 'repetitions': repetitions}],
        'analysis': {'comparisons': list(comparisons)} | analysis}, 'study', Path())


def closed_form(d_z: float, count: int, alpha: float = 0.05) -> float:
    """Return the power of the two-sided paired t-test."""
    bound, shift = stats.t.ppf(1 - alpha / 2, count - 1), d_z * math.sqrt(count)
    return float(stats.nct.sf(bound, count - 1, shift) + stats.nct.cdf(-bound, count - 1, shift))


@pytest.mark.parametrize(('keys', 'd_z'), [
    ({'effect': 0.8}, 0.8), ({'effect': -3.0, 'sd': 5.0}, -0.6),
    # Six trials in each level: the variance of a mean is a sixth of that of a trial.
    ({'effect': 1.0, 'sd': 2.0, 'sd_of': 'trial'}, 0.5 / math.sqrt(2.0 / 6.0))])
def test_it_is_that_of_the_closed_form(keys: dict[str, Any], d_z: float) -> None:
    study = study_of({'measure': 'speed', 'factor': 'load'} | keys)
    for [power] in power_of(study, (8, 14), RUNS, 1):
        wanted = closed_form(d_z, power.participants)
        error = math.sqrt(wanted * (1.0 - wanted) / RUNS)
        assert power.found == pytest.approx(wanted, abs=3.0 * error)
        assert power.low < power.found < power.high


def test_a_family_of_tests_costs_power_and_equal_seeds_give_equal_numbers() -> None:
    alone = {'measure': 'speed', 'factor': 'load', 'effect': 0.8}
    others = [{'measure': f'other_{n}', 'factor': 'load'} for n in range(5)]
    found = {family: [power for [power] in power_of(study_of(
        alone, *others, family=family, repetitions=1), (12,), 300, 3)][0]
        for family in ('analysis', 'comparison')}
    assert found['analysis'].found < found['comparison'].found - 0.1
    again = [list(power_of(study_of(alone, repetitions=1), (6, 20), 50, 4)) for _ in range(2)]
    assert again[0] == again[1]
    assert smallest(again[0]) == 20
    assert list(power_lines(again[0], 50))[-1].endswith(
        '20 participants are the fewest of these with a power of 0.8 in every test.')
    # Without an effect the tests are significant as often as alpha says, at most.
    null = {'measure': 'speed', 'factor': 'scene', 'contrast': ['a', 'c'], 'effect': 0.0}
    [[power]] = power_of(study_of(null), (10,), RUNS, 5)
    assert power.found == pytest.approx(0.05, abs=3.0 * np.sqrt(0.05 * 0.95 / RUNS))


def test_plans_without_an_effect_or_with_two_deviations_are_refused() -> None:
    with pytest.raises(InputError, match='states no effect'):
        next(power_of(study_of({'measure': 'speed', 'factor': 'load'}), (8,), 10, 0))
    with pytest.raises(InputError, match='another standard deviation'):
        next(power_of(study_of(
            {'measure': 'speed', 'factor': 'load', 'effect': 1.0, 'sd': 2.0},
            {'measure': 'speed', 'factor': 'scene', 'contrast': ['a', 'b'], 'effect': 1.0,
             'sd': 9.0}), (8,), 10, 0))


def contrast(*levels: str, effect: float = 1.0, **keys: Any) -> dict[str, Any]:
    """Return a comparison of two scenes, in the unit of the measure."""
    return {'measure': 'speed', 'factor': 'scene', 'contrast': levels, 'effect': effect,
            'sd': 2.0, **keys}


def test_contrasts_add_up_in_a_row() -> None:
    study = study_of(contrast('a', 'b'), contrast('b', 'c', effect=2.0))
    assert measure_models(study)['speed'].effects == {('scene', 'b'): 1.0, ('scene', 'c'): 3.0}
    for second in (contrast('c', 'b'), contrast('b', 'a'), contrast('a', 'b', effect=2.0)):
        with pytest.raises(InputError, match=r'comparisons\[1\]: effect: states the effect of'):
            measure_models(study_of(contrast('a', 'b'), second))


def test_tests_that_differ_in_their_alternative_alone_are_two() -> None:
    study = study_of(contrast('a', 'b', effect=9.0), contrast(
        'a', 'b', effect=9.0, alternative='greater'))
    assert measure_models(study)['speed'].effects == {('scene', 'b'): 9.0}
    [powers] = power_of(study, (8,), 20, 1)
    assert [(power.name, power.found) for power in powers] == [
        ('speed, scene: b - a', 1.0), ('speed, scene: b - a > 0', 1.0)]
