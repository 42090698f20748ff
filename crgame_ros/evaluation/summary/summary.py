# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The summary of an evaluation's cells, as data."""

from dataclasses import asdict, dataclass
from pathlib import Path
import re
import shlex
from typing import Literal

from crgame_ros.evaluation.summary.measures import SummaryMeasure
from crgame_ros.finite_json import finite

_KEY = re.compile('[0-9a-f]{32}')
Clustered = Literal['scenarios', 'scenarios and participants', 'participants', 'runs']


@dataclass(frozen=True)
class Estimate:
    """
    A mean, or a mean difference, with its interval.

    :param value: NaN where there is no value.
    :param low: lower bound of the interval; NaN where there is none.
    :param high: upper bound.
    :param n: number of cells, or pairs of cells, with a value.
    :param clusters: number of scenarios with such values; of one scenario, that of participants
        or different runs.
    :param p: probability of a value at least as far from 0 if the true one is 0; NaN without an
        interval.
    :param beyond_chance: of a difference, whether it is told from 0 among all of them.
    """

    value: float
    low: float
    high: float
    n: int
    clusters: int
    p: float
    beyond_chance: bool = False

    def side(self, negligible: float) -> int:
        """Return the sign of a difference beyond chance that is not negligible; 0 of others."""
        if not self.beyond_chance or abs(self.value) < negligible:
            return 0
        return 1 if self.value > 0.0 else -1


@dataclass(frozen=True)
class GroupMeans:
    """
    The means of a group of cells.

    :param labels: labels of the group, in the order of `Summary.by`.
    :param cells: number of finished cells, failed ones included.
    :param failed: number of failed cells.
    :param scenarios: number of different scenarios.
    :param participants: number of different participants who drove recorded runs.
    :param runs: number of different runs: cells whose states are equal are one run.
    :param clustered: what varies by chance: scenarios and those who drove in them, or runs of one
        scenario.
    :param estimates: in the order of `Summary.measures`.
    """

    labels: tuple[str, ...]
    cells: int
    failed: int
    scenarios: int
    participants: int
    runs: int
    clustered: Clustered
    estimates: tuple[Estimate, ...]


@dataclass(frozen=True)
class PairedDifferences:
    """
    The differences of a group from the baseline planner, in cells equal in all other factors.

    :param labels: labels of the group.
    :param pairs: number of pairs in which both cells succeeded.
    :param failed: number of pairs in which only the group's cell failed.
    :param baseline_failed: number of pairs in which only the baseline's cell failed.
    :param both_failed: number of pairs in which both failed.
    :param unpaired: number of the group's cells without a counterpart of the baseline so far.
    :param scenarios: number of different scenarios of the pairs.
    :param participants: number of their different participants.
    :param runs: number of different pairs of runs.
    :param clustered: likewise.
    :param estimates: group minus baseline, in the order of `Summary.measures`.
    """

    labels: tuple[str, ...]
    pairs: int
    failed: int
    baseline_failed: int
    both_failed: int
    unpaired: int
    scenarios: int
    participants: int
    runs: int
    clustered: Clustered
    estimates: tuple[Estimate, ...]


@dataclass(frozen=True)
class WorstCell:
    """
    One of the worst cells, judged by its worst AV.

    :param factors: its labels and its seed, in the order of `FACTORS`.
    :param vehicle: id of that AV.
    :param values: values by which it was chosen, in the order of `Summary.worst_by`.
    """

    key: str
    factors: tuple[str, ...]
    vehicle: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class FailureReason:
    """
    Cells that failed in the same way.

    :param status: kind of failure.
    :param cells: number of cells, by labels of their groups.
    :param example: key of one of the cells.
    :param traceback: traceback of that cell, if there is one.
    """

    status: str
    reason: str
    cells: tuple[tuple[tuple[str, ...], int], ...]
    example: str
    traceback: str

    @property
    def count(self) -> int:
        """Return the number of its cells."""
        return sum(cells for _, cells in self.cells)


@dataclass(frozen=True)
class Summary:
    """
    The summary of an evaluation.

    :param by: factors that define the groups.
    :param baseline: planner with which others are compared; empty for none.
    :param measures: measures with means.
    :param scenarios: number of different scenarios.
    :param groups: in the order of their labels.
    :param differences: in the same order.
    :param worst_by: measures by which the worst cells are chosen, in order of priority.
    :param worst: the worst cells, the worst one first.
    :param failures: most frequent first.
    """

    folder: Path
    by: tuple[str, ...]
    baseline: str
    measures: tuple[SummaryMeasure, ...]
    scenarios: int
    groups: tuple[GroupMeans, ...]
    differences: tuple[PairedDifferences, ...]
    worst_by: tuple[SummaryMeasure, ...]
    worst: tuple[WorstCell, ...]
    failures: tuple[FailureReason, ...]

    @property
    def cells(self) -> int:
        """Return the number of finished cells."""
        return sum(group.cells for group in self.groups)

    @property
    def failed(self) -> int:
        """Return the number of failed cells."""
        return sum(group.failed for group in self.groups)

    def report(self, key: str) -> Path | None:
        """Return the path of a cell's report; None if it has none yet."""
        # Refuse texts of a part that are not a key: the path must stay in the folder.
        path = self.folder / 'reports' / f'{key}.html'
        return path if _KEY.fullmatch(key) and path.is_file() else None

    def report_command(self, key: str) -> str:
        """Return the command that runs a cell again and writes its report."""
        return shlex.join(('crgame', 'evaluate', str(self.folder), '--cell', key))

    def as_dict(self) -> dict[str, object]:
        """Return the summary as a JSON-compatible dictionary: SI units, None if unknown."""
        found = asdict(self)
        found['folder'] = str(self.folder)
        found['measures'] = {each.name: {'unit': each.unit, 'definition': each.definition}
                             for each in self.measures}
        found['worst_by'] = [each.name for each in self.worst_by]
        for entries in (found['groups'], found['differences']):
            for entry in entries:
                entry['estimates'] = dict(zip(found['measures'], entry['estimates'], strict=True))
        for failure in found['failures']:
            failure['cells'] = [{'labels': labels, 'cells': cells}
                                for labels, cells in failure['cells']]
        return finite(found)
