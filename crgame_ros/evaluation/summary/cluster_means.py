# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Means over scenarios, with intervals that hold for few of them.

Cells of one scenario are alike, so the scenarios are the clusters that vary by chance: the mean is
that of their means, and the interval is Student's. The recorded runs of a participant are alike,
too: with several participants the clusters are crossed (Cameron, Gelbach & Miller 2011).
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
import math
from typing import NamedTuple

from crgame_ros.evaluation.summary.summary import Clustered, Estimate
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

CONFIDENCE = 0.95
# Of one scenario, different runs are the clusters; more than this share clusters.
RUN_CLUSTERS = 4096
# More different runs than this are not counted.
_MOST_RUNS = 10_000
# Larger than any number of a participant.
_ALONE = 1 << 40


class CellClusters(NamedTuple):
    """
    What cells (N) have in common, each of which can be their cluster.

    :param scenarios: (N) numbers of their scenarios.
    :param participants: (N) numbers of those who drove the recorded runs, from 1; 0 without one.
    :param runs: (N) digests of their runs.
    """

    scenarios: IntArray
    participants: IntArray
    runs: NDArray[np.uint64]

    def of(self, rows: IntArray | NDArray[np.bool_]) -> 'CellClusters':
        """Return those of some rows."""
        return CellClusters(self.scenarios[rows], self.participants[rows], self.runs[rows])

    def crossed(self, clustered: Clustered) -> tuple[IntArray, IntArray]:
        """Return the clusters of the cells (N), and the clusters across these, or the same."""
        if clustered == 'scenarios and participants':
            # A cell without a participant has nothing in common with other scenarios.
            return self.scenarios, np.where(
                self.participants > 0, self.participants, _ALONE + self.scenarios)
        found = {'scenarios': self.scenarios, 'participants': self.participants,
                 # Equal runs are in the same cluster.
                 'runs': np.asarray(self.runs % np.uint64(RUN_CLUSTERS), np.int64)}[clustered]
        return found, found


@dataclass
class CountedCells:
    """
    The cells of a group, or its pairs of cells, counted before any measure is read.

    :param cells: their number.
    :param scenarios: numbers of their scenarios.
    :param participants: numbers of their participants.
    :param runs: digests of different runs; None if there are too many to count.
    """

    cells: int = 0
    scenarios: set[int] = field(default_factory=set)
    participants: set[int] = field(default_factory=set)
    runs: set[int] | None = field(default_factory=set)

    def add(self, found: CellClusters) -> None:
        """Count cells."""
        runs = found.runs
        self.cells += len(runs)
        self.scenarios.update(np.unique(found.scenarios).tolist())
        self.participants.update(np.unique(found.participants[found.participants > 0]).tolist())
        if self.runs is not None:
            self.runs.update(np.unique(runs).tolist())
            if len(self.runs) > _MOST_RUNS:
                self.runs = None

    @property
    def clustered(self) -> Clustered:
        """Return what the clusters are."""
        several = len(self.participants) > 1
        if len(self.scenarios) > 1:
            return 'scenarios and participants' if several else 'scenarios'
        return 'participants' if several else 'runs'

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
        # Sums of the values, then their numbers, by the two clusters.
        self._clusters: dict[tuple[int, int], FloatArray] = {}

    def add(self, values: FloatArray, clusters: IntArray, crossed: IntArray) -> None:
        """
        Add cells.

        :param values: (N, measures) NaN where a cell has none.
        :param clusters: (N) cluster of each cell.
        :param crossed: (N) its cluster across these; the same if there are no other clusters.
        """
        if not len(values):
            return
        there = ~np.isnan(values)
        rows = np.concatenate((np.where(there, values, 0.0), there), axis=1)
        order = np.lexsort((crossed, clusters))
        pairs = np.column_stack((clusters, crossed))[order]
        starts = np.flatnonzero(np.diff(pairs, axis=0, prepend=pairs[:1] - 1).any(axis=1))
        for pair, sums in zip(pairs[starts].tolist(), np.add.reduceat(rows[order], starts),
                              strict=True):
            known = self._clusters.setdefault(tuple(pair), np.zeros(2 * self._measures))
            known += sums

    def estimates(self) -> tuple[Estimate, ...]:
        """Return the mean of each measure, with its interval and probability."""
        found = sorted(self._clusters.items())
        pairs = np.array([pair for pair, _ in found], np.int64).reshape(-1, 2)
        table = np.array([sums for _, sums in found]).reshape(-1, 2 * self._measures)
        return tuple(_estimate(table[:, place], table[:, self._measures + place], pairs)
                     for place in range(self._measures))


def _estimate(sums: FloatArray, counts: FloatArray, pairs: IntArray) -> Estimate:
    """
    Return the estimate of one measure.

    :param sums: (C) sum of the values with the same two clusters.
    :param counts: (C) their numbers.
    :param pairs: (C, 2) their cluster, and the cluster across.
    """
    there = counts > 0.0
    sums, counts, pairs = sums[there], counts[there], pairs[there]
    count = int(counts.sum())
    if not count:
        return Estimate(np.nan, np.nan, np.nan, 0, 0, np.nan)
    own, across = (np.unique(column, return_inverse=True)[1] for column in pairs.T)
    of_cluster = np.bincount(own, counts)
    values = np.bincount(own, sums) / of_cluster
    clusters, mean = len(values), float(values.mean())
    if clusters < 2:
        return Estimate(mean, np.nan, np.nan, count, clusters, np.nan)
    # By how much the values of each pair of clusters move the mean.
    moved = (sums - mean * counts) / (clusters * of_cluster[own])
    variance, freedom = _variance(moved, own), clusters - 1
    if across.any():
        more, both = _variance(moved, across), _variance(moved, np.arange(len(moved)))
        variance = max(variance + more - both, variance, more)
        freedom = min(freedom, int(across.max()))
    error = math.sqrt(variance)
    # Equal values differ by rounding alone.
    if error <= np.finfo(float).eps * clusters * np.abs(values).max():
        return Estimate(mean, mean, mean, count, clusters, 0.0 if mean else 1.0)
    # A slow import.
    from scipy.stats import t
    half = float(t.ppf(0.5 + 0.5 * CONFIDENCE, freedom)) * error
    return Estimate(mean, mean - half, mean + half, count, clusters,
                    2.0 * float(t.sf(abs(mean) / error, freedom)))


def _variance(moved: FloatArray, clusters: IntArray) -> float:
    """Return the variance of a mean that varies with its clusters, by what each moves it."""
    sums = np.bincount(clusters, moved)
    return float(len(sums) / (len(sums) - 1) * (sums @ sums))


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
