# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the measures of the AVs in a block's cells."""

from collections.abc import Sequence
from dataclasses import dataclass

from crgame_ros.evaluation.summary.cell_block import CellBlock, IntArray
from crgame_ros.evaluation.summary.evaluated_parts import EvaluatedParts
from crgame_ros.evaluation.summary.measures import SummaryMeasure
import numpy as np
from numpy.typing import NDArray
import pyarrow as pa
import pyarrow.compute as pc

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class MeasuredVehicles:
    """
    The AVs (V) of a block's successful cells, cell by cell.

    :param cells: (V) row of each AV's cell in the block, rising.
    :param ids: (V) ids of the AVs.
    :param values: (V, measures) NaN where there is none.
    """

    cells: IntArray
    ids: NDArray[np.object_]
    values: FloatArray

    def sums(self, block: CellBlock, measures: Sequence[SummaryMeasure]
             ) -> tuple[FloatArray, FloatArray]:
        """
        Return the sums of each cell.

        :return: (N, measures) sums of the values, and the numbers of values.
        """
        sums = np.zeros((len(block.ok), len(measures)))
        counts = np.zeros_like(sums)
        for column, measure in enumerate(measures):
            if not measure.column:
                sums[:, column], counts[:, column] = ~block.ok, 1.0
                continue
            values = self.values[:, column]
            there = ~np.isnan(values)
            sums[:, column], counts[:, column] = (
                np.bincount(self.cells[there], weights, len(block.ok))
                for weights in (values[there], None))
        return sums, counts


def measured_vehicles(parts: EvaluatedParts, block: CellBlock,
                      measures: Sequence[SummaryMeasure]) -> MeasuredVehicles:
    """
    Read the measures of the AVs of a block.

    :raises InputError: if a part cannot be read.
    """
    columns = {'cell': pa.string(), 'vehicle': pa.string(), 'role': pa.string(),
               **{name: pa.float64() for measure in measures for name in measure.columns}}
    keys = block.keys.combine_chunks()
    cells, ids = [np.empty(0, np.int64)], [np.empty(0, object)]
    values = [np.empty((0, len(measures)))]
    for batch in parts.batches('vehicles', columns):
        rows = batch.rows.filter(pc.equal(batch.rows['role'], 'autonomous'))
        place = pc.fill_null(pc.index_in(rows['cell'], value_set=keys), -1).to_numpy()
        mine = np.flatnonzero(place >= 0)
        mine = mine[block.ok[place[mine]]]
        rows = rows.take(pa.array(mine))
        cells.append(place[mine].astype(np.int64))
        ids.append(_texts(rows['vehicle']))
        values.append(np.column_stack([
            measure.values(*(rows[name].to_numpy(zero_copy_only=False)
                             for name in measure.columns))
            if measure.column and batch.columns.issuperset(measure.columns)
            else np.full(len(mine), np.nan) for measure in measures]))
    return _each_once(MeasuredVehicles(
        np.concatenate(cells), np.concatenate(ids), np.concatenate(values)))


def _texts(column: pa.Array) -> NDArray[np.object_]:
    """Return a column of texts (N), equal ones as one object."""
    encoded = pc.fill_null(column, '').dictionary_encode()
    return np.array(encoded.dictionary.to_pylist(), object)[encoded.indices.to_numpy()]


def _each_once(found: MeasuredVehicles) -> MeasuredVehicles:
    """Return one row for each cell and vehicle, sorted: a cell may have been run again."""
    if not len(found.cells):
        return found
    _, ranks = np.unique(found.ids, return_inverse=True)
    order = np.lexsort((ranks, found.cells))
    first = np.ones(len(order), bool)
    first[1:] = (np.diff(found.cells[order]) != 0) | (np.diff(ranks[order]) != 0)
    if not first.all():
        # The row kept does not depend on the order of the rows.
        order = np.lexsort((*found.values.T[::-1], ranks, found.cells))
    order = order[first]
    return MeasuredVehicles(found.cells[order], found.ids[order], found.values[order])
