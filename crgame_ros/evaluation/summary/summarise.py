# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Summarises an evaluation: means, paired differences, worst cells, failures.

The cells are read in blocks, twice: first they are counted, then their measures are read. Memory
in between grows with planners, scenarios and measures, not with cells.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from crgame_ros.errors import InputError, short
from crgame_ros.evaluation.results.cell_rows import TEXT_FACTORS
from crgame_ros.evaluation.summary.cell_block import (
    BLOCK_CELLS,
    CellBlock,
    CellBlocks,
    EvaluatedParts,
)
from crgame_ros.evaluation.summary.cell_tally import CellTally, paired_cells, tally_cells
from crgame_ros.evaluation.summary.cluster_means import (
    CellClusters,
    ClusterMeans,
    CountedCells,
    FloatArray,
    holm,
    IntArray,
)
from crgame_ros.evaluation.summary.measures import (
    chosen_measures,
    MEASURES,
    SummaryMeasure,
    WORST_FIRST,
)
from crgame_ros.evaluation.summary.summary import (
    Estimate,
    GroupMeans,
    PairedDifferences,
    Summary,
    WorstCell,
)
from crgame_ros.game.game import DEFAULT_PLANNER
import numpy as np
from numpy.typing import NDArray
import pyarrow as pa
import pyarrow.compute as pc

MOST_CELLS = 10
_Means = dict[int, ClusterMeans]


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

    def means(self, block: CellBlock, measures: Sequence[SummaryMeasure]) -> FloatArray:
        """Return the mean of each cell's AVs (N, measures), NaN where none has a value."""
        found = np.full((len(block.ok), len(measures)), np.nan)
        for column, measure in enumerate(measures):
            if not measure.column:
                found[:, column] = ~block.ok
                continue
            values = self.values[:, column]
            there = ~np.isnan(values)
            sums, counts = (np.bincount(self.cells[there], weights, len(block.ok))
                            for weights in (values[there], None))
            known = counts > 0
            found[known, column] = sums[known] / counts[known]
        return found


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


class WorstCells:
    """
    The worst cells so far, by the worst AV of each.

    :param by: measures to sort by, in order of priority.
    :param columns: columns of these among the values.
    :raises InputError: if a measure does not define which values are worse.
    """

    def __init__(self, by: Sequence[SummaryMeasure], columns: Sequence[int]) -> None:
        for measure in by:
            if not measure.better or not measure.column:
                raise InputError(f'nothing tells a worse {measure.name}', '--worst',
                                 'name a measure of AVs of which less or more is better')
        self._columns = list(columns)
        # With these signs, smaller values are worse.
        self._signs = np.array([float(measure.better) for measure in by])
        self._found: list[tuple[tuple[float, ...], str, WorstCell]] = []

    def add(self, blocks: CellBlocks, block: CellBlock, vehicles: MeasuredVehicles) -> None:
        """Add the cells of a block."""
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


@contextmanager
def _frugal_memory() -> Iterator[None]:
    """Use the system's memory pool for Arrow: Arrow's own keeps several times the used memory."""
    before = pa.default_memory_pool()
    pa.set_memory_pool(pa.system_memory_pool())
    try:
        yield
    finally:
        pa.set_memory_pool(before)


@_frugal_memory()
def summarise(folder: Path, *, measures: Sequence[str] | None = None,
              by: Sequence[str] = ('planner',), baseline: str | None = None,
              worst: Sequence[str] | None = None, block_cells: int = BLOCK_CELLS) -> Summary:
    """
    Summarise the finished cells.

    :param measures: names of measures, or of numeric columns of the table `vehicles`; None for
        all measures available.
    :param by: factors that define groups: cells with equal values of these are a group.
    :param baseline: planner with which others are compared; None for the default planner of
        games, or the first one if the evaluation lacks that.
    :param worst: measures by which the worst cells are chosen; None for collisions, then TTC.
    :param block_cells: approximate number of cells in memory at a time.
    :raises InputError: if an argument cannot be used, or a part cannot be read.
    """
    if not by or not set(by) <= set(TEXT_FACTORS):
        raise InputError(f'{short(list(by))} contains an unknown factor', '--by',
                         f'name some of {", ".join(TEXT_FACTORS)}')
    parts = EvaluatedParts(folder)
    chosen = chosen_measures(measures, parts.columns)
    worst_by = chosen_measures(worst, parts.columns) if worst else tuple(
        MEASURES[name] for name in WORST_FIRST if MEASURES[name].column in parts.columns)
    blocks = CellBlocks(parts, block_cells)
    tally = tally_cells(blocks, by, _baseline(baseline, by, blocks))
    means, differences, found = _sum_up(parts, blocks, tally, chosen, worst_by)
    return Summary(
        folder, tuple(by), tally.baseline, chosen, len(tally.scenarios),
        _groups(tally, means, chosen), _differences(tally, differences, chosen), worst_by,
        found.worst(),
        tally.failures.reasons(parts, tally.groups.labels))


def _baseline(wanted: str | None, by: Sequence[str], blocks: CellBlocks) -> str:
    planners = blocks.planners
    if wanted is not None and 'planner' not in by:
        raise InputError('there are no planners to compare', '--baseline',
                         'name planner among --by')
    if wanted is not None and wanted not in planners:
        raise InputError(f'no planner {short(wanted)} here', '--baseline',
                         f'there are {", ".join(planners)}')
    if len(planners) < 2 or 'planner' not in by:
        return ''
    return wanted or (DEFAULT_PLANNER if DEFAULT_PLANNER in planners else planners[0])


def _sum_up(parts: EvaluatedParts, blocks: CellBlocks, tally: CellTally,
            chosen: Sequence[SummaryMeasure], worst_by: Sequence[SummaryMeasure]
            ) -> tuple[_Means, _Means, WorstCells]:
    """Read all measures block by block."""
    columns = tuple(dict.fromkeys((*chosen, *worst_by)))
    found = WorstCells(worst_by, [columns.index(measure) for measure in worst_by])
    means, differences = ({group: ClusterMeans(len(chosen)) for group in counted}
                          for counted in (tally.cells, tally.pairs))
    for block in blocks:
        vehicles = measured_vehicles(parts, block, columns)
        found.add(blocks, block, vehicles)
        values = vehicles.means(block, columns)[:, :len(chosen)]
        groups, clusters = tally.groups.numbers(block), blocks.clusters(block)
        _add(means, tally.cells, groups, values, clusters)
        if tally.pairs:
            pairs = paired_cells(block, tally.baseline_number)
            _add(differences, tally.pairs, groups[pairs.rows], pairs.differences(values),
                 pairs.clusters(clusters))
    return means, differences, found


def _add(means: _Means, counted: Mapping[int, CountedCells], groups: IntArray,
         values: FloatArray, clusters: CellClusters) -> None:
    for group in np.unique(groups).tolist():
        own = groups == group
        means[group].add(values[own], *clusters.of(own).crossed(counted[group].clustered))


def _groups(tally: CellTally, means: _Means,
            chosen: Sequence[SummaryMeasure]) -> tuple[GroupMeans, ...]:
    return tuple(GroupMeans(
        tally.groups.labels[group], counted.cells, tally.failed[group], len(counted.scenarios),
        len(counted.participants), counted.different_runs, counted.clustered, tuple(
            _within(each, 0.0, measure)
            for each, measure in zip(means[group].estimates(), chosen, strict=True)))
        for group, counted in tally.in_order(tally.cells))


def _within(found: Estimate, least: float, measure: SummaryMeasure) -> Estimate:
    """Return an estimate whose interval is within what a share, or a difference, can be."""
    if not measure.is_share:
        return found
    low, high = np.clip((found.low, found.high), least, 1.0).tolist()
    return replace(found, low=low, high=high)


def _differences(tally: CellTally, differences: _Means,
                 chosen: Sequence[SummaryMeasure]) -> tuple[PairedDifferences, ...]:
    groups = tally.in_order(tally.pairs)
    estimates = [differences[group].estimates() for group, _ in groups]
    # All differences that are told together are judged together.
    judged = iter(holm(each for own in estimates for each in own))
    found = []
    for group, counted in groups:
        # By the success of the group's cell, and of the baseline's.
        outcomes = tally.outcomes[group]
        found.append(PairedDifferences(
            tally.groups.labels[group], outcomes[True, True], outcomes[False, True],
            outcomes[True, False], outcomes[False, False], tally.unpaired[group],
            len(counted.scenarios), len(counted.participants), counted.different_runs,
            counted.clustered,
            tuple(_within(next(judged), -1.0, measure) for measure in chosen)))
    return tuple(found)
