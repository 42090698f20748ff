# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Comparisons between groups: against scipy, R's results of known data, and the closed form."""

import math
from pathlib import Path
from typing import Any

from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.schema.reading import read
from crgame_ros.study.analysis.mixed_model import fit_model, model_formulas
from crgame_ros.study.analysis.planned_tests import unpaired_test
from crgame_ros.study.analysis.power import (
    measure_models,
    planned_people,
    power_lines,
    power_of,
    SimulatedTrials,
)
from crgame_ros.study.analysis.r_script import r_script
from crgame_ros.study.file import StudyFile
import numpy as np
import polars
import pytest
from scipy import stats

# Hours of additional sleep of ten patients with two drugs (Student 1908; `sleep` in R).
FIRST = np.array((0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0))
SECOND = np.array((1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4))
RUNS = 600
GROUPED = """
groups:
  name: display
  levels: [{name: bars}, {name: lights}]
  strata: [{field: age, cuts: [50]}]
exclude:
  - {when: {field: age, below: 30}}
analysis:
  comparisons:
    - {measure: mean_speed_m_per_s, factor: display, effect: 6, sd: 1}
    - {measure: mean_speed_m_per_s, factor: planner, effect: 4, sd: 1}
"""


def study_of(*comparisons: dict[str, Any], groups: int = 2, repetitions: int = 2) -> StudyFile:
    """Return a study with a factor within participants, and groups."""
    return read(StudyFile, {
        'name': 'grouped', 'groups': {'name': 'display', 'levels': [
            {'name': f'g{number}'} for number in range(groups)]},
        'factors': [{'name': 'load', 'levels': [{'name': 'none'}, {'name': 'high'}]}],
        'blocks': [{'name': 'main', 'repetitions': repetitions}],
        'analysis': {'comparisons': list(comparisons)}}, 'study', Path())


def closed_form(effect: float, counts: tuple[int, int], alpha: float = 0.05) -> float:
    """Return the power of the two-sided unpaired t-test with equal variances."""
    freedom = sum(counts) - 2
    bound = stats.t.ppf(1.0 - alpha / 2.0, freedom)
    shift = effect * math.sqrt(counts[0] * counts[1] / sum(counts))
    return float(stats.nct.sf(bound, freedom, shift) + stats.nct.cdf(-bound, freedom, shift))


def test_the_test_of_known_data_is_that_of_r_and_scipy() -> None:
    found = unpaired_test(FIRST, SECOND, 'two-sided', 0.05)
    # t.test(extra ~ group, sleep): Welch's; the difference in R is first less second.
    assert (found.t, found.freedom, found.p) == pytest.approx((1.8608, 17.776, 0.07939), abs=5e-4)
    assert (found.low, found.high) == pytest.approx((-0.2054832, 3.3654832), abs=1e-6)
    for alternative in ('two-sided', 'less', 'greater'):
        mine = unpaired_test(FIRST[:7], SECOND, alternative, 0.1)
        theirs = stats.ttest_ind(SECOND, FIRST[:7], equal_var=False, alternative=alternative)
        assert (mine.t, mine.p) == pytest.approx((theirs.statistic, theirs.pvalue))
        interval = stats.ttest_ind(SECOND, FIRST[:7], equal_var=False).confidence_interval(0.9)
        assert (mine.low, mine.high) == pytest.approx(tuple(interval))
        assert mine.p_rank_sum == pytest.approx(stats.mannwhitneyu(
            SECOND, FIRST[:7], alternative=alternative).pvalue)
    # d_s is t of equal variances times the root of 1 / n1 + 1 / n2 (Lakens 2013, equation 2).
    student = stats.ttest_ind(SECOND, FIRST).statistic
    assert found.d_s == pytest.approx(student * math.sqrt(0.2))
    assert found.g_s == pytest.approx(found.d_s * (1.0 - 3.0 / 71.0))
    for few in (np.array([]), FIRST[:1]):
        none = unpaired_test(few, SECOND, 'two-sided', 0.05)
        assert math.isnan(none.p) and none.counts == (len(few), 10)
    assert math.isnan(unpaired_test(np.ones(3), np.ones(3), 'two-sided', 0.05).p)


@pytest.mark.matrix
@pytest.mark.parametrize(('keys', 'd_s'), [
    ({'effect': 0.9}, 0.9), ({'effect': -4.0, 'sd': 5.0}, -0.8), ({'effect': 0.0}, 0.0)])
def test_power_is_that_of_the_closed_form(keys: dict[str, Any], d_s: float) -> None:
    """Welch's test has nearly the power of Student's with equal variances."""
    study = study_of({'measure': 'speed', 'factor': 'display'} | keys)
    for [power] in power_of(study, (20, 41), RUNS, 1):
        count = power.participants
        wanted = closed_form(d_s, (count - count // 2, count // 2))
        error = math.sqrt(wanted * (1.0 - wanted) / RUNS)
        assert power.found == pytest.approx(wanted, abs=3.0 * error + 0.005)
    assert any('display: g1 - g0' in line for line in power_lines([[power]], RUNS))


def test_effects_within_and_between_are_drawn_together() -> None:
    study = study_of(
        {'measure': 'speed', 'factor': 'display', 'effect': 5.0, 'sd': 2.0},
        {'measure': 'speed', 'factor': 'load', 'effect': 3.0, 'sd': 1.0, 'sd_of': 'trial'})
    trials = SimulatedTrials(study, planned_people(study, 400), measure_models(study))
    rows = polars.DataFrame(trials.draw(np.random.default_rng(1)))
    people = rows.group_by('participant', 'display').agg(polars.col('speed').mean())
    first, second = (people.filter(display=name)['speed'] for name in ('g0', 'g1'))
    # Three standard errors of 200 people in each group; 400 participants within.
    assert second.mean() - first.mean() == pytest.approx(5.0, abs=3.0 * 2.0 * 0.01 ** 0.5)
    assert first.std() == pytest.approx(2.0, abs=3.0 * 2.0 / 400 ** 0.5)
    loads = dict(rows.group_by('load').agg(polars.col('speed').mean()).rows())
    assert loads['high'] - loads['none'] == pytest.approx(3.0, abs=3.0 * (2.0 / 800) ** 0.5)
    with pytest.raises(InputError, match='than their own 4 trials let them'):
        measure_models(study_of(
            {'measure': 'speed', 'factor': 'display', 'effect': 5.0, 'sd': 0.1},
            {'measure': 'speed', 'factor': 'load', 'effect': 3.0, 'sd': 1.0, 'sd_of': 'trial'}))
    with pytest.raises(InputError, match='"sd_of: trial" between groups'):
        study_of({'measure': 'speed', 'factor': 'display', 'effect': 1.0, 'sd': 1.0,
                  'sd_of': 'trial'})


def test_the_model_and_the_script_have_the_groups() -> None:
    study = study_of({'measure': 'speed', 'factor': 'load'},
                     {'measure': 'speed', 'factor': 'display'})
    formula, = model_formulas(study)
    columns = {'load': 'load', 'display': 'display_level'}
    assert formula.text(columns) == 'speed ~ load + display_level + (1 | participant)'
    trials = SimulatedTrials(study, planned_people(study, 30), measure_models(study_of(
        {'measure': 'speed', 'factor': 'display', 'effect': 4.0})))
    rows = trials.draw(np.random.default_rng(2))
    model = fit_model(formula, rows, {'load': 'load', 'display': 'display'})
    effects = {effect.name: effect for effect in model.effects}
    # A balanced model's estimate is the difference of the groups' means.
    means = {name: np.mean([row['speed'] for row in rows if row['display'] == name])
             for name in ('g0', 'g1')}
    assert effects['display: g1'].value == pytest.approx(means['g1'] - means['g0'])
    script = r_script(study, columns)
    # R would read the levels 01 and T as a number and a truth value.
    for name in ('participant', 'block', 'load', 'display_level'):
        assert f'{name}" = "character"' in script
    assert 'compare("speed", "load", "none", "high", "two.sided")' in script
    assert 'compare_groups("speed", "display_level", "g0", "g1", "two.sided")' in script
    assert '`speed` ~ `load` + `display_level` + (1 | participant)' in script


def test_made_data_of_groups_have_tables_and_a_report(tmp_path: Path) -> None:
    """Made people are not excluded, are in balanced groups, and have the stated effects."""
    assert main(['study', 'new', str(tmp_path / 'study')]) == 0
    file, out = tmp_path / 'study' / 'study.yaml', tmp_path / 'made'
    file.write_text(file.read_text() + GROUPED)
    assert main(['study', 'make-data', str(file), '--out', str(out), '--participants', '16',
                 '--effects', '--seed', '3']) == 0
    assert main(['study', 'data', str(out)]) == 0
    people = polars.read_parquet(out / 'data' / 'participants.parquet')
    assert people['age'].min() >= 30 and not people['excluded'].any()
    assert sorted(people['display'].value_counts()['count'])[0] >= 6
    trials = polars.read_parquet(out / 'data' / 'trials.parquet')
    means = dict(trials.group_by('display').agg(polars.col('mean_speed_m_per_s').mean()).rows())
    assert means['lights'] - means['bars'] == pytest.approx(6.0, abs=3.0 * (2.0 / 6.0) ** 0.5)
    assert main(['study', 'report', str(out)]) == 0
    html = (out / 'data' / 'report.html').read_text()
    assert 'Differences between groups' in html and 'Differences within participants' in html
    assert 'By <bdi>display</bdi>' in html and 'lights/' in html and 'display: lights' in html
    assert main(['validate', str(out)]) == 0
    assert main(['study', 'preregister', str(file)]) == 0
    plan = (tmp_path / 'study' / 'preregistration.md').read_text()
    assert 'randomly permuted blocks of 4, stratified by age' in plan
    assert '- age is below 30' in plan and '| lights 4 |' in plan
