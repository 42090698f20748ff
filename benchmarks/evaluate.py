# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cells an hour for one worker and two, Dask's share, and the client's memory."""

import argparse
from pathlib import Path
import resource
import tempfile
import time

from crgame_ros.evaluation.evaluation import Computing, evaluate, EvaluationTally
from crgame_ros.evaluation.plan import EvaluationPlan, PlannerChoice
from crgame_ros.paths import scenarios_directory
import pyarrow.dataset as ds

COLUMNS = f'{"workers":>8}{"cells":>7}{"wall [s]":>10}{"cells/h":>9}{"a cell, median [s]":>20}' \
          f'{"worst":>8}{"computing":>11}{"Dask and rest":>15}{"client [MB]":>13}'


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
        if tally.done % 50 == 0:
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


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--games', nargs='+', default=[str(scenarios_directory() / 'cut_in.yaml')])
    parser.add_argument('--scenarios', nargs='+', default=[])
    parser.add_argument('--planners', default='idm')
    parser.add_argument('--seeds', type=int, default=200)
    parser.add_argument('--duration', type=float, default=10.0, help='of a cell [s]')
    parser.add_argument('--workers', type=int, nargs='+', default=[1, 2])
    values = parser.parse_args()
    plan = EvaluationPlan(
        () if values.scenarios else tuple(values.games), tuple(values.scenarios),
        planners=tuple(map(PlannerChoice, values.planners.split(','))), seeds=values.seeds,
        duration=values.duration, base=Path.cwd())
    print(COLUMNS)
    for workers in values.workers:
        measure(plan, workers)


if __name__ == '__main__':
    main()
