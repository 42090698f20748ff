# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cells an hour for one worker and two; with --empty, cells a second that client and Dask do."""

import argparse
import json
from pathlib import Path
import resource
import sys
import tempfile
import time
from unittest import mock

from crgame_ros.evaluation.cell_grid import make_grid
from crgame_ros.evaluation.cell_process import CellProcess
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.evaluation import Computing, evaluate, EvaluationTally
from crgame_ros.evaluation.plan import EvaluationPlan, PlannerChoice
from crgame_ros.paths import scenarios_directory
import dask
from distributed import LocalCluster
import pyarrow.dataset as ds

COLUMNS = f'{"workers":>8}{"cells":>7}{"wall [s]":>10}{"cells/h":>9}{"a cell, median [s]":>20}' \
          f'{"worst":>8}{"computing":>11}{"Dask and rest":>15}{"client [MB]":>13}'

SHARES = (0.1, 0.5, 1.0)
# Each worker watches itself and its process, which would be 64 times the same one here.
UNWATCHED = {'distributed.admin.system-monitor.interval': '1h',
             'distributed.admin.tick.interval': '1h',
             'distributed.worker.profile.enabled': False}
EMPTY_COLUMNS = f'{"workers":>8}{"cells":>9}{"wall [s]":>10}{"cells/s":>9}{"CPU/cell [ms]":>15}' \
                f'{"joining [s]":>13}{"parts":>7}{"second start [s]":>18}   memory [MB] at ' \
                + ', '.join(f'{share:.0%}' for share in SHARES)


def memory_mb() -> float:
    """Return the resident memory of this process [MB]."""
    pages = int(Path('/proc/self/statm').read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def measure(plan: EvaluationPlan, workers: int) -> None:
    """Evaluate a plan, and print a row."""
    begun_s, memory = 0.0, []

    def told(tally: EvaluationTally, _cell: object, _row: object) -> None:
        nonlocal begun_s
        begun_s = begun_s or time.perf_counter()
        if not memory or tally.done % 50 == 0:
            memory.append(memory_mb())

    with tempfile.TemporaryDirectory() as folder:
        tally = evaluate(plan, Path(folder) / 'out', Computing(workers=workers), told)
        wall_s = time.perf_counter() - begun_s
        work = ds.dataset(Path(folder) / 'out' / 'work').to_table()
    times_s = sorted(work['wall_s'].to_pylist())
    computing_s = sum(value or 0.0 for value in work['computing_s'].to_pylist())
    rest = 1.0 - sum(times_s) / (wall_s * workers)
    print(f'{workers:>8}{tally.done:>7}{wall_s:>10.1f}{3600.0 * tally.done / wall_s:>9.0f}'
          f'{times_s[len(times_s) // 2]:>20.3f}{times_s[-1]:>8.2f}'
          f'{computing_s / (wall_s * workers):>10.0%}{rest:>14.1%}'
          f'{memory[0]:>7.0f} - {memory[-1]:.0f}', flush=True)


def measure_empty(plan: EvaluationPlan, workers: int) -> None:
    """
    Evaluate cells that compute nothing but have the rows of a real one, and print a row.

    Scheduler, workers and client share this process: its memory and time are those of all.
    """
    memory = dict.fromkeys(SHARES, 0.0)
    begun_s = ended_s = 0.0

    def told(tally: EvaluationTally, _cell: object, _row: object) -> None:
        nonlocal begun_s, ended_s
        ended_s = time.perf_counter()
        begun_s = begun_s or ended_s
        for share in SHARES:
            if tally.done == round(share * tally.total):
                memory[share] = memory_mb()
                print(f'{share:.0%} after {ended_s - begun_s:.0f} s', file=sys.stderr, flush=True)

    with tempfile.TemporaryDirectory() as name, dask.config.set(UNWATCHED), LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=False, memory_limit=0,
            dashboard_address=None, worker_dashboard_address=None) as cluster:
        folder = Path(name) / 'out'
        store = ContentStore(folder / 'files')
        process = CellProcess(store.folder, 2_000_000_000)
        found = process.compute(next(iter(make_grid(plan, store))).text, 300.0)
        process.close()
        found['work']['wall_s'] = 0.0
        rows = json.dumps(found)
        with mock.patch.object(CellProcess, 'compute', lambda *_: json.loads(rows)):
            computing = Computing(cluster.scheduler_address)
            cpu_s = time.process_time()
            tally = evaluate(plan, folder, computing, told)
            joined_s = time.perf_counter()
            cpu_s = time.process_time() - cpu_s
            again = evaluate(plan, folder, computing)
            again_s = time.perf_counter() - joined_s
        assert again.before == tally.done == tally.total
        parts = len(list((folder / 'cells').iterdir()))
    print(f'{workers:>8}{tally.done:>9}{ended_s - begun_s:>10.0f}'
          f'{tally.done / (ended_s - begun_s):>9.0f}{1e3 * cpu_s / tally.done:>15.2f}'
          f'{joined_s - ended_s:>13.1f}{parts:>7}{again_s:>18.1f}   '
          + ', '.join(f'{value:.0f}' for value in memory.values()), flush=True)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--games', nargs='+', default=[str(scenarios_directory() / 'cut_in.yaml')])
    parser.add_argument('--scenarios', nargs='+', default=[])
    parser.add_argument('--planners', default='idm')
    parser.add_argument('--seeds', type=int, default=200)
    parser.add_argument('--duration', type=float, default=10.0, help='of a cell [s]')
    parser.add_argument('--workers', type=int, nargs='+', default=[1, 2])
    parser.add_argument('--empty', action='store_true',
                        help='of cells that compute nothing, by workers in this process')
    values = parser.parse_args()
    plan = EvaluationPlan(
        () if values.scenarios else tuple(values.games), tuple(values.scenarios),
        planners=tuple(map(PlannerChoice, values.planners.split(','))), seeds=values.seeds,
        duration=values.duration, base=Path.cwd())
    print(EMPTY_COLUMNS if values.empty else COLUMNS)
    for workers in values.workers:
        (measure_empty if values.empty else measure)(plan, workers)


if __name__ == '__main__':
    main()
