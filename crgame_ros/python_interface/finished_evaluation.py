# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates planners from Python: computes a plan's cells and reads their tables."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.evaluation import evaluation
from crgame_ros.evaluation.dask_cluster import default_workers, require_dask
from crgame_ros.evaluation.evaluation import Computing, EvaluationTally
from crgame_ros.evaluation.plan import EvaluationPlan, load_plan, parse_plan
from crgame_ros.evaluation.results.cell_rows import TABLES_OF_CELLS
from crgame_ros.python_interface.games import as_path, FileName
import pyarrow as pa
import pyarrow.parquet as pq


@dataclass(frozen=True)
class FinishedEvaluation:
    """
    An evaluation with computed cells.

    :param folder: of the evaluation.
    :param tally: number of cells, and of failed ones.
    """

    folder: Path
    tally: EvaluationTally

    def table(self, name: str) -> pa.Table:
        """
        Read one of its tables.

        :param name: `cells`, `vehicles` or `work`.
        :raises InputError: if there is no such table.
        """
        known = [table.name for table in TABLES_OF_CELLS]
        if name not in known:
            raise InputError(f'is "{name}"', 'table', f'give one of {", ".join(known)}')
        return pq.read_table(self.folder / name)


def evaluate(plan: EvaluationPlan | Mapping[str, object] | FileName, folder: FileName, *,
             computing: Computing | None = None) -> FinishedEvaluation:
    """
    Compute the cells of a plan, as `crgame evaluate` does; finished cells are kept.

    Workers are separate processes, so planners are given by name, not as classes.

    :param plan: a plan, its file, or the content of a file (docs/evaluation.md); file names in it
        are resolved against the file's folder, or the present one.
    :param folder: of the evaluation; an unfinished one is resumed.
    :param computing: the computing resources; None for this machine's cores.
    :raises InputError: if plan or folder cannot be used.
    :raises CrgameError: if Dask is missing, or the scheduler is lost.
    """
    require_dask()
    if isinstance(plan, Mapping):
        chosen = parse_plan(dict(plan), 'plan', Path.cwd())
    elif isinstance(plan, EvaluationPlan):
        chosen = plan
    else:
        chosen = load_plan(as_path(plan, 'plan'))
    out = as_path(folder, 'folder')
    tally = evaluation.evaluate(chosen, out, computing or Computing(workers=default_workers()))
    return FinishedEvaluation(out, tally)
