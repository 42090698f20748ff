# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluating planners from Python: the plan's cells computed, and their tables."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
    An evaluation whose cells are computed.

    :param folder: of it.
    :param tally: how many cells there are, and how many failed.
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


def evaluate(plan: EvaluationPlan | Mapping[str, Any] | FileName, folder: FileName, *,
             computing: Computing | None = None) -> FinishedEvaluation:
    """
    Compute the cells of a plan, as `crgame evaluate` does: what is finished stays finished.

    Workers are processes of their own, so planners are named, not given as classes.

    :param plan: a plan, its file, or what such a file says (docs/evaluation.md); file names in it
        are resolved against the file's folder, or the present one.
    :param folder: of the evaluation; an unfinished one goes on.
    :param computing: where and how; None for this machine's cores.
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
