# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Planned comparisons: against scipy, R's results of known data, and numbers by hand."""

from collections.abc import Iterator, Mapping
import math
from pathlib import Path
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.schema.reading import read
from crgame_ros.study.analysis.mixed_model import fit_model, model_formulas
from crgame_ros.study.analysis.planned_tests import holm, paired_test, planned_tests
from crgame_ros.study.file import StudyFile
import numpy as np
import pytest
from scipy import stats

# Hours of additional sleep of ten patients with two drugs (Student 1908; `sleep` in R).
SLEEP = {'a': (0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0),
         'b': (1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4)}
# Effort to arise from four stools, of nine people (`ergoStool` in R's nlme).
STOOLS = {'T1': (12, 10, 7, 7, 8, 9, 8, 7, 9), 'T2': (15, 14, 14, 11, 11, 11, 12, 11, 13),
          'T3': (12, 13, 13, 10, 8, 11, 12, 8, 10), 'T4': (10, 12, 9, 9, 7, 10, 11, 7, 8)}


def study_of(levels: list[str], **analysis: Any) -> StudyFile:
    """Return a study with one factor."""
    return read(StudyFile, {
        'name': 'known', 'factors': [{'name': 'what', 'levels': [{'name': n} for n in levels]}],
        'blocks': [{'name': 'main'}], 'analysis': analysis}, 'study', Path())


def rows_of(values: Mapping[str, tuple[float, ...]]) -> list[dict[str, Any]]:
    """Return the rows of the table of trials."""
    def rows() -> Iterator[dict[str, Any]]:
        for level, column in values.items():
            for person, value in enumerate(column):
                yield {'participant': f'P{person}', 'block': 'main', 'what': level,
                       'effort': float(value)}
    return list(rows())


def test_the_test_of_known_data_is_that_of_r_and_scipy() -> None:
    first, second = (np.array(SLEEP[name]) for name in 'ab')
    found = paired_test(first, second, 'two-sided', 0.05)
    # t.test(extra ~ group, sleep, paired = TRUE): the difference in R is first less second.
    assert (found.t, found.p) == pytest.approx((4.0621, 0.002833), abs=5e-5)
    assert (found.low, found.high) == pytest.approx((0.7001142, 2.4598858), abs=1e-7)
    for alternative in ('two-sided', 'less', 'greater'):
        mine = paired_test(first, second, alternative, 0.1)
        assert mine.p == pytest.approx(stats.ttest_rel(second, first,
                                                       alternative=alternative).pvalue)
        interval = stats.ttest_rel(second, first).confidence_interval(0.9)
        assert (mine.low, mine.high) == pytest.approx(tuple(interval))
    # d_z is t over the root of n; the corrected effect size by Lakens (2013), n - 1 = 9.
    assert found.d_z == pytest.approx(4.062128 / math.sqrt(10.0), rel=1e-6)
    assert found.d_av == pytest.approx(1.58 / ((1.789010 + 2.002249) / 2.0), rel=1e-6)
    assert found.g_av == pytest.approx(found.d_av * (1.0 - 3.0 / 35.0))


def test_holm_is_as_by_hand_and_keeps_gaps() -> None:
    # p.adjust(c(0.01, 0.04, 0.03, 0.005), 'holm') in R.
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([math.nan, 0.02])[1] == pytest.approx(0.04)


def test_all_pairs_or_the_contrast_are_compared_over_participants_with_both() -> None:
    study = study_of(list(STOOLS), comparisons=[{'measure': 'effort', 'factor': 'what'}])
    rows = rows_of(STOOLS)
    found = planned_tests(study, rows, {'what': 'what'})
    assert [each.pair for each in found] == [
        ('T1', 'T2'), ('T1', 'T3'), ('T1', 'T4'), ('T2', 'T3'), ('T2', 'T4'), ('T3', 'T4')]
    assert [each.p_holm for each in found] == pytest.approx(holm([
        stats.ttest_rel(STOOLS[a], STOOLS[b]).pvalue for a, b in (x.pair for x in found)]))
    # Without a participant's value in T2, and with a flagged trial of another one.
    rows = [row | {'timing_flag': row['participant'] == 'P1'} for row in rows
            if (row['participant'], row['what']) != ('P0', 'T2')]
    for flagged, count in (('use', 8), ('leave_out', 7)):
        study = study_of(list(STOOLS), flagged=flagged, comparisons=[
            {'measure': 'effort', 'factor': 'what', 'contrast': ['T1', 'T2']}])
        [only] = planned_tests(study, rows, {'what': 'what'})
        assert only.test.participants == count and only.p_holm == only.test.p


def test_the_mixed_model_is_that_of_pinheiro_and_bates() -> None:
    pytest.importorskip('statsmodels')
    study = study_of(list(STOOLS), comparisons=[{'measure': 'effort', 'factor': 'what'}])
    [formula] = model_formulas(study)
    assert formula.text({'what': 'what'}) == 'effort ~ what + (1 | participant)'
    model = fit_model(formula, rows_of(STOOLS), {'what': 'what'})
    # Mixed-Effects Models in S and S-PLUS (2000), section 1.2, with treatment contrasts, REML.
    assert [each.value for each in model.effects] == pytest.approx(
        [8.555556, 3.888889, 2.222222, 0.666667], abs=1e-6)
    assert [each.error for each in model.effects] == pytest.approx(
        [0.5760123, 0.5186838, 0.5186838, 0.5186838], abs=2e-4)
    assert (model.participant_sd, model.residual_sd) == pytest.approx(
        (1.332465, 1.100295), abs=1e-3)
    assert not model.problem and (model.trials, model.participants) == (36, 9)


def test_a_model_that_cannot_be_had_says_so() -> None:
    pytest.importorskip('statsmodels')
    study = study_of(['a', 'b'], comparisons=[{'measure': 'effort', 'factor': 'what'}])
    [formula] = model_formulas(study)
    few = rows_of({'a': (1.0, 2.0)})
    assert fit_model(formula, few, {'what': 'what'}).problem == 'there are too few trials for it'
    # Without any difference between people their variance is at its bound.
    rng = np.random.default_rng(1)
    same = rows_of({level: tuple(rng.normal(size=12)) for level in 'ab'})
    same = [row | {'effort': row['effort'] - np.mean([
        other['effort'] for other in same if other['participant'] == row['participant']])}
        for row in same]
    assert 'converge' in fit_model(formula, same, {'what': 'what'}).problem


@pytest.mark.parametrize(('comparison', 'told'), [
    ({'factor': 'load'}, 'names the factor "load"'),
    ({'contrast': ['a', 'x']}, 'no level of what'), ({'contrast': ['a', 'a']}, 'with itself'),
    ({'effect': 0.5}, 'several pairs of levels'), ({'sd': 1.0}, '"sd" without "effect"')])
def test_a_comparison_that_does_not_fit_is_refused(comparison: dict[str, Any],
                                                   told: str) -> None:
    with pytest.raises(InputError, match=told):
        study_of(['a', 'b', 'c'], comparisons=[
            {'measure': 'effort', 'factor': 'what'} | comparison])
