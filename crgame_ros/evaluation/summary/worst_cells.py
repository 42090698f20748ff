# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The worst cells of an evaluation."""

from collections.abc import Sequence

from crgame_ros.errors import InputError
from crgame_ros.evaluation.summary.cell_block import CellBlock, CellBlocks
from crgame_ros.evaluation.summary.measured_vehicles import MeasuredVehicles
from crgame_ros.evaluation.summary.summary import WorstCell
from crgame_ros.evaluation.summary.summary_measures import SummaryMeasure
import numpy as np

MOST_CELLS = 10


class WorstCells:
    """
    Keeps the worst cells of those that it has seen, by the worst AV of each.

    :param by: measures, the first one first.
    :param columns: of these among the values.
    :raises InputError: if nobody knows which values of a measure are the worse ones.
    """

    def __init__(self, by: Sequence[SummaryMeasure], columns: Sequence[int]) -> None:
        for measure in by:
            if not measure.better or not measure.column:
                raise InputError(f'nothing tells a worse {measure.name}', '--worst',
                                 'name a measure of AVs of which less or more is better')
        self._columns = list(columns)
        # What is worse is smaller.
        self._signs = np.array([float(measure.better) for measure in by])
        self._found: list[tuple[tuple[float, ...], str, WorstCell]] = []

    def add(self, blocks: CellBlocks, block: CellBlock, vehicles: MeasuredVehicles) -> None:
        """Look at the cells of a block."""
        values = vehicles.values[:, self._columns]
        known = np.flatnonzero(~np.isnan(values).all(axis=1))
        ranks = np.nan_to_num(values * self._signs, nan=np.inf)
        order = known[np.lexsort((vehicles.cells[known], *ranks[known].T[::-1]))]
        # The first AV of each cell, in the order of the AVs.
        _, first = np.unique(vehicles.cells[order], return_index=True)
        for row in order[np.sort(first)[:MOST_CELLS]].tolist():
            cell = int(vehicles.cells[row])
            key = block.keys[cell].as_py()
            self._found.append((tuple(ranks[row].tolist()), key, WorstCell(
                key, blocks.factors(block, cell), str(vehicles.ids[row]),
                tuple(values[row].tolist()))))
        self._found = sorted(self._found, key=lambda each: each[:2])[:MOST_CELLS]

    def worst(self) -> tuple[WorstCell, ...]:
        """Return the worst cells, the worst one first."""
        return tuple(cell for _, _, cell in self._found)
