# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pairs of cells of two planners that are equal in all other factors."""

from dataclasses import dataclass

from crgame_ros.evaluation.summary.cell_block import CellBlock, IntArray
from crgame_ros.evaluation.summary.evaluated_parts import TEXT_FACTORS
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Values with a smaller relative difference are equal.
SAME = 1e-12


@dataclass(frozen=True)
class PairedCells:
    """
    The pairs (P) of a block.

    :param rows: (P) rows of the cells of other planners.
    :param baseline: (P) rows of the cells of the baseline planner.
    :param unpaired: rows of cells of other planners without a counterpart of the baseline.
    """

    rows: IntArray
    baseline: IntArray
    unpaired: IntArray

    def differences(self, sums: FloatArray, counts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """
        Return the mean of each cell minus that of the baseline's cell.

        :param sums: (N, measures) sums of all cells of the block.
        :param counts: (N, measures) number of values in each sum.
        :return: (P, measures) differences, 0 where there is none; and 1 where there is one or 0.
        """
        with np.errstate(invalid='ignore', divide='ignore'):
            means = sums / counts
        own, other = means[self.rows], means[self.baseline]
        found = own - other
        # Rounding errors of equal values are no difference.
        found[np.abs(found) <= SAME * np.maximum(np.abs(own), np.abs(other))] = 0.0
        there = ~np.isnan(found)
        return np.where(there, found, 0.0), there.astype(float)


def paired_cells(block: CellBlock, baseline: int) -> PairedCells:
    """
    Pair the cells of a block.

    :param baseline: number of the baseline planner's label.
    """
    own = block.labels[:, TEXT_FACTORS.index('planner')] == baseline
    theirs, others = np.flatnonzero(own), np.flatnonzero(~own)
    if not len(theirs):
        return PairedCells(np.empty(0, np.int64), np.empty(0, np.int64), others)
    theirs = theirs[np.argsort(block.pairs[theirs], kind='stable')]
    known = block.pairs[theirs]
    place = np.minimum(np.searchsorted(known, block.pairs[others]), len(known) - 1)
    paired = known[place] == block.pairs[others]
    return PairedCells(others[paired], theirs[place[paired]], others[~paired])
