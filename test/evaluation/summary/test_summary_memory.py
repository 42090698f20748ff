# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A hundred thousand cells: their memory, and that more cells do not need more."""

from pathlib import Path
import subprocess
import sys

from evaluation_rows import write_parts
import numpy as np
import pyarrow as pa
import pytest

pytestmark = pytest.mark.exhaustive

CELLS, SCENARIOS, PLANNERS = 100_000, 4, ('idm', 'mine', 'theirs', 'yours')
# The requirement is less than 300 MB for 100,000 cells.
MOST_MB = 300.0
# Three times as many cells may take so much more, which is what allocators keep: 67,000 rows of
# Python objects would be some 200 MB.
FLAT_MB = 45.0
PROGRAM = """
import sys
from pathlib import Path
from crgame_ros.evaluation.summary.summarise import summarise

def peak_kb():
    lines = Path('/proc/self/status').read_text().splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith('VmHWM')))

before = peak_kb()
found = summarise(Path(sys.argv[1]), block_cells=int(sys.argv[2]))
print(found.cells, before, peak_kb())
"""


def _evaluation(folder: Path, cells: int) -> Path:
    random = np.random.default_rng(1)
    numbers = np.arange(cells)
    planner = pa.array(PLANNERS).take(pa.array(numbers % len(PLANNERS)))
    pairs = numbers // len(PLANNERS)
    factors = {
        'cell': pa.array([f'{number:032x}' for number in random.permutation(cells).tolist()]),
        'scenario': pa.array([f'ZAM_Made-{one}_1_T-1' for one in range(SCENARIOS)]).take(
            pa.array(pairs % SCENARIOS)),
        'game': pa.repeat('', cells), 'planner': planner, 'human': pa.repeat('timid', cells),
        'perception': pa.repeat('', cells), 'traffic': pa.repeat('', cells),
        'seed': pa.array(pairs)}
    measures = {name: random.normal(3.0, 1.0, cells) for name in (
        'worst_ttc', 'worst_thw', 'worst_min_distance', 'worst_drac', 'tet_s', 'tit', 'distance',
        'mean_speed', 'min_acceleration', 'score_nuplan', 'score_progress', 'score_comfort',
        'score_speed_limit', 'score_drivable_area', 'latency_max_s')}
    rows = {'cells': {'status': pa.repeat('ok', cells), 'reason': pa.repeat('', cells)},
            'vehicles': {'vehicle': pa.repeat('av0', cells),
                         'role': pa.repeat('autonomous', cells), **measures}}
    for name, more in rows.items():
        (folder / name).mkdir(parents=True)
        write_parts(pa.table({**factors, **more}), folder / name, 20, seed=2)
    return folder


def _peak_mb(folder: Path, block_cells: int) -> tuple[float, float]:
    """Return what a process takes before it sums up, and at most [MB]."""
    done = subprocess.run([sys.executable, '-c', PROGRAM, str(folder), str(block_cells)],
                          capture_output=True, text=True, check=True)
    _, before, peak = map(int, done.stdout.split())
    return before / 1024.0, peak / 1024.0


def test_a_hundred_thousand_cells_are_not_held(tmp_path: Path) -> None:
    """With blocks of usual size; and in blocks of a sixth, beside what a third takes."""
    whole = _evaluation(tmp_path / 'whole', CELLS)
    before, peak = _peak_mb(whole, 65_536)
    print(f'\n{CELLS} cells: {before:.0f} MB before, {peak:.0f} MB at most')
    assert peak - before < MOST_MB
    third = _evaluation(tmp_path / 'third', CELLS // 3)
    few, many = (_peak_mb(folder, CELLS // 6 + 1)[1] for folder in (third, whole))
    print(f'in blocks of a sixth: {few:.0f} MB for a third, {many:.0f} MB for all')
    assert many - few < FLAT_MB
