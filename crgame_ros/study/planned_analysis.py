# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The planned analysis of a study: comparisons of levels of factors, with expected effects."""

from dataclasses import dataclass
from itertools import combinations
from typing import Annotated, Literal

from crgame_ros.errors import InputError
from crgame_ros.schema.marks import Listed, Within
from crgame_ros.study.local_text import check_known, ColumnName
from crgame_ros.study.trial_settings import Factor

Alternative = Literal['two-sided', 'less', 'greater']
# What is expected of the difference.
HYPOTHESES: dict[Alternative, str] = {'two-sided': '≠ 0', 'greater': '> 0', 'less': '< 0'}


@dataclass(frozen=True)
class Comparison:
    """
    A planned comparison of a measure between levels of a factor, or between groups.

    :param measure: a column of trials.csv.
    :param factor: name of the factor, within participants, or of the groups, between them.
    :param contrast: two of its levels: the difference is the second less the first; by default
        all pairs of levels.
    :param effect: expected difference, in standard deviations of the participants' differences
        (between groups: of the participants' means in a group), or with `sd` in the measure's
        unit.
    :param sd: expected standard deviation, in the measure's unit.
    :param sd_of: whether `sd` is that of the participants' differences between their means of
        the two levels, or of the trials of a participant in one condition; between groups it is
        that of the participants' means in a group.
    :param alternative: hypothesis about the difference.
    """

    measure: ColumnName
    factor: ColumnName
    contrast: Annotated[tuple[str, ...], Listed(2, 2, 'level')] | None = None
    effect: float | None = None
    sd: Annotated[float, Within(0.0, above=True)] | None = None
    sd_of: Literal['difference', 'trial'] = 'difference'
    alternative: Alternative = 'two-sided'

    def check(self) -> None:
        """Refuse a standard deviation without an effect, and the reverse where it is needed."""
        if self.sd is not None and self.effect is None:
            raise InputError('has "sd" without "effect"', '', 'give both, or none')
        if self.sd_of == 'trial' and self.sd is None:
            raise InputError('has "sd_of: trial" without "sd"', '', 'give "sd"')

    def pairs(self, factor: Factor) -> tuple[tuple[str, str], ...]:
        """Return the compared pairs of levels: the contrast, or all pairs."""
        if self.contrast is not None:
            return ((self.contrast[0], self.contrast[1]),)
        return tuple(combinations(factor.names, 2))

    def check_levels(self, factor: Factor, where: str) -> None:
        """
        Refuse a contrast of unknown levels, and an effect without one pair that it is of.

        :raises InputError: if the comparison does not fit the factor.
        """
        for name in self.contrast or ():
            if name not in factor.names:
                raise InputError(f'names "{name}", which is no level of {factor.name}',
                                 f'{where}: contrast', f'name {", ".join(factor.names)}')
        if self.contrast is not None and self.contrast[0] == self.contrast[1]:
            raise InputError('compares a level with itself', f'{where}: contrast',
                             'name two levels')
        if self.effect is not None and len(self.pairs(factor)) > 1:
            raise InputError('has an effect, but several pairs of levels', where,
                             'give "contrast" too: one entry for each pair')


@dataclass(frozen=True)
class PlannedAnalysis:
    """
    The planned analysis.

    :param comparisons: the planned comparisons.
    :param alpha: level of significance of each family of tests.
    :param family: the tests that Holm's correction holds together: all of the analysis, or those
        of each comparison.
    :param flagged: whether trials beyond a bound of `quality` are used.
    """

    comparisons: Annotated[tuple[Comparison, ...], Listed(0, 50, 'comparison')] = ()
    alpha: Annotated[float, Within(0.0001, 0.5)] = 0.05
    family: Literal['analysis', 'comparison'] = 'analysis'
    flagged: Literal['use', 'leave_out'] = 'use'

    def check_factors(self, factors: tuple[Factor, ...], between: str | None) -> None:
        """
        Refuse comparisons of unknown factors or levels.

        :param between: name of the factor between participants; None without one.
        :raises InputError: naming the comparison.
        """
        known = {factor.name: factor for factor in factors}
        for number, comparison in enumerate(self.comparisons):
            where = f'analysis: comparisons[{number}]'
            check_known('factor', comparison.factor, known, where)
            comparison.check_levels(known[comparison.factor], where)
            if comparison.factor == between and comparison.sd_of == 'trial':
                raise InputError('has "sd_of: trial" between groups', where,
                                 'give the standard deviation of the participants’ means in a '
                                 'group, without "sd_of"')
