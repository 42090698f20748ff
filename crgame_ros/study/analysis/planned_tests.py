# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs a study's planned comparisons: tests and effect sizes, within or between people."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
import math
from operator import itemgetter

from crgame_ros.study.file import StudyFile
from crgame_ros.study.planned_analysis import Alternative, Comparison
import numpy as np
from numpy.typing import NDArray

FLAGS = ('timing_flag', 'page_flag')


@dataclass(frozen=True)
class PairedTest:
    """
    The comparison of two levels within participants; a value that cannot be computed is NaN.

    :param participants: number of those with a value in both levels.
    :param first: mean over participants of the first level.
    :param second: likewise of the second.
    :param low: end of the two-sided interval of the mean difference, second less first.
    :param high: the other end.
    :param t: statistic of the paired t-test.
    :param p: its p-value.
    :param p_signed_rank: that of Wilcoxon's signed-rank test.
    :param d_z: mean difference over the standard deviation of the differences (Lakens, Frontiers
        in Psychology 4, 2013, equation 6).
    :param d_av: over the mean of both levels' standard deviations (equation 10).
    :param g_av: d_av with Hedges' correction, 1 - 3 / (4 (n - 1) - 1).
    """

    participants: int
    first: float
    second: float
    low: float = math.nan
    high: float = math.nan
    t: float = math.nan
    p: float = math.nan
    p_signed_rank: float = math.nan
    d_z: float = math.nan
    d_av: float = math.nan
    g_av: float = math.nan

    @property
    def difference(self) -> float:
        """Return the mean difference, second less first."""
        return self.second - self.first


def paired_test(first: NDArray[np.float64], second: NDArray[np.float64], alternative: Alternative,
                alpha: float) -> PairedTest:
    """
    Compare two levels within participants.

    :param first: (N) values of the participants in the first level.
    :param second: (N) of the same participants in the second level.
    :param alternative: about the difference, second less first.
    :param alpha: the interval is of 1 - alpha, and two-sided whatever the alternative.
    """
    count = len(first)
    nan = math.nan
    if count < 2:
        return PairedTest(count, *((float(first[0]), float(second[0])) if count else (nan, nan)))
    differences = second - first
    mean, sd = float(differences.mean()), float(differences.std(ddof=1))
    error, freedom = sd / math.sqrt(count), count - 1
    half = _half_width(error, freedom, alpha)
    spread = (float(first.std(ddof=1)) + float(second.std(ddof=1))) / 2.0
    t, d_av = (mean / error if error else nan), (mean / spread if spread else nan)
    return PairedTest(
        count, float(first.mean()), float(second.mean()), mean - half, mean + half, t,
        _p_of(t, freedom, alternative), _signed_rank(differences, alternative),
        mean / sd if sd else nan, d_av, d_av * (1.0 - 3.0 / (4.0 * freedom - 1.0)))


def _half_width(error: float, freedom: float, alpha: float) -> float:
    """Return half the width of Student's interval of 1 - alpha."""
    # A slow import.
    from scipy.special import stdtrit
    return error * float(stdtrit(freedom, 1.0 - alpha / 2.0))


def _p_of(t: float, freedom: float, alternative: Alternative) -> float:
    """Return the p-value of Student's statistic."""
    # A slow import.
    from scipy.special import stdtr
    if alternative == 'two-sided':
        return 2.0 * float(stdtr(freedom, -abs(t)))
    return float(stdtr(freedom, -t if alternative == 'greater' else t))


def _signed_rank(differences: NDArray[np.float64], alternative: Alternative) -> float:
    """Return the p-value of Wilcoxon's test: exact up to 50 differences without ties or zeros."""
    from scipy.stats import wilcoxon
    if not differences.any():
        return math.nan
    # With few differences and a zero, scipy permutes signs, or warns of small samples.
    with np.errstate(all='ignore'):
        return float(wilcoxon(differences, alternative=alternative).pvalue)


def holm(p_values: Sequence[float]) -> list[float]:
    """
    Correct the p-values of a family of tests (Holm, Scandinavian Journal of Statistics 6, 1979).

    :param p_values: those that are NaN stay so, and count as tests of the family.
    """
    count = len(p_values)
    corrected = [math.nan] * count
    greatest = 0.0
    known = [place for place in range(count) if not math.isnan(p_values[place])]
    for rank, place in enumerate(sorted(known, key=lambda place: p_values[place])):
        greatest = max(greatest, min(1.0, (count - rank) * p_values[place]))
        corrected[place] = greatest
    return corrected


@dataclass(frozen=True)
class UnpairedTest:
    """
    The comparison of two groups; a value that cannot be computed is NaN.

    :param counts: numbers of participants with a value, in the first and the second group.
    :param first: mean over participants of the first group.
    :param second: likewise of the second.
    :param low: end of Welch's two-sided interval of the difference, second less first.
    :param high: the other end.
    :param t: statistic of Welch's t-test (Biometrika 34, 1947).
    :param freedom: its degrees of freedom, by Welch and Satterthwaite.
    :param p: its p-value.
    :param p_rank_sum: that of the test of Mann and Whitney (Wilcoxon's rank-sum test).
    :param d_s: difference over the pooled standard deviation (Lakens, Frontiers in Psychology 4,
        2013, equation 1).
    :param g_s: d_s with Hedges' correction, 1 - 3 / (4 (n1 + n2) - 9) (equation 4).
    """

    counts: tuple[int, int]
    first: float
    second: float
    low: float = math.nan
    high: float = math.nan
    t: float = math.nan
    freedom: float = math.nan
    p: float = math.nan
    p_rank_sum: float = math.nan
    d_s: float = math.nan
    g_s: float = math.nan

    @property
    def difference(self) -> float:
        """Return the difference of the means, second less first."""
        return self.second - self.first


def unpaired_test(first: NDArray[np.float64], second: NDArray[np.float64],
                  alternative: Alternative, alpha: float) -> UnpairedTest:
    """
    Compare two groups.

    :param first: (N) values of the participants of the first group.
    :param second: (M) of those of the second group.
    :param alternative: about the difference, second less first.
    :param alpha: the interval is of 1 - alpha, and two-sided whatever the alternative.
    """
    counts = len(first), len(second)
    first_mean, second_mean = (float(values.mean()) if len(values) else math.nan
                               for values in (first, second))
    none = UnpairedTest(counts, first_mean, second_mean)
    if min(counts) < 2:
        return none
    variances = float(first.var(ddof=1)), float(second.var(ddof=1))
    shares = tuple(variance / count for variance, count in zip(variances, counts, strict=True))
    error = math.sqrt(sum(shares))
    if not error:
        return none
    difference = none.difference
    freedom = error ** 4 / sum(share ** 2 / (count - 1)
                               for share, count in zip(shares, counts, strict=True))
    t, half = difference / error, _half_width(error, freedom, alpha)
    total = sum(counts)
    pooled = math.sqrt(sum((count - 1) * variance for count, variance in
                           zip(counts, variances, strict=True)) / (total - 2))
    d_s = difference / pooled
    return UnpairedTest(counts, first_mean, second_mean, difference - half, difference + half, t,
                        freedom, _p_of(t, freedom, alternative),
                        _rank_sum(first, second, alternative), d_s,
                        d_s * (1.0 - 3.0 / (4.0 * total - 9.0)))


def _rank_sum(first: NDArray[np.float64], second: NDArray[np.float64],
              alternative: Alternative) -> float:
    """Return the p-value: exact without ties in groups of up to 8, else by the normal one."""
    from scipy.stats import mannwhitneyu
    return float(mannwhitneyu(second, first, alternative=alternative).pvalue)


@dataclass(frozen=True)
class PlannedTest:
    """
    A test of the planned analysis.

    :param comparison: that it belongs to.
    :param pair: the compared levels: the difference is the second less the first.
    :param test: its result: within participants, or between groups.
    :param p_holm: the p-value of the t-test, corrected in its family.
    """

    comparison: Comparison
    pair: tuple[str, str]
    test: PairedTest | UnpairedTest
    p_holm: float


def used_rows(study: StudyFile,
              rows: Iterable[Mapping[str, object]]) -> list[Mapping[str, object]]:
    """Return the trials that the planned analysis uses: none of staircases."""
    stepped = study.staircases
    flags = () if study.analysis.flagged == 'use' else FLAGS
    return [row for row in rows if row.get('block') not in stepped
            and not any(row.get(flag) for flag in flags)]


def participant_means(rows: Iterable[Mapping[str, object]], column: str,
                      name_of: Callable[[Mapping[str, object]], str] = itemgetter('condition')
                      ) -> dict[tuple[str, str], float]:
    """
    Compute the mean of a column for each participant in each condition, over repetitions.

    :param rows: of the table of trials; missing and infinite values are left out.
    :param name_of: returns what a trial is counted to, by default its condition.
    """
    found: dict[tuple[str, str], list[float]] = {}
    for row in rows:
        value = row.get(column)
        if isinstance(value, int | float) and math.isfinite(value):
            found.setdefault((str(row['participant']), name_of(row)), []).append(value)
    return {key: sum(values) / len(values) for key, values in found.items()}


def level_means(rows: Iterable[Mapping[str, object]], column: str,
                measure: str) -> dict[str, dict[str, float]]:
    """
    Compute each participant's mean of a measure in each level, over all trials of the level.

    :param column: of the factor.
    :return: by level and participant; missing and infinite values are left out.
    """
    found: dict[str, dict[str, float]] = {}
    known = (row for row in rows if row.get(column) is not None)
    for (person, level), mean in participant_means(
            known, measure, lambda row: str(row[column])).items():
        found.setdefault(level, {})[person] = mean
    return found


def planned_tests(study: StudyFile, rows: Sequence[Mapping[str, object]],
                  columns: Mapping[str, str]) -> list[PlannedTest]:
    """
    Run all planned comparisons.

    A participant's value in a level is the mean over its trials in the level. Within
    participants, one without a value in one of both levels is not in that test.

    :param rows: of the table of trials.
    :param columns: of the factors, by their names.
    """
    rows = used_rows(study, rows)
    alpha = study.analysis.alpha
    found: list[tuple[Comparison, tuple[str, str], PairedTest | UnpairedTest]] = []
    for comparison in study.analysis.comparisons:
        means = level_means(rows, columns[comparison.factor], comparison.measure)
        for pair in study.pairs_of(comparison):
            of_levels = [means.get(level, {}) for level in pair]
            is_between = comparison.factor == study.between
            both = of_levels[0].keys() & of_levels[1].keys()
            first, second = (np.array([mean for person, mean in sorted(of_level.items())
                                       if is_between or person in both]) for of_level in of_levels)
            found.append((
                comparison, pair, unpaired_test(first, second, comparison.alternative, alpha)
                if is_between else paired_test(first, second, comparison.alternative, alpha)))
    families: dict[int | None, list[int]] = {}
    for place, (comparison, _, _) in enumerate(found):
        family = None if study.analysis.family == 'analysis' else id(comparison)
        families.setdefault(family, []).append(place)
    corrected = [math.nan] * len(found)
    for places in families.values():
        for place, p in zip(places, holm([found[each][2].p for each in places]), strict=True):
            corrected[place] = p
    return [PlannedTest(*each, p) for each, p in zip(found, corrected, strict=True)]
