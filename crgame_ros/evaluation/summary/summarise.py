# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Summarises an evaluation: means, paired differences, worst cells, failures.

The cells are read in blocks, twice: first they are counted, then their measures are read. Memory
in between grows with planners, scenarios and measures, not with cells.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from crgame_ros.errors import InputError, short
from crgame_ros.evaluation.summary.cell_block import BLOCK_CELLS, CellBlock, CellBlocks
from crgame_ros.evaluation.summary.cell_tally import CellTally, tally_cells
from crgame_ros.evaluation.summary.evaluated_parts import EvaluatedParts, TEXT_FACTORS
from crgame_ros.evaluation.summary.group_bootstrap import FloatArray, GroupBootstrap, IntArray
from crgame_ros.evaluation.summary.measured_vehicles import measured_vehicles, MeasuredVehicles
from crgame_ros.evaluation.summary.measures import (
    chosen_measures,
    MEASURES,
    SummaryMeasure,
    WORST_FIRST,
)
from crgame_ros.evaluation.summary.paired_cells import paired_cells
from crgame_ros.evaluation.summary.summary import GroupMeans, PairedDifferences, Summary, WorstCell
from crgame_ros.game.game import DEFAULT_PLANNER
import numpy as np
import pyarrow as pa

MOST_CELLS = 10


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


RESAMPLES = 2000
_FEWEST_RESAMPLES, _MOST_RESAMPLES = 100, 100_000
# Greatest number of values in resamples, 8 bytes each.
_MOST_NUMBERS = 20_000_000


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
              worst: Sequence[str] | None = None, resamples: int = RESAMPLES, seed: int = 0,
              block_cells: int = BLOCK_CELLS) -> Summary:
    """
    Summarise the finished cells.

    :param folder: folder of the evaluation.
    :param measures: names of measures, or of numeric columns of the table `vehicles`; None for
        all measures available.
    :param by: factors that define groups: cells with equal values of these are a group.
    :param baseline: planner with which others are compared; None for the default planner of
        games, or the first one if the evaluation lacks that.
    :param worst: measures by which the worst cells are chosen; None for collisions, then TTC.
    :param resamples: number of resamples for the intervals.
    :param seed: seed of the resamples.
    :param block_cells: approximate number of cells in memory at a time.
    :raises InputError: if an argument cannot be used, or a part cannot be read.
    """
    if not by or not set(by) <= set(TEXT_FACTORS):
        raise InputError(f'{short(list(by))} cannot be told apart', '--by',
                         f'name some of {", ".join(TEXT_FACTORS)}')
    if not _FEWEST_RESAMPLES <= resamples <= _MOST_RESAMPLES:
        raise InputError(f'is {resamples}', '--resamples',
                         f'give {_FEWEST_RESAMPLES} to {_MOST_RESAMPLES}')
    if not 0 <= seed < 2**63:
        raise InputError(f'is {seed}', 'seed', 'give one from 0 to 2^63 - 1')
    parts = EvaluatedParts(folder)
    chosen = chosen_measures(measures, parts.columns)
    worst_by = chosen_measures(worst, parts.columns) if worst else tuple(
        MEASURES[name] for name in WORST_FIRST if MEASURES[name].column in parts.columns)
    blocks = CellBlocks(parts, block_cells)
    tally = tally_cells(blocks, by, _baseline(baseline, by, blocks))
    drawn = len(tally.units) + len(tally.pairs)
    if drawn * 2 * len(chosen) * resamples > _MOST_NUMBERS:
        raise InputError(f'{len(tally.units)} groups and {len(chosen)} measures are too many',
                         '--by', 'name fewer factors or measures, or take fewer resamples')
    means, differences, found = _sum_up(parts, blocks, tally, chosen, worst_by, (resamples, seed))
    return Summary(
        folder, tuple(by), tally.baseline, chosen, len(tally.scenarios),
        _groups(tally, means), _differences(tally, differences), worst_by, found.worst(),
        tally.failures.reasons(parts, tally.groups.labels), resamples, seed)


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


_Bootstraps = dict[int, GroupBootstrap]


def _sum_up(parts: EvaluatedParts, blocks: CellBlocks, tally: CellTally,
            chosen: Sequence[SummaryMeasure], worst_by: Sequence[SummaryMeasure],
            draws: tuple[int, int]) -> tuple[_Bootstraps, _Bootstraps, WorstCells]:
    """Read all measures block by block; `draws` is the number of resamples and their seed."""
    columns = tuple(dict.fromkeys((*chosen, *worst_by)))
    found = WorstCells(worst_by, [columns.index(measure) for measure in worst_by])
    means, differences = ({group: GroupBootstrap(
        '\0'.join((kind, *tally.groups.labels[group])), each, len(chosen), *draws)
        for group, each in units.items()} for kind, units in (
            ('means', tally.units), ('differences', tally.pairs)))
    for block in blocks:
        vehicles = measured_vehicles(parts, block, columns)
        found.add(blocks, block, vehicles)
        sums, counts = (each[:, :len(chosen)] for each in vehicles.sums(block, columns))
        groups, clusters = tally.groups.numbers(block), blocks.clusters(block)
        _add(means, block.number, groups, (sums, counts, clusters))
        if tally.pairs:
            pairs = paired_cells(block, tally.baseline_number)
            _add(differences, block.number, groups[pairs.rows],
                 (*pairs.differences(sums, counts), clusters[pairs.rows]))
    return means, differences, found


def _add(bootstraps: _Bootstraps, block: int, groups: IntArray,
         values: tuple[FloatArray, FloatArray, IntArray]) -> None:
    for group in np.unique(groups).tolist():
        sums, counts, clusters = (each[groups == group] for each in values)
        bootstraps[group].add(block, sums, counts, clusters)


def _groups(tally: CellTally, means: _Bootstraps) -> tuple[GroupMeans, ...]:
    return tuple(GroupMeans(
        tally.groups.labels[group], sum(units.cells), tally.failed[group], len(units.clusters),
        units.resampled, means[group].estimates())
        for group, units in tally.in_order(tally.units))


def _differences(tally: CellTally, differences: _Bootstraps) -> tuple[PairedDifferences, ...]:
    found = []
    for group, units in tally.in_order(tally.pairs):
        # By the success of the group's cell, and of the baseline's.
        outcomes = tally.outcomes[group]
        found.append(PairedDifferences(
            tally.groups.labels[group], outcomes[True, True], outcomes[False, True],
            outcomes[True, False], outcomes[False, False], tally.unpaired[group],
            len(units.clusters), units.resampled, differences[group].estimates()))
    return tuple(found)
