# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Real stalls of a loop like that of sim_node are reported with their causes."""

import json
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

from crgame_ros.timing.thread_counters import stolen_between
import pytest
from ros_domains import own_domain_id

LOOP = Path(__file__).parent / 'stalling_loop.py'
# A step has 10 ms for whatever happens in it.
STEP_MS = 10.0


@pytest.fixture(scope='module')
def stalls(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Run the loop in a process of its own, and read its report."""
    done = subprocess.run(
        [sys.executable, LOOP, tmp_path_factory.mktemp('stalls')], check=True,
        capture_output=True, text=True, env=os.environ | {'ROS_DOMAIN_ID': str(own_domain_id())})
    told: dict[str, Any] = json.loads(done.stdout)
    if not told['tells_waiting']:
        pytest.skip('this kernel has no schedstat')
    return told


@pytest.mark.clock
@pytest.mark.parametrize('cause', ['gc', 'work', 'page_faults', 'blocked', 'stopped', 'processor'])
def test_a_stall_is_told_by_its_cause(stalls: dict[str, Any], cause: str) -> None:
    """
    A stall has its own measured length, less the time that the step had left.

    The time of page faults is an estimate from their number. Additional delays of a busy machine,
    such as waiting for the processor, are reported beside it.
    """
    told, measured_ms = stalls['told'][cause], stalls['measured_ms'][cause]
    causes_ms = told['causes_ms']
    assert measured_ms > 2.0 * STEP_MS
    least = 0.4 if cause == 'page_faults' else 0.9
    assert causes_ms[cause] > least * measured_ms - STEP_MS
    # Other stalls measure only a part: they also wait for the processes that they start.
    assert causes_ms[cause] < 1.1 * measured_ms + STEP_MS or cause in ('blocked', 'processor')
    assert told['during'] == 'step'
    assert sum(causes_ms.values()) == pytest.approx(told['late_ms'])
    assert causes_ms['unexplained'] < 0.05 * told['late_ms']
    others = {name: time_ms for name, time_ms in causes_ms.items()
              if name not in (cause, 'processor')}
    assert causes_ms[cause] > max(others.values())


def test_stolen_time_is_what_one_processor_certainly_lost() -> None:
    """It is the greatest of all processors in proc(5)'s ticks, less one; cut lines are skipped."""
    before = (b'cpu  9 9 9 9 9 9 9 50 0 0\ncpu0 1 1 1 1 1 1 1 20 0 0\n'
              b'cpu1 1 1 1 1 1 1 1 30 0 0\nintr 7\n')
    after = before.replace(b' 20 ', b' 21 ').replace(b' 30 ', b' 37 ')
    tick_ns = 1_000_000_000 // os.sysconf('SC_CLK_TCK')
    assert stolen_between(before, after) == 6 * tick_ns
    assert stolen_between(before, after[:-len(b' 0 0\nintr 7\n')]) == 0
    assert stolen_between(b'', after) == 0
