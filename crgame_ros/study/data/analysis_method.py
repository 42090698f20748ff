# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The method of the planned analysis as text, and a check of its measures."""

from collections.abc import Sequence

from crgame_ros.analysis.tables.column import Column, FLAG, TEXT
from crgame_ros.errors import InputError
from crgame_ros.study.file import StudyFile


def check_measures(study: StudyFile, columns: Sequence[Column]) -> None:
    """
    Check that the planned comparisons are of columns with numbers.

    :param columns: of the table of trials.
    :raises InputError: naming the comparison.
    """
    known = {column.name: column for column in columns}
    for number_, comparison in enumerate(study.analysis.comparisons):
        where = f'analysis: comparisons[{number_}]: measure'
        if comparison.measure not in known:
            parts = set(comparison.measure.split('_'))
            near = sorted((name for name in known if parts & set(name.split('_'))),
                          key=lambda name: -len(parts & set(name.split('_'))))[:3]
            raise InputError(f'names "{comparison.measure}", which is no column of trials.csv',
                             where, f'name one such as {", ".join(near) or "mean_speed_m_per_s"}')
        if known[comparison.measure].type in (TEXT, FLAG):
            raise InputError(f'names "{comparison.measure}", which has no numbers', where,
                             'name a column with numbers')


def method_of(study: StudyFile) -> str:
    """Return the method of the tests as sentences."""
    analysis = study.analysis
    family = 'all tests of this analysis' if analysis.family == 'analysis' \
        else 'the tests of each comparison'
    flagged = 'Trials beyond a bound of quality are used.' if analysis.flagged == 'use' \
        else 'Trials beyond a bound of quality (timing_flag, page_flag) are left out.'
    stepped = ' Trials of staircases are left out: answers choose their levels.' \
        if study.has_staircases else ''
    between = '' if all(each.factor != study.between for each in analysis.comparisons) else (
        'Between groups, a participant’s value is the mean over all its trials; test and interval '
        'are those of Welch, with Satterthwaite’s degrees of freedom, beside the test of Mann and '
        'Whitney. ')
    return (
        'A participant’s value in a level is the mean over its trials in the level, in all blocks '
        'that cross the factor. A participant without a value in one of both levels is not in '
        'that test; nothing is imputed. The difference is the second level less the first, with '
        f'its two-sided {100.0 * (1.0 - analysis.alpha):g} % interval by Student’s t. p is that '
        'of the paired t-test, p (Holm) is corrected by Holm (1979) over '
        f'{family}, with α = {analysis.alpha:g}. Beside it stands the p-value of Wilcoxon’s '
        f'signed-rank test, uncorrected. {between}{flagged}{stepped}')
