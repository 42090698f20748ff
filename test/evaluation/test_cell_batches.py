# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cells go to workers in batches, and each is a row, whatever happens to its batch."""

from collections import Counter
from collections.abc import Iterator
import json
from pathlib import Path
from typing import Any

from crgame_ros.evaluation import dask_cluster, evaluation
from crgame_ros.evaluation.cell_process import CellProcess, compute
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.evaluation import Computing, evaluate
from crgame_ros.evaluation.plan import parse_plan
from crgame_ros.evaluation.results.parts import ResultParts
from crgame_ros.paths import scenarios_directory
from distributed import Client, LocalCluster
import pyarrow.parquet as pq
import pytest

GAME = scenarios_directory() / 'cut_in.yaml'
THREADS = 2
PLANNER = """
import os
import signal
import time
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner


class Mine(ConstantVelocityPlanner):
    def setup(self, context):
        super().setup(context)
        if context.seed == 7:
            os.abort()
        if context.seed == 8:
            os.kill(os.getppid(), signal.SIGKILL)
            time.sleep(60.0)
        if context.seed == 9:
            time.sleep(60.0)
"""


class Workers:
    """
    Workers in this process, whose cells do nothing.

    :ivar address: of their scheduler.
    :ivar wall_s: time that each cell says it took [s]
    :ivar batches: seeds of each batch that was sent, in their order.
    :ivar computed: how often each cell was computed.
    """

    def __init__(self, address: str, monkeypatch: pytest.MonkeyPatch) -> None:
        self.address, self.wall_s = address, 0.1
        self.batches: list[list[int]] = []
        self.computed: Counter[str] = Counter()
        submit = Client.submit

        def counted(client: Client, task: Any, *given: Any, **options: Any) -> Any:
            if task is compute:
                self.batches.append([seed for _, seeds in json.loads(given[0]) for seed in seeds])
            return submit(client, task, *given, **options)

        def nothing(_process: CellProcess, cell: str, _timeout_s: float) -> dict[str, Any]:
            self.computed[cell] += 1
            return {'cell': {'status': 'ok'}, 'vehicles': [], 'work': {'wall_s': self.wall_s}}

        monkeypatch.setattr(Client, 'submit', counted)
        monkeypatch.setattr(CellProcess, 'compute', nothing)

    def evaluate(self, folder: Path, **plan: Any) -> list[dict[str, Any]]:
        """Evaluate a plan; return the rows of its cells."""
        values = {'games': [str(GAME)], 'planners': ['idm'], **plan}
        evaluate(parse_plan(values, 'plan', folder), folder / 'out', Computing(self.address))
        return cells_in(folder)


def cells_in(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of all cells."""
    return [row for path in sorted((folder / 'out' / 'cells').glob('part-*.parquet'))
            for row in pq.read_table(path).to_pylist()]


@pytest.fixture(scope='module')
def address() -> Iterator[str]:
    """Return the address of a scheduler with workers in this process."""
    with LocalCluster(n_workers=THREADS, threads_per_worker=1, processes=False,
                      dashboard_address=None, worker_dashboard_address=None) as cluster:
        yield cluster.scheduler_address


@pytest.fixture
def workers(address: str, monkeypatch: pytest.MonkeyPatch) -> Workers:
    """Return workers whose cells do nothing."""
    return Workers(address, monkeypatch)


def test_batches_take_their_time_and_get_smaller_at_the_end(workers: Workers,
                                                            tmp_path: Path) -> None:
    """Of cells of 0.1 s, 150 fit into 15 s, but each thread has two batches to come."""
    cells = workers.evaluate(tmp_path, seeds=2000)
    assert sorted(row['seed'] for row in cells) == [*range(2000)]
    assert set(workers.computed.values()) == {1} and len(workers.computed) == 2000
    batches = workers.batches
    assert [seed for batch in batches for seed in batch] == [*range(2000)]
    assert [len(batch) for batch in batches[:4]] == [1] * 4
    assert [len(batch) for batch in batches[4:]] == [
        max(1, min(150, (2000 - batch[0]) // (2 * THREADS))) for batch in batches[4:]]
    # The tail halves about every third batch.
    assert len(batches) < 45


def test_fast_cells_share_a_journal_write_and_slow_ones_a_task_each(
        workers: Workers, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[int] = []
    add = ResultParts.add
    monkeypatch.setattr(ResultParts, 'add', lambda parts, *cells: written.append(len(cells))
                        or add(parts, *cells))
    workers.evaluate(tmp_path, seeds=300)
    assert sorted(written) == sorted(map(len, workers.batches))
    workers.batches.clear()
    workers.wall_s = 20.0
    workers.evaluate(tmp_path, seeds=320)
    assert [len(batch) for batch in workers.batches] == [1] * 20


def test_contents_of_a_scene_are_packed_once(workers: Workers, tmp_path: Path,
                                             monkeypatch: pytest.MonkeyPatch) -> None:
    packed: list[str] = []
    pack = ContentStore.packed
    monkeypatch.setattr(ContentStore, 'packed', lambda store, digest: packed.append(digest)
                        or pack(store, digest))
    cells = workers.evaluate(tmp_path, games=[str(GAME), str(GAME.with_name('merge.yaml'))],
                             planners=['idm', 'reactive'], seeds=40)
    assert len(cells) == 160
    # Scenario and keys of each of two games.
    assert len(packed) == len(set(packed)) == 4


def test_cells_that_a_batch_has_no_time_for_are_sent_again(
        workers: Workers, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Here a batch has no time at all: each ends after its first cell."""
    monkeypatch.setattr(evaluation, 'BATCH_S', 1e-9)
    workers.wall_s = 0.0
    cells = workers.evaluate(tmp_path, seeds=60)
    assert sorted(row['seed'] for row in cells) == [*range(60)]
    assert set(workers.computed.values()) == {1} and len(workers.computed) == 60
    assert len(workers.batches) == 60 and max(map(len, workers.batches)) > 1


def test_a_stop_keeps_the_batches_that_ended(workers: Workers, tmp_path: Path) -> None:
    """Only cells of batches that had not ended are computed again."""
    plan = parse_plan({'games': [str(GAME)], 'planners': ['idm'], 'seeds': 600}, 'plan', tmp_path)

    def stop(tally: evaluation.EvaluationTally, *_: object) -> None:
        if tally.done >= 200:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluate(plan, tmp_path / 'out', Computing(workers.address, part_cells=64), stop)
    with ResultParts(tmp_path / 'out') as parts:
        kept = set(parts.keys())
    assert 200 <= len(kept) < 600
    # Two batches for each thread were sent, and had not ended.
    sent = sum(map(len, workers.batches))
    assert sent - len(kept) <= sum(sorted(map(len, workers.batches))[-2 * THREADS:])
    workers.batches.clear()
    evaluate(plan, tmp_path / 'out', Computing(workers.address))
    assert sum(map(len, workers.batches)) == 600 - len(kept)
    rows = [row['cell'] for row in cells_in(tmp_path)]
    assert len(rows) == len(set(rows)) == 600


@pytest.mark.exhaustive
def test_whatever_a_cell_does_the_others_of_its_batch_are_whole(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One kills its process, one the worker with all that waits there, and one hangs."""
    monkeypatch.setattr(dask_cluster, 'ALLOWED_FAILURES', 0)
    (tmp_path / 'mine.py').write_text(PLANNER)
    plan = parse_plan({'games': [str(GAME)], 'planners': ['mine.py:Mine'], 'seeds': 24,
                       'duration': 0.2}, 'plan', tmp_path)
    tally = evaluate(plan, tmp_path / 'out', Computing(workers=2, timeout_s=10.0))
    assert (tally.done, tally.failed) == (24, 3)
    cells = cells_in(tmp_path)
    assert sorted(row['seed'] for row in cells) == [*range(24)]
    failed = {row['seed']: (row['status'], row['reason'])
              for row in cells if row['status'] != 'ok'}
    assert failed == {7: ('died', 'its process ended with SIGABRT'),
                      8: ('died', 'its workers ended one after the other'),
                      9: ('timeout', 'not done after 10 s of wall time')}
