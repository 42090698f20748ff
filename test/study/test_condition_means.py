# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Means of conditions: their intervals against scipy's tests and hand-computed numbers."""

import math
import re

from crgame_ros.study.analysis.planned_tests import participant_means
from crgame_ros.study.data.condition_section import condition_means, condition_svg, within_halves
import numpy as np
import pytest
from scipy import stats

RNG = np.random.default_rng(7)


def values_of(table: np.ndarray, names: str) -> dict[tuple[str, str], float]:
    """Name the rows of a table after people and its columns after conditions."""
    return {(f'P{row:02}', name): float(table[row, place])
            for row in range(len(table)) for place, name in enumerate(names)}


def test_of_two_conditions_the_interval_is_that_of_the_paired_test() -> None:
    # The corrected interval of two conditions is 1/sqrt(2) of that of their difference.
    table = RNG.normal(size=(9, 1)) * 20.0 + RNG.normal(size=(9, 2)) + (0.0, 1.0)
    interval = stats.ttest_rel(table[:, 0], table[:, 1]).confidence_interval(0.95)
    half = (interval.high - interval.low) / 2.0
    assert within_halves(table) == pytest.approx([half / math.sqrt(2.0)] * 2, rel=1e-9)


def test_of_several_conditions_it_is_the_error_of_the_analysis_of_variance() -> None:
    # The mean of the normed variances, corrected, is the mean square of the error of a
    # repeated-measures analysis of variance (Morey 2008).
    table = RNG.normal(size=(12, 1)) * 5.0 + RNG.normal(size=(12, 4))
    people, conditions = table.shape
    residual = table - table.mean(axis=1, keepdims=True) - table.mean(axis=0) + table.mean()
    error = (residual ** 2).sum() / ((people - 1) * (conditions - 1))
    t = stats.t.ppf(0.975, people - 1)
    found = (within_halves(table) / t) ** 2 * people
    assert found.mean() == pytest.approx(error, rel=1e-9)


def test_numbers_worked_out_by_hand() -> None:
    table = np.array([[1.0, 3.0], [4.0, 5.0], [2.0, 6.0]])
    # People's means 2, 4.5, 4; grand mean 3.5: first column 2.5, 3, 1.5, of variance 7/12.
    half = 4.302652729749464 * math.sqrt(2.0 * (7.0 / 12.0) / 3.0)
    assert within_halves(table) == pytest.approx([half, half], rel=1e-9)


def test_a_person_without_a_condition_is_left_out_of_all() -> None:
    table = RNG.normal(size=(6, 3))
    values = values_of(table, 'abc')
    del values['P02', 'b']
    values['P04', 'c'] = math.inf
    found = condition_means(values, ('a', 'b', 'c'))
    whole = np.delete(table, (2, 4), axis=0)
    assert found.within and found.used == ('P00', 'P01', 'P03', 'P05')
    assert [each.mean for each in found.conditions] == pytest.approx(whole.mean(axis=0).tolist())
    assert [each.half for each in found.conditions] == pytest.approx(within_halves(whole).tolist())
    # Their points are shown nevertheless.
    assert set(found.conditions[0].points) == {f'P{row:02}' for row in range(6)}


def test_between_people_each_condition_has_its_own_interval() -> None:
    group = RNG.normal(size=8)
    values = {(f'P{row}', 'a' if row < 5 else 'b'): float(group[row]) for row in range(8)}
    found = condition_means(values, ('a', 'b'))
    assert not found.within and found.used == ()
    for each, own in zip(found.conditions, (group[:5], group[5:]), strict=True):
        interval = stats.ttest_1samp(own, 0.0).confidence_interval(0.95)
        assert each.mean == pytest.approx(own.mean())
        assert (each.mean - each.half, each.mean + each.half) == pytest.approx(
            (interval.low, interval.high), rel=1e-9)


def test_with_few_values_there_is_no_interval() -> None:
    alone = condition_means({('P1', 'a'): 2.0}, ('a', 'b'))
    assert alone.conditions[0].mean == 2.0 and math.isnan(alone.conditions[0].half)
    assert math.isnan(alone.conditions[1].mean)
    picture = condition_svg(alone.conditions, 'speed', 2)
    assert 'NaN' not in picture and 'nan' not in picture


def test_no_interval_is_drawn_beyond_its_scale() -> None:
    """Two people on a scale from 1 to 7 have Student's interval of 12.7 times the error."""
    means = condition_means({('P1', 'a'): 4.0, ('P2', 'a'): 6.0}, ('a',)).conditions
    assert means[0].mean + means[0].half == pytest.approx(5.0 + 12.706, abs=1e-3)

    def labels(picture: str) -> set[str]:
        return set(re.findall(r'<text class="tick"[^>]*>([^<]*)<', picture))

    drawn = labels(condition_svg(means, 'score', 2, (1.0, 7.0)))
    assert {float(text.replace('−', '-')) for text in drawn} <= set(range(9))
    assert '20' in labels(condition_svg(means, 'score', 2))


def test_repetitions_are_taken_together_first() -> None:
    rows = [{'participant': 'P1', 'condition': 'a', 'x': 1.0},
            {'participant': 'P1', 'condition': 'a', 'x': 3.0},
            {'participant': 'P1', 'condition': 'a', 'x': None},
            {'participant': 'P2', 'condition': 'a', 'x': math.inf}]
    assert participant_means(rows, 'x') == {('P1', 'a'): 2.0}
