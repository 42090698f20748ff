# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Counts of cells, made before any measure is read."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from crgame_ros.evaluation.results.cell_rows import TEXT_FACTORS
from crgame_ros.evaluation.summary.cell_block import (
    CellBlock,
    CellBlocks,
    CellGroups,
    EvaluatedParts,
    IntArray,
    mixed,
)
from crgame_ros.evaluation.summary.cluster_means import CellClusters, CountedCells
from crgame_ros.evaluation.summary.summary import FailureReason
import numpy as np
from numpy.typing import NDArray
import pyarrow as pa
import pyarrow.compute as pc

FloatArray = NDArray[np.float64]

# Greatest numbers of different reasons that are counted separately, and that are shown.
_MOST_COUNTED, MOST_TOLD = 1000, 20
_OTHER = 'other reasons'
# Length of a traceback's end that is kept [characters].
_LONGEST_TRACEBACK = 6000
# Rows are read in small batches, because tracebacks are long.
_BATCH_ROWS = 1024


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

    def differences(self, values: FloatArray) -> FloatArray:
        """
        Return the value of each cell minus that of the baseline's cell, NaN without either.

        :param values: (N, measures) values of all cells of the block.
        :return: (P, measures)
        """
        return np.asarray(values[self.rows] - values[self.baseline])

    def clusters(self, clusters: CellClusters) -> CellClusters:
        """Return those of the pairs, from those of all cells of the block (N)."""
        return clusters.of(self.rows)._replace(
            runs=mixed(clusters.runs[self.rows], clusters.runs[self.baseline]))


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


class FailureReasons:
    """Counts of failed cells, by status and reason."""

    def __init__(self) -> None:
        self._counts: dict[tuple[str, str], Counter[int]] = {}
        self._examples: dict[tuple[str, str], str] = {}

    def add(self, block: CellBlock, groups: IntArray) -> None:
        """
        Count the failures of a block.

        :param groups: (N) number of each cell's group.
        """
        rows = pa.array(np.flatnonzero(~block.ok))
        for status, reason, key, group in zip(
                block.status.take(rows).to_pylist(), block.reasons.take(rows).to_pylist(),
                block.keys.take(rows).to_pylist(), groups[~block.ok].tolist(), strict=True):
            kind = status, reason
            if kind not in self._counts and len(self._counts) >= _MOST_COUNTED:
                kind = status, _OTHER
            self._counts.setdefault(kind, Counter())[group] += 1
            self._examples[kind] = min(key, self._examples.get(kind, key))

    def reasons(self, parts: EvaluatedParts,
                labels: Sequence[tuple[str, ...]]) -> tuple[FailureReason, ...]:
        """
        Return the most frequent reasons, and the rest as one reason for each status.

        :param labels: labels of the groups, by number.
        :raises InputError: if a part cannot be read.
        """
        kinds = sorted(self._counts, key=lambda kind: (-self._counts[kind].total(), kind))
        for kind in kinds[MOST_TOLD:]:
            rest = kind[0], _OTHER
            if kind != rest:
                self._counts.setdefault(rest, Counter()).update(self._counts[kind])
                self._examples.setdefault(rest, self._examples[kind])
        kinds = list(dict.fromkeys((*kinds[:MOST_TOLD],
                                    *((status, _OTHER) for status, _ in kinds[MOST_TOLD:]))))
        tracebacks = _tracebacks(parts, {self._examples[kind] for kind in kinds})
        return tuple(FailureReason(
            *kind, tuple(sorted((labels[group], count)
                                for group, count in self._counts[kind].items())),
            self._examples[kind], tracebacks.get(self._examples[kind], '')) for kind in kinds)


def _tracebacks(parts: EvaluatedParts, keys: set[str]) -> dict[str, str]:
    """Return the tracebacks of cells, for those that have one."""
    found: dict[str, str] = {}
    if not keys:
        return found
    columns = {name: pa.string() for name in ('cell', 'status', 'traceback')}
    examples = pa.array(sorted(keys))
    for batch in parts.batches('cells', columns, _BATCH_ROWS):
        rows = batch.rows.filter(pc.is_in(batch.rows['cell'], value_set=examples))
        for key, status, text in zip(*(rows[name].to_pylist() for name in columns), strict=True):
            if text and status != 'ok':
                found[key] = max(text[-_LONGEST_TRACEBACK:], found.get(key, ''))
    return found


@dataclass
class CellTally:
    """
    The counts of all cells.

    :param baseline: planner that others are compared with; empty for none.
    :param baseline_number: number of its label.
    :ivar cells: cells of each group, by the group's number.
    :ivar pairs: pairs of each group with cells of the baseline.
    :ivar failed: number of each group's failed cells.
    :ivar outcomes: number of pairs, by the success of the group's cell and of the baseline's.
    :ivar unpaired: number of the group's cells without a counterpart of the baseline.
    :ivar failures: reasons of failures.
    """

    groups: CellGroups
    baseline: str
    baseline_number: int
    cells: dict[int, CountedCells] = field(default_factory=dict)
    pairs: dict[int, CountedCells] = field(default_factory=dict)
    failed: Counter[int] = field(default_factory=Counter)
    outcomes: dict[int, Counter[tuple[bool, bool]]] = field(default_factory=dict)
    unpaired: Counter[int] = field(default_factory=Counter)
    failures: FailureReasons = field(default_factory=FailureReasons)

    @property
    def scenarios(self) -> set[int]:
        """Return the numbers of all scenarios."""
        return set().union(*(counted.scenarios for counted in self.cells.values()))

    def in_order(self, counted: Mapping[int, CountedCells]) -> list[tuple[int, CountedCells]]:
        """Return groups with their counts, sorted by labels."""
        return sorted(counted.items(), key=lambda each: self.groups.labels[each[0]])


def tally_cells(blocks: CellBlocks, by: Sequence[str], baseline: str) -> CellTally:
    """
    Count the cells.

    :param by: factors that define groups.
    :param baseline: planner that others are compared with; empty for none.
    :raises InputError: if a part cannot be read.
    """
    planners = blocks.labels['planner'].texts
    found = CellTally(CellGroups(blocks, by), baseline,
                      planners.index(baseline) if baseline else -1)
    for block in blocks:
        groups, clusters = found.groups.numbers(block), blocks.clusters(block)
        _count(found.cells, groups, clusters)
        found.failed.update(groups[~block.ok].tolist())
        found.failures.add(block, groups)
        if baseline:
            _count_pairs(found, block, groups, clusters)
    return found


def _count_pairs(found: CellTally, block: CellBlock, groups: IntArray,
                 clusters: CellClusters) -> None:
    pairs = paired_cells(block, found.baseline_number)
    own_groups = groups[pairs.rows]
    _count(found.pairs, own_groups, pairs.clusters(clusters))
    found.unpaired.update(groups[pairs.unpaired].tolist())
    for group in np.unique(own_groups).tolist():
        own = own_groups == group
        found.outcomes.setdefault(group, Counter()).update(zip(
            block.ok[pairs.rows[own]].tolist(), block.ok[pairs.baseline[own]].tolist(),
            strict=True))


def _count(counted: dict[int, CountedCells], groups: IntArray, clusters: CellClusters) -> None:
    for group in np.unique(groups).tolist():
        counted.setdefault(group, CountedCells()).add(clusters.of(groups == group))
