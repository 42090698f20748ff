# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tests and effect sizes of a difference within participants, and Holm's correction."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

from crgame_ros.study.planned_analysis import Alternative
import numpy as np
from numpy.typing import NDArray


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
    low: float
    high: float
    t: float
    p: float
    p_signed_rank: float
    d_z: float
    d_av: float
    g_av: float

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
    # A slow import.
    from scipy.special import stdtr, stdtrit
    count = len(first)
    nan = math.nan
    if count < 2:
        means = (float(first[0]), float(second[0])) if count else (nan, nan)
        return PairedTest(count, *means, nan, nan, nan, nan, nan, nan, nan, nan)
    differences = second - first
    mean, sd = float(differences.mean()), float(differences.std(ddof=1))
    error, freedom = sd / math.sqrt(count), count - 1
    half = error * float(stdtrit(freedom, 1.0 - alpha / 2.0))
    spread = (float(first.std(ddof=1)) + float(second.std(ddof=1))) / 2.0
    t, d_av = (mean / error if error else nan), (mean / spread if spread else nan)
    tail = {'two-sided': 2.0 * float(stdtr(freedom, -abs(t))),
            'greater': float(stdtr(freedom, -t)), 'less': float(stdtr(freedom, t))}
    return PairedTest(
        count, float(first.mean()), float(second.mean()), mean - half, mean + half, t,
        tail[alternative], _signed_rank(differences, alternative), mean / sd if sd else nan,
        d_av, d_av * (1.0 - 3.0 / (4.0 * freedom - 1.0)))


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
