# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sends cells to workers in batches, sized by the time that cells take; collects their rows."""

from collections import Counter, deque
from collections.abc import Iterator, Sequence
from itertools import groupby, islice
import json
import math
import time
from typing import NamedTuple

from crgame_ros.errors import CrgameError
from crgame_ros.evaluation.cell import Cell, Condition
from crgame_ros.evaluation.cell_process import compute, Limits, packed_content
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.results.cell_rows import CellRows
from distributed import as_completed, Client, Future
from distributed.scheduler import KilledWorker

# Batches submitted per computing thread: one that it computes, and one that follows.
AHEAD = 2
# Number of cells in a batch at most: their rows are in memory together.
MOST_CELLS = 256
# The scheduler counts its workers in 35 ms where there are 500: it is asked at this period [s].
COUNT_S = 2.0
# How often a cell is submitted again, alone, if its batch was cancelled or killed its workers.
_ROUNDS = 2


class Batch(NamedTuple):
    """
    Cells that a worker computes one after the other.

    :param rounds: how often they were sent before to workers that ended.
    """

    cells: Sequence[Cell]
    rounds: int = 0

    @property
    def conditions(self) -> list[tuple[Condition, list[int]]]:
        """Return the conditions of its cells, with the seeds of each."""
        groups = (list(group) for _, group in groupby(self.cells, lambda cell: id(cell.condition)))
        return [(group[0].condition, [cell.seed for cell in group]) for group in groups]

    @property
    def text(self) -> str:
        """Return its conditions and their seeds as JSON."""
        return f'[{",".join(f"[{given.text},{seeds}]" for given, seeds in self.conditions)}]'

    @property
    def contents(self) -> list[str]:
        """Return the digests of the contents that it needs, sorted."""
        return sorted({digest for given, _ in self.conditions for digest in given.contents})


class CellBatches:
    """
    The batches in computation: enough that no worker waits, collected as they end.

    :param number: their number.
    """

    def __init__(self, client: Client, store: ContentStore, limits: Limits, cells: Iterator[Cell],
                 number: int) -> None:
        self._client, self._store, self._limits = client, store, limits
        self._cells, self._unsent = cells, number
        # Cells that their batch had no time for, and batches whose workers ended.
        self._left: deque[Cell] = deque()
        self._again: deque[Batch] = deque()
        self._out: dict[object, Batch] = {}
        # Contents of the batches in computation, and the number of these batches for each.
        self._contents: dict[str, Future] = {}
        self._uses: Counter[str] = Counter()
        self._threads, self._counted_s = 0, -math.inf
        # Wall time of a cell in the batch that ended last; infinite before the first [s].
        self._cell_s = math.inf
        self._ended = as_completed(loop=client.loop)

    def results(self) -> Iterator[list[tuple[Cell, CellRows]]]:
        """
        Compute the cells.

        :return: the cells of each batch with their rows, in the order in which batches end.
        :raises CrgameError: if the scheduler is lost.
        """
        self._send_all()
        while self._out:
            future = next(self._ended)
            batch = self._out.pop(future)
            rows = self._rows(future, batch)
            future.release()
            # Before contents are released: the next batches may need them.
            self._send_all()
            self._release(batch)
            yield rows

    @property
    def threads(self) -> int:
        """Return the number of computing threads, counted every few seconds."""
        if time.monotonic() - self._counted_s > COUNT_S:
            # Without a scheduler there are none; the next result tells of it.
            workers = self._client.scheduler_info(n_workers=-1).get('workers', {})
            self._threads = sum(worker['nthreads'] for worker in workers.values())
            self._counted_s = time.monotonic()
        return self._threads

    @property
    def size(self) -> int:
        """
        Return the number of cells of the next batch.

        They take about the time of a batch, but every thread has two more batches to come. It is
        one cell until it is known how long one takes.
        """
        fitting = self._limits.batch_s / max(self._cell_s, self._limits.batch_s / MOST_CELLS)
        return max(1, min(int(fitting), self._unsent // (2 * max(1, self.threads))))

    def _send_all(self) -> None:
        while len(self._out) < AHEAD * max(2, self.threads) and (batch := self._next()).cells:
            contents = {digest: self._content(digest) for digest in batch.contents}
            self._uses.update(contents.keys())
            future = self._client.submit(compute, batch.text, contents, self._limits, pure=False)
            self._out[future] = batch
            self._ended.add(future)

    def _next(self) -> Batch:
        """
        Return the next batch; one without cells if there is none for now.

        Cells whose batch lost its workers come last, one by one: what else is on a worker that is
        killed seems to be the cause, too.
        """
        cells = list(islice(iter(self._next_cell, None), self.size))
        self._unsent -= len(cells)
        if not (cells or self._out) and self._again:
            return self._again.popleft()
        return Batch(cells)

    def _next_cell(self) -> Cell | None:
        return self._left.popleft() if self._left else next(self._cells, None)

    def _content(self, digest: str) -> Future:
        if digest not in self._contents:
            self._contents[digest] = self._client.submit(
                packed_content, self._store.packed(digest), key=f'content-{digest}')
        return self._contents[digest]

    def _release(self, batch: Batch) -> None:
        for digest in batch.contents:
            self._uses[digest] -= 1
            if not self._uses[digest]:
                del self._uses[digest]
                self._contents.pop(digest).release()

    def _rows(self, future: Future, batch: Batch) -> list[tuple[Cell, CellRows]]:
        """
        Return the rows of a batch that has ended; keep the cells without rows to be sent again.

        :raises CrgameError: if no worker can compute cells.
        """
        if self._client.status != 'running':
            raise CrgameError('the scheduler is gone; what was finished is kept: the same command '
                              'goes on')
        if future.status == 'finished':
            rows: list[CellRows] = [json.loads(text) for text in future.result()]
            left = batch.cells[len(rows):]
            self._left.extend(left)
            self._unsent += len(left)
            self._cell_s = sum(each['work']['wall_s'] for each in rows) / len(rows)
            return list(zip(batch.cells, rows, strict=False))
        if future.status in ('cancelled', 'lost'):
            return self._ended_without(batch, 'it was cancelled')
        error = future.exception()
        if isinstance(error, KilledWorker):
            return self._ended_without(batch, 'its workers ended one after the other')
        if isinstance(error, CrgameError):
            raise error
        raise CrgameError(f'a worker cannot compute ({type(error).__name__}: {error})')

    def _ended_without(self, batch: Batch, reason: str) -> list[tuple[Cell, CellRows]]:
        """Send each cell again, alone, because one of them may be the cause; or give it up."""
        if batch.rounds < _ROUNDS:
            self._again.extend(Batch((cell,), batch.rounds + 1) for cell in batch.cells)
            return []
        return [(cell, {'cell': {'status': 'died', 'reason': reason}, 'vehicles': [], 'work': {}})
                for cell in batch.cells]
