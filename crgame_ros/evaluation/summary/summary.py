# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the cells of an evaluation say together."""

from dataclasses import asdict, dataclass
import math
from pathlib import Path
import re
import shlex
from typing import Any, Literal

from crgame_ros.evaluation.summary.measures import SummaryMeasure

_KEY = re.compile('[0-9a-f]{32}')


@dataclass(frozen=True)
class Estimate:
    """
    A mean, or a mean difference, with its interval.

    :param value: NaN where nothing is known.
    :param low: lower bound of the interval; NaN where there is none.
    :param high: upper bound.
    :param n: values that it is the mean of: AVs, cells or pairs.
    :param units: scenarios or cells with such values, of those that are drawn.
    """

    value: float
    low: float
    high: float
    n: int
    units: int

    @property
    def side(self) -> int:
        """Return the side of zero on which the whole interval is; 0 where it is on both."""
        return 1 if self.low > 0.0 else -1 if self.high < 0.0 else 0


@dataclass(frozen=True)
class GroupMeans:
    """
    The means of a group of cells.

    :param labels: of the group, in the order of `Summary.by`.
    :param cells: that are finished, well or not.
    :param failed: of these.
    :param scenarios: how many different ones.
    :param resampled: what was drawn for the intervals.
    :param estimates: in the order of `Summary.measures`.
    """

    labels: tuple[str, ...]
    cells: int
    failed: int
    scenarios: int
    resampled: Literal['scenarios', 'cells']
    estimates: tuple[Estimate, ...]


@dataclass(frozen=True)
class PairedDifferences:
    """
    How a group differs from the baseline planner in cells that are alike in all else.

    :param labels: of the group.
    :param pairs: of cells that both ended well.
    :param failed: pairs of which the group's cell alone failed.
    :param baseline_failed: pairs of which the baseline's cell alone failed.
    :param both_failed: pairs of which both did.
    :param unpaired: cells of the group of which the baseline has none yet.
    :param scenarios: how many different ones the pairs are of.
    :param resampled: what was drawn for the intervals.
    :param estimates: group minus baseline, in the order of `Summary.measures`.
    """

    labels: tuple[str, ...]
    pairs: int
    failed: int
    baseline_failed: int
    both_failed: int
    unpaired: int
    scenarios: int
    resampled: Literal['scenarios', 'cells']
    estimates: tuple[Estimate, ...]


@dataclass(frozen=True)
class WorstCell:
    """
    A cell, by its worst AV.

    :param key: of the cell.
    :param factors: its labels and its seed, in the order of `FACTORS`.
    :param vehicle: id of that AV.
    :param values: by which it was chosen, in the order of `Summary.worst_by`.
    """

    key: str
    factors: tuple[str, ...]
    vehicle: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class FailureReason:
    """
    Cells that failed in the same way.

    :param status: how.
    :param reason: why.
    :param cells: how many, by labels of their groups.
    :param example: key of one of them.
    :param traceback: of that one, if it left one.
    """

    status: str
    reason: str
    cells: tuple[tuple[tuple[str, ...], int], ...]
    example: str
    traceback: str

    @property
    def count(self) -> int:
        """Count its cells."""
        return sum(cells for _, cells in self.cells)


@dataclass(frozen=True)
class Summary:
    """
    An evaluation, summed up.

    :param folder: of the evaluation.
    :param by: factors that make the groups.
    :param baseline: planner from which differences are told; empty for none.
    :param measures: of which there are means.
    :param scenarios: how many different ones.
    :param groups: in the order of their labels.
    :param differences: in the same order.
    :param worst_by: measures by which the worst cells are chosen, the first one first.
    :param worst: the worst cells, the worst one first.
    :param failures: most frequent first.
    :param resamples: how many were drawn.
    :param seed: of the draws.
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
    resamples: int
    seed: int

    @property
    def cells(self) -> int:
        """Count the cells that are finished."""
        return sum(group.cells for group in self.groups)

    @property
    def failed(self) -> int:
        """Count those that failed."""
        return sum(group.failed for group in self.groups)

    def report(self, key: str) -> Path | None:
        """Find the report of a cell; None if it has none yet."""
        # Whatever else stands for a key in a part leads nowhere.
        path = self.folder / 'reports' / f'{key}.html'
        return path if _KEY.fullmatch(key) and path.is_file() else None

    def report_command(self, key: str) -> str:
        """Return the command that runs a cell again and writes its report."""
        return shlex.join(('crgame', 'evaluate', str(self.folder), '--cell', key))

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON has it: SI units, null for what is not known."""
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
        whole: dict[str, Any] = _known(found)
        return whole


def _known(value: Any) -> Any:
    """Replace what JSON cannot say."""
    if isinstance(value, dict):
        return {key: _known(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_known(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
