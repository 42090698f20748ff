# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates a plan: has its cells computed, keeps their rows, and computes no cell twice."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from crgame_ros.evaluation.cell import Cell
from crgame_ros.evaluation.cell_grid import CellGrid, make_grid
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.dask_cluster import dask_client
from crgame_ros.evaluation.folder import EvaluationFolder
from crgame_ros.evaluation.plan import EvaluationPlan
from crgame_ros.evaluation.results.cell_rows import CellRows
from crgame_ros.evaluation.results.parts import PART_CELLS, ResultParts

GIGABYTE = 1_000_000_000
# Wall time of a batch of cells: long for the scheduler, and short to be computed again [s].
BATCH_S = 15.0


@dataclass(frozen=True)
class Computing:
    """
    Settings of the computation.

    :param scheduler: address of a Dask scheduler; None starts workers here.
    :param workers: number of processes started here.
    :param dashboard: port of Dask's page on the loopback; None for no page.
    :param timeout_s: wall time after which a cell fails [s]
    :param memory_bytes: greatest data size of a cell.
    :param part_cells: number of cells in a part of the tables.
    :param retry: whether cells that failed are computed again.
    """

    scheduler: str | None = None
    workers: int = 1
    dashboard: int | None = None
    timeout_s: float = 300.0
    memory_bytes: int = 2 * GIGABYTE
    part_cells: int = PART_CELLS
    retry: bool = False


@dataclass
class EvaluationTally:
    """
    The progress of an evaluation.

    :param total: number of cells in the plan.
    :param before: number of these that were finished before.
    :param done: number finished since, failed ones included.
    :param failed: number failed since.
    :param put_away: number of cells in the folder that are not in the plan.
    :param dashboard: address of Dask's page; empty without one.
    :param threads: number of computing threads at the beginning.
    """

    total: int = 0
    before: int = 0
    done: int = 0
    failed: int = 0
    put_away: int = 0
    dashboard: str = ''
    threads: int = 0


# Called with the progress; with a cell and its row when one has ended.
Told = Callable[[EvaluationTally, Cell | None, dict[str, object] | None], object]


def evaluate(plan: EvaluationPlan, folder: Path, computing: Computing | None = None,
             told: Told = lambda _tally, _cell, _row: None,
             loading: Callable[[float], object] = lambda _: None) -> EvaluationTally:
    """
    Compute the unfinished cells of a plan, and write their rows into tables.

    After an interruption for any reason, the same call continues.

    :param folder: folder of the evaluation; it is created, or must be an evaluation's.
    :param told: called with the progress; with a cell and its row when one has ended.
    :param loading: called with the share of the plan loaded so far, 0 to 1.
    :raises InputError: if plan or folder cannot be used.
    :raises CrgameError: if the scheduler is lost; what was finished is kept.
    """
    computing = computing or Computing()
    place = EvaluationFolder(folder)
    place.check()
    # Under the lock: another evaluation that still writes there keeps its plan.
    with ResultParts(folder, computing.part_cells) as parts:
        grid = make_grid(plan, place.store, loading)
        place.begin(plan, grid)
        tally = EvaluationTally(len(grid))
        tally.put_away = _sort(parts, grid, computing.retry)
        finished = {bytes.fromhex(key) for key in parts.keys()}
        tally.before = len(finished)
        if tally.before < tally.total:
            _compute(grid, finished, parts, place.store, computing, tally, told)
        parts.join_parts()
    return tally


def _sort(parts: ResultParts, grid: CellGrid, retry: bool) -> int:
    """Put away the rows of cells that are not in the plan, or are to be computed again."""
    wanted = cache(lambda: {bytes.fromhex(cell.key) for cell in grid})
    return parts.keep_wanted(lambda key, status: bytes.fromhex(key) in wanted()
                             and not (retry and status != 'ok'))


def _compute(grid: CellGrid, finished: set[bytes], parts: ResultParts, store: ContentStore,
             computing: Computing, tally: EvaluationTally,
             told: Told) -> None:
    from crgame_ros.evaluation.cell_batches import CellBatches
    from crgame_ros.evaluation.cell_process import Limits
    cells = (cell for cell in grid if bytes.fromhex(cell.key) not in finished)
    with dask_client(computing.scheduler, computing.workers, computing.dashboard) as client:
        tally.dashboard = client.dashboard_link if computing.dashboard is not None else ''
        batches = CellBatches(client, store, Limits(
            computing.timeout_s, computing.memory_bytes, BATCH_S), cells,
            tally.total - tally.before)
        tally.threads = batches.threads
        told(tally, None, None)
        for ended in batches.results():
            rows = [rows_of(cell, found) for cell, found in ended]
            parts.add(*rows)
            for (cell, _), row in zip(ended, rows, strict=True):
                tally.done += 1
                tally.failed += row['cell']['status'] != 'ok'
                told(tally, cell, row['cell'])


def rows_of(cell: Cell, found: CellRows) -> CellRows:
    """
    Return the rows of a cell with all columns that identify it.

    :param found: its rows, as `cell_run.compute_cell` returns them.
    """
    own = {'cell': cell.key, **cell.factors}
    return {'cell': own | found['cell'],
            'vehicles': [vehicle | own for vehicle in found['vehicles']],
            'work': {'cell': cell.key, **found['work']}}
