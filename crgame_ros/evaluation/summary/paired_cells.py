# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cells of two planners that are alike in everything else."""

from dataclasses import dataclass

from crgame_ros.evaluation.summary.cell_block import CellBlock, IntArray
from crgame_ros.evaluation.summary.evaluated_parts import TEXT_FACTORS
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Values that differ by no more of the greater one are the same.
SAME = 1e-12


@dataclass(frozen=True)
class PairedCells:
    """
    The pairs (P) of a block.

    :param rows: (P) of the cells of other planners.
    :param baseline: (P) of those of the baseline planner.
    :param unpaired: rows of cells of other planners that have no such cell.
    """

    rows: IntArray
    baseline: IntArray
    unpaired: IntArray

    def differences(self, sums: FloatArray, counts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """
        Subtract the mean of the baseline's cell from that of the other.

        :param sums: (N, measures) of all cells of the block.
        :param counts: (N, measures) of how many values each is.
        :return: (P, measures) differences, 0 where there is none, and 1 where there is one.
        """
        with np.errstate(invalid='ignore', divide='ignore'):
            means = sums / counts
        own, other = means[self.rows], means[self.baseline]
        found = own - other
        # The last bits of equal values are no difference.
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
