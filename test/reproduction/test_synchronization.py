# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Table I: the naive loop, the paper's numbers, and the order that must hold."""

import os
from pathlib import Path
import subprocess
import sys
import time

from crgame_ros.analysis.pictures.timing_figure import TimedRun
from crgame_ros.analysis.pictures.timing_table import TIMING_ROWS, TimingTable
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.reproduction.synchronization import (
    judge_synchronization,
    NaiveLoop,
    others_beside,
    PAPER_TABLE,
    Synchronization,
)
from crgame_ros.simulation.setup import build_setup
from crgame_ros.timing.cycle_rows import CycleTable, TIMING_COLUMNS
import numpy as np
import pytest

pytestmark = pytest.mark.xdist_group('reproduction')


def _loop(lag_s: float) -> TimedRun:
    """Make a loop of 100 cycles, each so much later than the one before."""
    rows = np.zeros((100, len(TIMING_COLUMNS)))
    n = np.arange(100)
    rows[:, TIMING_COLUMNS.index('n')] = n
    rows[:, TIMING_COLUMNS.index('ideal_s')] = 0.01 * n
    rows[:, TIMING_COLUMNS.index('actual_s')] = (0.01 + lag_s) * n
    return TimedRun('', CycleTable(TIMING_COLUMNS, rows), 0.01)


def test_order() -> None:
    """Each of the three errors is checked; a loop that is no better meets none."""
    met = judge_synchronization(Synchronization(_loop(0.0), _loop(0.001)))
    assert [each.is_met for each in met] == [True, True, True]
    assert met[0].found == '0.00 ms, naive 99.00 ms'
    for worse in (_loop(0.002), _loop(0.001)):
        judged = judge_synchronization(Synchronization(worse, _loop(0.001)))
        assert not any(each.is_met for each in judged)


def test_other_programs_make_the_comparison_invalid() -> None:
    """Nothing is judged then, and a sentence tells it with the shares."""
    found = Synchronization(_loop(0.0), _loop(0.001), (0.02, 0.35))
    assert judge_synchronization(found) == ()
    assert found.load.startswith('Other programs used 2% of the machine beside our loop and 35% '
                                 'beside the naive one: the comparison is not valid.')
    assert Synchronization(_loop(0.0), _loop(0.001), (0.02, 0.1)).load.endswith('naive one.')


def test_other_programs_are_told_apart_from_our_own() -> None:
    """A process of ours counts once it has ended; another's counts as others."""
    spin = [sys.executable, '-c', 'import time\nwhile time.process_time() < 1.0: pass']
    other = subprocess.Popen(spin)
    begin_s = time.monotonic()
    others = others_beside(lambda: subprocess.run(spin, check=True))
    took_s = time.monotonic() - begin_s
    least_s = 0.5
    assert others * took_s * (os.cpu_count() or 1) > least_s
    other.wait()


def test_paper_table() -> None:
    """It has our rows, and contradicts itself no more than `docs/timing.md` says."""
    assert list(PAPER_TABLE) == [row.name for row in TIMING_ROWS]
    value = {name: tuple(map(float, pair)) for name, pair in PAPER_TABLE.items()}
    for proposed, ratio in zip(value['Precision Ratio'], value['Final Real-Time Ratio'],
                               strict=True):
        # The final ratio is 1 - P_r in both columns.
        assert ratio == pytest.approx(1.0 - proposed, abs=5e-3)
    rows = Synchronization(_loop(0.0), _loop(0.001)).rows()
    assert rows[0] == {'metric': 'Final Error', 'unit': 'ms', 'proposed': 0.0,
                       'naive': pytest.approx(99.0), 'paper_proposed': 1.48,
                       'paper_naive': 402.38}


def test_naive_loop(tmp_path: Path) -> None:
    """Its cycles agree with its metrics; it never catches up, and only done cycles count."""
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    loop = NaiveLoop(setup, tmp_path / 'naive')
    loop.run(0.5)
    loop.run(0.5)
    summary = loop.close()
    cycles = loop.cycles
    table = TimingTable([TimedRun('Naive', cycles, setup.scheduler.dt_s)])
    assert table.summaries[0] == summary
    np.testing.assert_array_equal(cycles.column('n'), np.arange(1, len(cycles.rows) + 1))
    # Without pacing no step is shorter than Delta t, so that no delay is made up for.
    assert np.diff(cycles.column('actual_s')).min() > setup.scheduler.dt_s - 1e-6
    assert len(cycles.rows) <= 101
    assert (tmp_path / 'naive' / 'metadata.yaml').is_file()
