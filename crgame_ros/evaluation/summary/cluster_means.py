# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Means over scenarios, with intervals that hold for few of them.

Cells of one scenario are alike, so the scenarios are the clusters that vary by chance: the mean is
that of their means, and the interval is Student's.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
import math
from typing import Literal

from crgame_ros.evaluation.summary.summary import Estimate
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

CONFIDENCE = 0.95
# Of one scenario, different runs are the clusters; more than this share clusters.
RUN_CLUSTERS = 4096
# More different runs than this are not counted.
_MOST_RUNS = 10_000


@dataclass
class CountedCells:
    """
    The cells of a group, or its pairs of cells, counted before any measure is read.

    :param cells: their number.
    :param scenarios: numbers of their scenarios.
    :param runs: digests of different runs; None if there are too many to count.
    """

    cells: int = 0
    scenarios: set[int] = field(default_factory=set)
    runs: set[int] | None = field(default_factory=set)

    def add(self, scenarios: IntArray, runs: NDArray[np.uint64]) -> None:
        """Count cells, by the scenario and the digest of each."""
        self.cells += len(scenarios)
        self.scenarios.update(np.unique(scenarios).tolist())
        if self.runs is not None:
            self.runs.update(np.unique(runs).tolist())
            if len(self.runs) > _MOST_RUNS:
                self.runs = None

    @property
    def clustered(self) -> Literal['scenarios', 'runs']:
        """Return what the clusters are."""
        return 'scenarios' if len(self.scenarios) > 1 else 'runs'

    @property
    def different_runs(self) -> int:
        """Return the number of different runs, or of cells if there are too many runs to count."""
        return self.cells if self.runs is None else len(self.runs)


class ClusterMeans:
    """
    The mean of each measure over the clusters of a group, of the means over their cells.

    :param measures: number of measures.
    """

    def __init__(self, measures: int) -> None:
        self._measures = measures
        # Sums of the values, then their numbers.
        self._clusters: dict[int, FloatArray] = {}

    def add(self, values: FloatArray, clusters: IntArray) -> None:
        """
        Add cells.

        :param values: (N, measures) NaN where a cell has none.
        :param clusters: (N) cluster of each cell.
        """
        if not len(values):
            return
        there = ~np.isnan(values)
        rows = np.concatenate((np.where(there, values, 0.0), there), axis=1)
        different, inverse = np.unique(clusters, return_inverse=True)
        order = np.argsort(inverse, kind='stable')
        starts = np.searchsorted(inverse[order], np.arange(len(different)))
        for cluster, sums in zip(different.tolist(), np.add.reduceat(rows[order], starts),
                                 strict=True):
            known = self._clusters.setdefault(cluster, np.zeros(2 * self._measures))
            known += sums

    def estimates(self) -> tuple[Estimate, ...]:
        """Return the mean of each measure, with its interval and probability."""
        table = np.array([sums for _, sums in sorted(self._clusters.items())]).reshape(
            -1, 2 * self._measures)
        return tuple(_estimate(table[:, place], table[:, self._measures + place])
                     for place in range(self._measures))


def _estimate(sums: FloatArray, counts: FloatArray) -> Estimate:
    """
    Return the estimate of one measure.

    :param sums: (C) sum of the values of each cluster.
    :param counts: (C) number of values of each cluster.
    """
    sums, counts = sums[counts > 0.0], counts[counts > 0.0]
    clusters, count = len(counts), int(counts.sum())
    if not clusters:
        return Estimate(np.nan, np.nan, np.nan, 0, 0, np.nan)
    values = sums / counts
    mean = float(values.mean())
    if clusters < 2:
        return Estimate(mean, np.nan, np.nan, count, clusters, np.nan)
    error = float(values.std(ddof=1)) / math.sqrt(clusters)
    # Equal values differ by rounding alone.
    if error <= np.finfo(float).eps * clusters * np.abs(values).max():
        return Estimate(mean, mean, mean, count, clusters, 0.0 if mean else 1.0)
    # A slow import.
    from scipy.stats import t
    half = float(t.ppf(0.5 + 0.5 * CONFIDENCE, clusters - 1)) * error
    return Estimate(mean, mean - half, mean + half, count, clusters,
                    2.0 * float(t.sf(abs(mean) / error, clusters - 1)))


def run_clusters(runs: NDArray[np.uint64]) -> IntArray:
    """Return the clusters of cells of one scenario: equal runs are in the same."""
    return np.asarray(runs % np.uint64(RUN_CLUSTERS), np.int64)


def holm(estimates: Iterable[Estimate]) -> list[Estimate]:
    """
    Return estimates with `beyond_chance` set where they differ from 0, for all of them together.

    By Holm (1979) the probability that any is set where none differs is 5 % at most, whatever the
    dependence between them.
    """
    found = list(estimates)
    ranked = sorted((place for place, each in enumerate(found) if not np.isnan(each.p)),
                    key=lambda place: found[place].p)
    for rank, place in enumerate(ranked):
        if found[place].p > (1.0 - CONFIDENCE) / (len(ranked) - rank):
            break
        found[place] = replace(found[place], beyond_chance=True)
    return found
