# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is counted of cells before any measure is read."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from crgame_ros.evaluation.summary.cell_block import CellBlock, CellBlocks, CellGroups, IntArray
from crgame_ros.evaluation.summary.failure_reasons import FailureReasons
from crgame_ros.evaluation.summary.group_bootstrap import DrawnUnits
from crgame_ros.evaluation.summary.paired_cells import paired_cells
import numpy as np


@dataclass
class CellTally:
    """
    The cells, counted.

    :param groups: of the cells.
    :param baseline: planner that others are compared with; empty for none.
    :param baseline_number: of its label.
    :ivar units: cells of each group, by its number.
    :ivar pairs: its pairs with cells of the baseline.
    :ivar failed: its cells that failed.
    :ivar outcomes: its pairs by whether its own cell ended well, and the baseline's.
    :ivar unpaired: its cells of which the baseline has none.
    :ivar failures: why cells failed.
    """

    groups: CellGroups
    baseline: str
    baseline_number: int
    units: dict[int, DrawnUnits] = field(default_factory=dict)
    pairs: dict[int, DrawnUnits] = field(default_factory=dict)
    failed: Counter[int] = field(default_factory=Counter)
    outcomes: dict[int, Counter[tuple[bool, bool]]] = field(default_factory=dict)
    unpaired: Counter[int] = field(default_factory=Counter)
    failures: FailureReasons = field(default_factory=FailureReasons)

    @property
    def scenarios(self) -> set[int]:
        """Return the numbers of all scenarios."""
        return set().union(*(units.clusters for units in self.units.values()))

    def in_order(self, units: Mapping[int, DrawnUnits]) -> list[tuple[int, DrawnUnits]]:
        """Sort what is known of groups by their labels."""
        return sorted(units.items(), key=lambda each: self.groups.labels[each[0]])


def tally_cells(blocks: CellBlocks, by: Sequence[str], baseline: str) -> CellTally:
    """
    Count the cells.

    :param by: factors that make groups.
    :param baseline: planner that others are compared with; empty for none.
    :raises InputError: if a part cannot be read.
    """
    planners = blocks.labels['planner'].texts
    found = CellTally(CellGroups(blocks, by), baseline,
                      planners.index(baseline) if baseline else -1)
    for block in blocks:
        groups, clusters = found.groups.of(block), blocks.clusters(block)
        _count_units(found.units, blocks.count, block.number, groups, clusters)
        found.failed.update(groups[~block.ok].tolist())
        found.failures.add(block, groups)
        if baseline:
            _count_pairs(found, blocks.count, block, groups, clusters)
    return found


def _count_pairs(found: CellTally, blocks: int, block: CellBlock, groups: IntArray,
                 clusters: IntArray) -> None:
    pairs = paired_cells(block, found.baseline_number)
    own_groups = groups[pairs.rows]
    _count_units(found.pairs, blocks, block.number, own_groups, clusters[pairs.rows])
    found.unpaired.update(groups[pairs.unpaired].tolist())
    for group in np.unique(own_groups).tolist():
        own = own_groups == group
        found.outcomes.setdefault(group, Counter()).update(zip(
            block.ok[pairs.rows[own]].tolist(), block.ok[pairs.baseline[own]].tolist(),
            strict=True))


def _count_units(units: dict[int, DrawnUnits], blocks: int, block: int, groups: IntArray,
                 clusters: IntArray) -> None:
    for group in np.unique(groups).tolist():
        own = groups == group
        found = units.setdefault(group, DrawnUnits([0] * blocks))
        found.cells[block] = int(own.sum())
        found.clusters.update(np.unique(clusters[own]).tolist())
