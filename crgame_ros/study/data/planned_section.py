# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report section on planned comparisons: tests, effect sizes, and mixed models."""

from collections.abc import Iterator, Mapping, Sequence

from crgame_ros.analysis.report.section import free, note, NOTHING, number, plain, table
from crgame_ros.errors import InputError
from crgame_ros.study.analysis.mixed_model import fit_models, missing_extra, MixedModel
from crgame_ros.study.analysis.planned_tests import (
    PairedTest,
    planned_tests,
    PlannedTest,
    UnpairedTest,
    used_rows,
)
from crgame_ros.study.data.preregistration import check_measures, method_of
from crgame_ros.study.data.study_data import StudyData
from crgame_ros.study.file import StudyFile

_WORDS = {'two-sided': '≠ 0', 'greater': '> 0', 'less': '< 0'}


def planned_section(data: StudyData) -> str:
    """Return the section; a comparison of no column with numbers is named instead."""
    study = data.folder.study
    try:
        check_measures(study, data.trials_table.declaration.columns)
    except InputError as error:
        # The study file must not change once people have taken part.
        return note(f'<strong>{plain(error)}</strong>')
    rows = [trial.row for trial in data.trials]
    tests = planned_tests(study, rows, data.factor_columns)
    used = used_rows(study, rows)
    return _method(study, len(rows), len(used)) + _tests(data, tests) + _effects(tests) \
        + _models(data, used)


def _method(study: StudyFile, trials: int, used: int) -> str:
    left_out = '' if used == trials else f' {trials - used} of {trials} trials are left out.'
    return note(plain(method_of(study) + left_out))


def _tests(data: StudyData, tests: Sequence[PlannedTest]) -> str:
    units = {column.name: column.unit for column in data.trials_table.declaration.columns}
    alpha = data.folder.study.analysis.alpha
    within: list[Sequence[str]] = []
    between: list[Sequence[str]] = []
    for each in tests:
        test, unit = each.test, units[each.comparison.measure]
        digits = _digits(test.difference)
        if isinstance(test, PairedTest):
            rows, n, freedom = within, str(test.participants), max(0, test.participants - 1)
            df, p_rank = str(freedom), test.p_signed_rank
        else:
            rows, n = between, ' / '.join(map(str, test.counts))
            df, p_rank = number(test.freedom, 1), test.p_rank_sum
        rows.append((
            _name(each), plain('' if unit == '1' else unit), n,
            number(test.first, digits), number(test.second, digits),
            f'{number(test.difference, digits)} <small>[{number(test.low, digits)}; '
            f'{number(test.high, digits)}]</small>',
            f'{number(test.t, 2)} <small>({df})</small>',
            _WORDS[each.comparison.alternative], _p(test.p), _p(each.p_holm), _p(p_rank)))
    ends = f'with {100.0 * (1.0 - alpha):g} % intervals'
    return ''.join(table(f'{words}, {ends}', (
        '', 'unit', 'n', 'first', 'second', 'difference', 't <small>(df)</small>', 'tested', 'p',
        'p (Holm)', f'p ({rank})'), rows, 'numbers') for words, rank, rows in (
            ('Differences within participants', 'Wilcoxon', within),
            ('Differences between groups', 'Mann-Whitney', between)) if rows)


def _effects(tests: Sequence[PlannedTest]) -> str:
    within = [(_name(each), number(each.test.d_z, 2), number(each.test.d_av, 2),
               number(each.test.g_av, 2)) for each in tests if isinstance(each.test, PairedTest)]
    between = [(_name(each), number(each.test.d_s, 2), number(each.test.g_s, 2))
               for each in tests if isinstance(each.test, UnpairedTest)]
    html = '' if not within else table('Effect sizes', (
        '', 'd<sub>z</sub>', 'd<sub>av</sub>', 'g<sub>av</sub>'), within, 'numbers') + note(
        'By Lakens (2013): d<sub>z</sub> is the mean difference over the standard deviation of '
        'the differences, d<sub>av</sub> over the mean of both levels’ standard deviations; '
        'g<sub>av</sub> is d<sub>av</sub> with Hedges’ correction.')
    return html + ('' if not between else table('Effect sizes between groups', (
        '', 'd<sub>s</sub>', 'g<sub>s</sub>'), between, 'numbers') + note(
        'By Lakens (2013): d<sub>s</sub> is the difference of the means over the pooled standard '
        'deviation of the groups; g<sub>s</sub> is d<sub>s</sub> with Hedges’ correction.'))


def _name(each: PlannedTest) -> str:
    first, second = each.pair
    return f'{plain(each.comparison.measure)}<br><small>{free(each.comparison.factor)}: ' \
        f'{free(second)} − {free(first)}</small>'


def _models(data: StudyData, rows: Sequence[Mapping[str, object]]) -> str:
    missing = missing_extra()
    if missing:
        return note(f'For mixed models, install statsmodels: <code>{plain(missing)}</code>. '
                    '<code>analysis.R</code> beside the tables has them for R.')
    html = ''
    for model in fit_models(data.folder.study, rows, data.factor_columns):
        formula = model.formula.text(data.factor_columns)
        html += table(f'Mixed model: <code>{plain(formula)}</code>', (
            '', 'estimate', 'SE', '95 % interval', 'z', 'p'), list(_fixed(model)), 'numbers')
        told = f'{model.trials} trials of {model.participants} participants'
        if model.effects:
            told += (f'; standard deviations: participants {_value(model.participant_sd)}, '
                     f'residuals {_value(model.residual_sd)}')
        html += note(plain(f'{told}.') + (
            f' <strong>Do not trust this fit: {plain(model.problem)}.</strong>'
            if model.problem else ''))
    return html + note(
        'By restricted maximum likelihood (statsmodels), of trials, with a random intercept of '
        'each participant; a level’s estimate is its difference from the first level of its '
        'factor. z and p are by the normal distribution, which is too sure with few participants: '
        '<code>analysis.R</code> beside the tables fits the same model by lme4, and tests it with '
        'Satterthwaite’s degrees of freedom.')


def _fixed(model: MixedModel) -> Iterator[Sequence[str]]:
    for each in model.effects:
        yield (plain(each.name), _value(each.value), _value(each.error),
               f'[{_value(each.low)}; {_value(each.high)}]', number(each.z, 2), _p(each.p))


def _p(value: float) -> str:
    if value != value:
        return NOTHING
    return '&lt; 0.001' if value < 0.001 else number(value, 3)


def _value(value: float) -> str:
    return number(value, _digits(value))


def _digits(value: float) -> int:
    return 4 if abs(value) < 0.1 else 3 if abs(value) < 1.0 else 2 if abs(value) < 100.0 else 1
