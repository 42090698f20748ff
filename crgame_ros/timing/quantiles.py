# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Quantiles of a stream of durations in constant memory."""

from bisect import bisect_left, bisect_right
from itertools import accumulate
import math

import numpy as np
from numpy.typing import NDArray

LOWEST_S = 1e-8
HIGHEST_S = 1e3
BINS_PER_DECADE = 100


class LogHistogram:
    """
    Count durations in bins of equal ratio, 100 to the decade from 10 ns to 1000 s.

    A quantile is off by at most half a bin, 1.2 %; what is shorter or longer than the bins
    counts in the first or last one. The extremes are kept exactly.
    """

    _decades = round(math.log10(HIGHEST_S / LOWEST_S))
    _edges = np.geomspace(LOWEST_S, HIGHEST_S, _decades * BINS_PER_DECADE + 1)
    # The search for a single value runs on a list: on an array it takes ten times as long.
    _edge_list: list[float] = _edges.tolist()

    def __init__(self) -> None:
        self._counts = [0] * (len(self._edges) + 1)
        self._total = 0
        self._least = math.inf
        self._greatest = -math.inf

    def add(self, value_s: float) -> None:
        """Count one duration [s]."""
        self._counts[bisect_right(self._edge_list, value_s)] += 1
        self._total += 1
        self._least = min(self._least, value_s)
        self._greatest = max(self._greatest, value_s)

    def add_all(self, values_s: NDArray[np.float64]) -> None:
        """Count many durations (R) [s]."""
        if not len(values_s):
            return
        bins = np.searchsorted(self._edges, values_s, side='right')
        for index, count in zip(*np.unique(bins, return_counts=True), strict=True):
            self._counts[index] += int(count)
        self._total += len(values_s)
        self._least = min(self._least, float(values_s.min()))
        self._greatest = max(self._greatest, float(values_s.max()))

    def quantile(self, fraction: float) -> float:
        """
        Find the smallest duration that a share of all durations does not exceed.

        :param fraction: the share in (0, 1].
        :return: the duration [s], within 1.2 % of the exact one; 0 if none was counted.
        """
        if not self._total:
            return 0.0
        wanted = math.ceil(fraction * self._total)
        index = bisect_left(list(accumulate(self._counts)), wanted)
        return min(max(self._middle(index), self._least), self._greatest)

    def _middle(self, index: int) -> float:
        if index == 0:
            return self._least
        if index == len(self._edges):
            return self._greatest
        return math.sqrt(self._edge_list[index - 1] * self._edge_list[index])
