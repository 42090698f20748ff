# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates a plan: sends cells to workers, collects their rows, and computes no cell twice."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import json
import math
from pathlib import Path
import time
from typing import Any

from crgame_ros.errors import CrgameError
from crgame_ros.evaluation.cell import Cell
from crgame_ros.evaluation.cell_grid import CellGrid, make_grid
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.dask_cluster import check_workers, dask_client
from crgame_ros.evaluation.folder import EvaluationFolder
from crgame_ros.evaluation.plan import EvaluationPlan
from crgame_ros.evaluation.results.cell_rows import CELLS
from crgame_ros.evaluation.results.parts import PART_CELLS, ResultParts

GIGABYTE = 1_000_000_000
# Cells submitted per computing thread: enough that none waits, few enough for memory.
AHEAD = 4
# The scheduler counts its workers in 35 ms where there are 500: it is asked at this period [s].
COUNT_S = 2.0
# How often a cell is submitted again if its worker is gone.
_ROUNDS = 5


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
Told = Callable[[EvaluationTally, Cell | None, dict[str, Any] | None], object]


def evaluate(plan: EvaluationPlan, folder: Path, computing: Computing | None = None,
             told: Told = lambda _tally, _cell, _row: None,
             loading: Callable[[float], object] = lambda _: None) -> EvaluationTally:
    """
    Compute the unfinished cells of a plan, and write their rows into tables.

    After an interruption for any reason, the same call continues.

    :param folder: folder of the evaluation; it is created, or must be an evaluation's.
    :param computing: settings of the computation.
    :param told: called with the progress; with a cell and its row when one has ended.
    :param loading: called with the share of the plan loaded so far, 0 to 1.
    :raises InputError: if plan or folder cannot be used.
    :raises CrgameError: if the scheduler is lost; what was finished is kept.
    """
    computing = computing or Computing()
    place = EvaluationFolder(folder)
    grid = make_grid(plan, place.store, loading)
    place.begin(plan, grid)
    with ResultParts(folder, computing.part_cells) as parts:
        tally = EvaluationTally(len(grid))
        tally.put_away = _sort(parts, grid, computing.retry)
        finished = {bytes.fromhex(key) for key in parts.keys()}
        tally.before = len(finished)
        if tally.before < tally.total:
            _compute(grid, finished, parts, place.store, computing, tally, told)
        parts.finish_part()
    return tally


def _sort(parts: ResultParts, grid: CellGrid, retry: bool) -> int:
    """Put away the rows of cells that are not in the plan, or are to be computed again."""
    wanted = {bytes.fromhex(cell.key) for cell in grid}
    return parts.keep_wanted(lambda key, status: bytes.fromhex(key) in wanted
                             and not (retry and status != 'ok'))


def _compute(grid: CellGrid, finished: set[bytes], parts: ResultParts, store: ContentStore,
             computing: Computing, tally: EvaluationTally,
             told: Told) -> None:
    cells = (cell for cell in grid if bytes.fromhex(cell.key) not in finished)
    with dask_client(computing.scheduler, computing.workers, computing.dashboard) as client:
        check_workers(client)
        tally.dashboard = client.dashboard_link if computing.dashboard is not None else ''
        flight = _Flight(client, store, computing)
        tally.threads = flight.threads
        told(tally, None, None)
        for cell, rows in flight.results(cells):
            row = {'cell': cell.key, **cell.factors, **rows['cell']}
            for vehicle in rows['vehicles']:
                vehicle.update({'cell': cell.key, **cell.factors})
            parts.add({CELLS.name.removesuffix('s'): row, 'vehicles': rows['vehicles'],
                       'work': {'cell': cell.key, **rows['work']}})
            tally.done += 1
            tally.failed += row['status'] != 'ok'
            told(tally, cell, row)


class _Flight:
    """The cells in computation: enough that no worker waits, collected as they end."""

    def __init__(self, client: Any, store: ContentStore, computing: Computing) -> None:
        from crgame_ros.evaluation.cell_process import Limits
        self._client, self._store = client, store
        self._limits = Limits(computing.timeout_s, computing.memory_bytes)
        self._out: dict[Any, tuple[Cell, int]] = {}
        # Contents of the cells in computation, and the number of these cells for each.
        self._contents: dict[str, Any] = {}
        self._uses: dict[str, int] = {}
        self._threads, self._counted_s = 0, -math.inf

    def results(self, cells: Iterator[Cell]) -> Iterator[tuple[Cell, dict[str, Any]]]:
        """
        Compute cells.

        :return: each with its rows, in the order in which they end.
        :raises CrgameError: if the scheduler is lost.
        """
        from distributed import as_completed
        ended = as_completed(loop=self._client.loop)
        for cell in cells:
            ended.add(self._send(cell, 0))
            if len(self._out) >= self._room():
                break
        while self._out:
            future = next(ended)
            cell, rounds = self._out.pop(future)
            rows = self._rows(future, rounds)
            future.release()
            if rows is None:
                ended.add(self._send(cell, rounds + 1))
                continue
            self._release(cell)
            while len(self._out) < self._room() and (following := next(cells, None)) is not None:
                ended.add(self._send(following, 0))
            yield cell, rows

    def _room(self) -> int:
        return AHEAD * max(2, self.threads)

    @property
    def threads(self) -> int:
        """Return the number of computing threads, counted every few seconds."""
        if time.monotonic() - self._counted_s > COUNT_S:
            workers = self._client.scheduler_info(n_workers=-1)['workers']
            self._threads = sum(worker['nthreads'] for worker in workers.values())
            self._counted_s = time.monotonic()
        return self._threads

    def _send(self, cell: Cell, rounds: int) -> Any:
        from crgame_ros.evaluation.cell_process import compute
        contents = {}
        for digest in sorted(cell.condition.contents):
            contents[digest] = self._content(digest)
            if not rounds:
                self._uses[digest] = self._uses.get(digest, 0) + 1
        future = self._client.submit(compute, cell.text, contents, self._limits,
                                     key=f'cell-{cell.key}-{rounds}', pure=False)
        self._out[future] = cell, rounds
        return future

    def _content(self, digest: str) -> Any:
        from crgame_ros.evaluation.cell_process import packed_content
        if digest not in self._contents:
            self._contents[digest] = self._client.submit(
                packed_content, self._store.packed(digest), key=f'content-{digest}')
        return self._contents[digest]

    def _release(self, cell: Cell) -> None:
        for digest in cell.condition.contents:
            self._uses[digest] -= 1
            if not self._uses[digest]:
                del self._uses[digest]
                self._contents.pop(digest).release()

    def _rows(self, future: Any, rounds: int) -> dict[str, Any] | None:
        """
        Return the rows of a task that has ended; None where it has to be sent again.

        :raises CrgameError: if no worker can compute cells.
        """
        from distributed.scheduler import KilledWorker
        if self._client.status != 'running':
            raise CrgameError('the scheduler is gone; what was finished is kept: the same command '
                              'goes on')
        if future.status == 'finished':
            rows: dict[str, Any] = json.loads(future.result()['rows'])
            return rows
        if future.status in ('cancelled', 'lost'):
            return self._again(rounds, 'it was cancelled')
        error = future.exception()
        if isinstance(error, KilledWorker):
            return self._again(rounds, 'its workers ended one after the other')
        if isinstance(error, CrgameError):
            raise error
        raise CrgameError(f'a worker cannot compute ({type(error).__name__}: {error})')

    def _again(self, rounds: int, reason: str) -> dict[str, Any] | None:
        if rounds < _ROUNDS:
            return None
        return {'cell': {'status': 'died', 'reason': reason}, 'vehicles': [], 'work': {}}
