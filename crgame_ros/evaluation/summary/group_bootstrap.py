# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Computes means with percentile-bootstrap intervals, from sums that are added block by block.

Cells of one scenario are correlated. If there are enough scenarios, whole scenarios are drawn
(Davison and Hinkley, Bootstrap Methods and their Application, 1997, section 3.8: drawing within
them as well adds variance that is not there). Otherwise cells are drawn.
"""

from dataclasses import dataclass, field
from typing import Literal

from crgame_ros.evaluation.summary.cell_block import digest_of
from crgame_ros.evaluation.summary.summary import Estimate
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# A resample of fewer scenarios is not representative.
FEWEST_SCENARIOS = 5
CONFIDENCE = 0.95
# Number of draws at a time, each some 40 bytes.
_DRAWS = 1_000_000


@dataclass
class DrawnUnits:
    """
    The units to draw from in a group, counted before any sums.

    :param cells: number of cells in each block; of pairs of cells for differences.
    :param clusters: numbers of the scenarios.
    """

    cells: list[int]
    clusters: set[int] = field(default_factory=set)

    @property
    def resampled(self) -> Literal['scenarios', 'cells']:
        """Return the kind of units that are drawn."""
        return 'scenarios' if len(self.clusters) >= FEWEST_SCENARIOS else 'cells'


class GroupBootstrap:
    """
    The mean of each measure in one group: the sum of all values over their number.

    :param name: part of the draws' seed, so that other groups do not change them.
    :param units: units of the group.
    :param measures: number of measures.
    :param resamples: number of resamples.
    :param seed: seed of the evaluation's summary.
    """

    def __init__(self, name: str, units: DrawnUnits, measures: int, resamples: int,
                 seed: int) -> None:
        self._units, self._resamples = units, resamples
        self._measures = measures
        # Sums of the values, then of their numbers.
        self._total = np.zeros(2 * measures)
        self._known = np.zeros(measures, np.int64)
        self._entropy = (seed, digest_of(name))
        self._clusters: dict[int, FloatArray] = {}
        self._drawn = np.zeros((0, 2 * measures))
        if units.resampled == 'cells':
            self._drawn = np.zeros((resamples, 2 * measures))
            whole = sum(units.cells)
            self._shares = self._random(0).multinomial(
                whole, np.array(units.cells) / max(whole, 1), size=resamples)

    def add(self, block: int, sums: FloatArray, counts: FloatArray, clusters: IntArray) -> None:
        """
        Add the cells of a block.

        :param block: its number.
        :param sums: (N, measures)
        :param counts: (N, measures) number of values in each sum.
        :param clusters: (N) scenario of each cell.
        """
        values = np.concatenate((sums, counts), axis=1)
        self._total += values.sum(axis=0)
        self._known += (counts > 0.0).sum(axis=0)
        if self._units.resampled == 'scenarios':
            different, inverse = np.unique(clusters, return_inverse=True)
            order = np.argsort(inverse, kind='stable')
            starts = np.searchsorted(inverse[order], np.arange(len(different)))
            for cluster, found in zip(different.tolist(),
                                      np.add.reduceat(values[order], starts), strict=True):
                known = self._clusters.setdefault(cluster, np.zeros(2 * self._measures))
                known += found
        else:
            self._draw(values, self._shares[:, block], self._random(block + 1))

    def estimates(self) -> tuple[Estimate, ...]:
        """Return the mean and the interval of each measure."""
        known = self._known
        if self._units.resampled == 'scenarios':
            values = np.array([sums for _, sums in sorted(self._clusters.items())])
            known = (values[:, self._measures:] > 0.0).sum(axis=0)
            self._drawn = np.zeros((self._resamples, 2 * self._measures))
            self._draw(values, np.full(self._resamples, len(values)), self._random(0))
        means, = _ratios(self._total[None], self._measures)
        bounds = _percentiles(_ratios(self._drawn, self._measures))
        # With a single unit all resamples are equal, so that there is no interval.
        bounds[:, known < 2] = np.nan
        low, high = bounds.tolist()
        return tuple(Estimate(value, least, greatest, int(n), units)
                     for value, least, greatest, n, units in zip(
                         means.tolist(), low, high, self._total[self._measures:].tolist(),
                         known.tolist(), strict=True))

    def _random(self, stream: int) -> np.random.Generator:
        return np.random.default_rng([*self._entropy, stream])

    def _draw(self, values: FloatArray, sizes: IntArray, random: np.random.Generator) -> None:
        """Add rows drawn with replacement to each resample."""
        rows = len(values)
        at_once = max(1, _DRAWS // max(rows, 1))
        for start in range(0, self._resamples, at_once):
            size = sizes[start:start + at_once]
            draws = random.integers(0, rows, int(size.sum()))
            draws += np.repeat(np.arange(len(size)) * rows, size)
            counts = np.bincount(draws, minlength=len(size) * rows).reshape(len(size), rows)
            self._drawn[start:start + at_once] += counts.astype(float) @ values


def _ratios(sums: FloatArray, measures: int) -> FloatArray:
    with np.errstate(invalid='ignore', divide='ignore'):
        return np.asarray(sums[:, :measures] / sums[:, measures:])


def _percentiles(means: FloatArray) -> FloatArray:
    """Return the lower and the upper bounds (2, measures); NaN where no resample has a value."""
    outside = (1.0 - CONFIDENCE) / 2.0
    found = np.full((2, means.shape[1]), np.nan)
    for column, values in enumerate(means.T):
        there = values[~np.isnan(values)]
        if len(there):
            found[:, column] = np.quantile(there, (outside, 1.0 - outside))
    return found
