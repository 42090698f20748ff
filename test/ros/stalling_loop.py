# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A loop like that of sim_node, with known stalls at known steps.

It prints JSON: the report of the cycle after each stall, and the stall's own measurement.
"""

from collections.abc import Callable
import fcntl
import gc
import json
import mmap
import os
from pathlib import Path
import subprocess
import sys
import time

from crgame_ros.game.game import TimingSpec
from crgame_ros.nodes.sim.live_run import Pacer
from crgame_ros.nodes.sim.step_watch import StepWatch
from crgame_ros.timing.cycle_rows import CycleRows, CycleTable
from crgame_ros.timing.late_step import Phase
from crgame_ros.timing.late_steps import LateStep, LateSteps
from crgame_ros.timing.time_controller import TimeController
import rclpy
from rclpy.executors import SingleThreadedExecutor

DT_S = 0.01
HELD_S = 0.06
OBJECTS, PAGES = 600_000, 40_000
HOG = 'import os\nwhile os.getppid() > 1: pass'
HOLDER = ('import fcntl, sys, time\nfile = open(sys.argv[1], "w")\n'
          'fcntl.flock(file, fcntl.LOCK_EX)\nprint("held", flush=True)\n'
          f'sys.stdin.readline()\ntime.sleep({HELD_S})')


def collect(_: Path) -> float:
    """Collect garbage among many objects."""
    began_s = time.thread_time()
    gc.collect()
    return time.thread_time() - began_s


def compute(_: Path) -> float:
    """Compute for long."""
    began_s = time.thread_time()
    while time.thread_time() - began_s < 0.04:
        pass
    return 0.04


def touch(_: Path) -> float:
    """Touch fresh memory, page by page."""
    began_s = time.thread_time()
    with mmap.mmap(-1, PAGES * mmap.PAGESIZE) as fresh:
        fresh.madvise(mmap.MADV_NOHUGEPAGE)
        for page in range(PAGES):
            fresh[page * mmap.PAGESIZE] = 1
    return time.thread_time() - began_s


def wait_for_lock(folder: Path) -> float:
    """Wait for a lock that another process holds."""
    path = folder / 'lock'
    with subprocess.Popen([sys.executable, '-c', HOLDER, str(path)], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE, text=True) as holder, path.open('w') as file:
        assert holder.stdin is not None and holder.stdout is not None
        holder.stdout.readline()
        holder.stdin.write('\n')
        holder.stdin.flush()
        began_s = time.monotonic()
        fcntl.flock(file, fcntl.LOCK_EX)
        return time.monotonic() - began_s


def stop(_: Path) -> float:
    """Be stopped by a signal, until another lets the process go on."""
    began_s = time.monotonic()
    with subprocess.Popen(
            ['sh', '-c', f'kill -STOP {os.getpid()}; sleep {HELD_S}; kill -CONT {os.getpid()}']):
        pass
    return time.monotonic() - began_s


def share_processor(_: Path) -> float:
    """Compute on a processor that processes of higher priority keep busy."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    hogs = [subprocess.Popen([sys.executable, '-c', HOG]) for _ in range(2)]
    os.nice(10)
    began_s, computed_s, waited_s = time.monotonic(), time.thread_time(), 0.0
    while waited_s < HELD_S:
        waited_s = time.monotonic() - began_s - (time.thread_time() - computed_s)
    for hog in hogs:
        hog.kill()
        hog.wait()
    os.sched_setaffinity(0, before)
    return waited_s


DEEDS: dict[str, Callable[[Path], float]] = {
    'gc': collect, 'work': compute, 'page_faults': touch, 'blocked': wait_for_lock,
    'stopped': stop, 'processor': share_processor}


def main() -> None:
    """Run the loop; the argument is a folder for files."""
    rclpy.init()
    controller = TimeController(TimingSpec(drift_reset=False), DT_S)
    executor = SingleThreadedExecutor()
    pacer = Pacer(lambda: executor.spin_once(timeout_sec=0.0), controller, DT_S, 50)
    steps = 20 * (len(DEEDS) + 1)
    rows = CycleRows((), steps)
    deeds = {20 * (index + 1): name for index, name in enumerate(DEEDS)}
    kept = [[] for _ in range(OBJECTS)]
    gc.collect()
    gc.disable()
    measured: dict[str, float] = {}
    controller.start(time.monotonic_ns())
    with StepWatch() as watch:
        for n in range(steps):
            pacer.wait(n, watch, lambda _now_ns: None)
            start_ns = time.monotonic_ns()
            watch.mark(Phase.INPUTS)
            cycle = controller.begin_cycle(start_ns)
            causes, late_in = watch.explain(pacer.due_ns, cycle.step_error_s, 1.0)
            watch.mark(Phase.STEP)
            if n in deeds:
                measured[deeds[n]] = DEEDS[deeds[n]](Path(sys.argv[1]))
            watch.mark(Phase.PUBLISH)
            rows.add(0, 0, cycle, 0.0, 0.0, (), causes, late_in)
    table = CycleTable.from_message(','.join(rows.columns), rows.taken())
    late: dict[int, LateStep] = {}
    for row in range(len(table.rows)):
        single = LateSteps()
        single.add_table(CycleTable(table.columns, table.rows[row:row + 1]))
        late.update({step.n: step for step in single.worst})
    print(json.dumps({
        'tells_waiting': watch.tells_waiting, 'kept': len(kept),
        # The stall in row n makes the next row, of cycle n + 2, late.
        'told': {name: late[n + 2].as_dict() for n, name in deeds.items() if n + 2 in late},
        'measured_ms': {name: 1e3 * time_s for name, time_s in measured.items()}}))
    rclpy.shutdown()


if __name__ == '__main__':
    main()
