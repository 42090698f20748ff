# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tests and effect sizes of a difference between groups of participants."""

from dataclasses import dataclass
import math

from crgame_ros.study.planned_analysis import Alternative
import numpy as np
from numpy.typing import NDArray


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
    # A slow import.
    from scipy.special import stdtr, stdtrit
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
    t, half = difference / error, error * float(stdtrit(freedom, 1.0 - alpha / 2.0))
    tail = {'two-sided': 2.0 * float(stdtr(freedom, -abs(t))),
            'greater': float(stdtr(freedom, -t)), 'less': float(stdtr(freedom, t))}
    total = sum(counts)
    pooled = math.sqrt(sum((count - 1) * variance for count, variance in
                           zip(counts, variances, strict=True)) / (total - 2))
    d_s = difference / pooled
    return UnpairedTest(counts, first_mean, second_mean, difference - half, difference + half, t,
                        freedom, tail[alternative], _rank_sum(first, second, alternative), d_s,
                        d_s * (1.0 - 3.0 / (4.0 * total - 9.0)))


def _rank_sum(first: NDArray[np.float64], second: NDArray[np.float64],
              alternative: Alternative) -> float:
    """Return the p-value: exact without ties in groups of up to 8, else by the normal one."""
    from scipy.stats import mannwhitneyu
    return float(mannwhitneyu(second, first, alternative=alternative).pvalue)
