# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whole evaluations by the command, whatever is killed in between."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import shutil
import signal
import socket
import subprocess
import sys
import time
from typing import Any

from crgame_ros.evaluation.results.parts import ResultParts
from crgame_ros.paths import scenarios_directory
import psutil
import pyarrow.parquet as pq
import pytest

ROOT = Path(__file__).resolve().parents[2]
GAME = scenarios_directory() / 'cut_in.yaml'
CELLS = 14
# It prints the cell that it begins, and is slow: a kill comes in the middle of a cell.
PLANNER = """
import os
import time
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner


class Slow(ConstantVelocityPlanner):
    def setup(self, context):
        super().setup(context)
        with open(os.environ['CELLS_BEGUN'], 'a') as file:
            file.write(f'{context.seed}\\n')

    def plan(self, request):
        time.sleep(0.04)
        return super().plan(request)
"""
PLAN = f"""
games: [{GAME}]
planners: ['slow.py:Slow']
seeds: {CELLS}
duration: 0.4
"""


class Evaluation:
    """An evaluation in a folder of its own, run by the command."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(exist_ok=True)
        self.out, self.begun_file = folder / 'out', folder / 'begun.txt'
        (folder / 'slow.py').write_text(PLANNER)
        (folder / 'plan.yaml').write_text(PLAN)
        self._plan = folder / 'plan.yaml'
        self.begun_file.touch()

    def start(self, *arguments: str) -> 'subprocess.Popen[str]':
        """Start the command."""
        return subprocess.Popen(
            [sys.executable, '-m', 'crgame_ros.cli', 'evaluate', str(self._plan), '--out',
             str(self.out), '--part-cells', '4', *arguments],
            cwd=ROOT, env=environment(self.begun_file), stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True, start_new_session=True)

    def run(self, *arguments: str) -> str:
        """Run the command to its end; return its output."""
        process = self.start(*arguments)
        _, told = process.communicate(timeout=240)
        assert process.returncode == 0, told
        return told

    @property
    def finished(self) -> int:
        """Count the cells that are kept: in parts and in journals."""
        lines = sum(len(file.read_text().splitlines())
                    for file in self.out.glob('journal-*.jsonl'))
        return lines + sum(pq.read_metadata(file).num_rows
                           for file in self.out.glob('cells/part-*.parquet'))

    @property
    def finished_seeds(self) -> set[str]:
        """Return the seeds of the cells that are kept, when nothing writes there."""
        with ResultParts(self.out) as parts:
            parts.finish_part()
        return {str(row['seed']) for row in self.tables()[0]}

    @property
    def begun(self) -> Counter[str]:
        """Count how often the cell of each seed was begun."""
        return Counter(self.begun_file.read_text().split())

    def tables(self) -> list[list[dict[str, Any]]]:
        """Return the rows that depend on no clock, sorted."""
        return [sorted((row for file in self.out.glob(f'{table}/part-*.parquet')
                        for row in pq.read_table(file).to_pylist()),
                       key=lambda row: (row['cell'], row.get('vehicle')))
                for table in ('cells', 'vehicles')]

    def wait_for(self, cells: int, process: 'subprocess.Popen[str]') -> None:
        """Wait until so many cells are finished."""
        while self.finished < cells:
            assert process.poll() is None, process.communicate()
            time.sleep(0.02)


def environment(begun: Path) -> dict[str, str]:
    """Make the package importable for processes in any folder."""
    return os.environ | {'CELLS_BEGUN': str(begun), 'PYTHONPATH': str(ROOT)}


@pytest.fixture(scope='module')
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Evaluation:
    """Return the evaluation that two undisturbed workers compute."""
    evaluation = Evaluation(tmp_path_factory.mktemp('expected'))
    told = evaluation.run('--workers', '2')
    assert f'{CELLS} of {CELLS} cells' in told
    assert evaluation.begun == Counter({str(seed): 1 for seed in range(CELLS)})
    assert f'all {CELLS} cells were finished before' in evaluation.run()
    assert evaluation.begun.total() == CELLS
    return evaluation


@pytest.fixture(scope='module')
def expected(undisturbed: Evaluation) -> list[list[dict[str, Any]]]:
    """Return its tables."""
    return undisturbed.tables()


@pytest.mark.exhaustive
def test_tables_have_a_row_for_each_cell(expected: list[list[dict[str, Any]]]) -> None:
    cells, vehicles = expected
    assert [row['seed'] for row in sorted(cells, key=lambda row: row['seed'])] == [*range(CELLS)]
    assert {row['status'] for row in cells} == {'ok'} and len(vehicles) == 2 * CELLS
    assert all(row['worst_gap'] or row['worst_min_distance'] for row in vehicles)


@pytest.mark.clock
def test_a_killed_client_takes_its_workers_along_and_goes_on(
        tmp_path: Path, expected: list[list[dict[str, Any]]]) -> None:
    evaluation = Evaluation(tmp_path)
    process = evaluation.start('--workers', '1')
    evaluation.wait_for(5, process)
    others = psutil.Process(process.pid).children(recursive=True)
    process.kill()
    process.communicate()
    _, alive = psutil.wait_procs(others, timeout=60)
    assert not alive
    finished = evaluation.finished_seeds
    assert 5 <= len(finished) < CELLS
    told = evaluation.run('--workers', '1')
    assert f'{len(finished)} of them finished before' in told
    assert evaluation.tables() == expected
    # Only cells of the batch in which it was killed were begun again.
    assert all(count == 1 or seed not in finished and count == 2
               for seed, count in evaluation.begun.items())


@pytest.mark.exhaustive
def test_ctrl_c_ends_all_in_a_line(tmp_path: Path) -> None:
    evaluation = Evaluation(tmp_path)
    process = evaluation.start('--workers', '1')
    evaluation.wait_for(2, process)
    others = psutil.Process(process.pid).children(recursive=True)
    # As from a terminal: to all processes in the foreground.
    os.killpg(process.pid, signal.SIGINT)
    _, told = process.communicate(timeout=60)
    _, alive = psutil.wait_procs(others, timeout=60)
    assert process.returncode == 130 and not alive
    assert 'the same command goes on' in told and 'Traceback' not in told
    assert evaluation.finished >= 2


@pytest.mark.exhaustive
def test_killed_workers_are_replaced(tmp_path: Path,
                                     expected: list[list[dict[str, Any]]]) -> None:
    evaluation = Evaluation(tmp_path)
    process = evaluation.start('--workers', '2')
    for cells in (3, 6):
        evaluation.wait_for(cells, process)
        workers = [child for child in psutil.Process(process.pid).children(recursive=True)
                   if 'cell_process' in ' '.join(child.cmdline())]
        workers[0].parent().kill()
    _, told = process.communicate(timeout=240)
    assert process.returncode == 0, told
    assert evaluation.tables() == expected


@contextmanager
def cluster(folder: Path, begun: Path) -> Iterator[tuple[str, 'subprocess.Popen[bytes]']]:
    """Start a scheduler and two workers by hand, in an empty folder."""
    folder.mkdir()
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        address = f'tcp://127.0.0.1:{probe.getsockname()[1]}'
    begin = [sys.executable, '-m', 'distributed.cli.dask_scheduler', '--host', address,
             '--no-dashboard', '--no-jupyter'][:-1]
    work = [sys.executable, '-m', 'distributed.cli.dask_worker', address, '--nthreads', '1',
            '--no-dashboard', '--death-timeout', '20', '--local-directory', str(folder)]
    quiet: dict[str, Any] = {'cwd': folder, 'env': environment(begun),
                             'stdout': subprocess.DEVNULL, 'stderr': subprocess.DEVNULL}
    processes = [subprocess.Popen(command, **quiet) for command in (begin, work, work)]
    try:
        yield address, processes[0]
    finally:
        for process in reversed(processes):
            process.send_signal(signal.SIGTERM)
        for process in processes:
            process.wait(60)


@pytest.mark.exhaustive
def test_a_foreign_cluster_computes_the_same(
        tmp_path: Path, expected: list[list[dict[str, Any]]]) -> None:
    evaluation = Evaluation(tmp_path)
    with cluster(tmp_path / 'first', evaluation.begun_file) as (address, scheduler):
        process = evaluation.start('--scheduler', address)
        evaluation.wait_for(4, process)
        scheduler.kill()
        _, told = process.communicate(timeout=120)
    assert process.returncode == 1 and 'the scheduler is gone' in told
    assert 'Traceback' not in told
    finished = evaluation.finished
    with cluster(tmp_path / 'second', evaluation.begun_file) as (address, _):
        told = evaluation.run('--scheduler', address)
    assert f'{finished} of them finished before' in told
    assert evaluation.tables() == expected


@pytest.mark.exhaustive
def test_a_scheduler_that_is_not_there_is_told(tmp_path: Path) -> None:
    process = Evaluation(tmp_path).start('--scheduler', 'tcp://127.0.0.1:9')
    _, told = process.communicate(timeout=120)
    assert process.returncode == 2 and 'no scheduler answers there' in told
    assert 'Traceback' not in told


@pytest.mark.exhaustive
def test_a_cell_is_run_again_and_reported(tmp_path: Path, undisturbed: Evaluation) -> None:
    """From the files of the evaluation alone, wherever it lies now."""
    shutil.copytree(undisturbed.out, tmp_path / 'elsewhere')
    cell = undisturbed.tables()[0][3]
    done = subprocess.run(
        [sys.executable, '-m', 'crgame_ros.cli', 'evaluate', tmp_path / 'elsewhere', '--cell',
         cell['cell'][:10]], cwd=ROOT, env=environment(undisturbed.begun_file),
        capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    report = Path(done.stdout.strip())
    assert report.name == f'{cell["cell"]}.html' and 'av0' in report.read_text()
    assert report.with_suffix('.xml').is_file()
