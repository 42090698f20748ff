# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What the simulation loop loses to the middleware in its process, and what it would gain apart.

Four designs run in turns: as shipped; the loop's thread and all other threads of sim_node bound to
different cores; `--realtime-priority`; and, beside each of these, a process with nothing but a
loop that works as long as ours does in each step (`--work`), with the same short time slice. This
last one bounds what an integrator in a process of its own could reach. Whatever the middleware
does to it, it does from outside.

Columns: share of the steps that begin within a step of their time, 99th percentile of the step
error, worst lag, and how long the loop waited for a processor, in the run. `--crowd` drives 50
agents with perception, and a browser, instead of the cut-in game at 1 kHz.
"""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import multiprocessing
from multiprocessing.sharedctypes import Synchronized
import os
from pathlib import Path
import statistics
import tempfile
import time
from typing import Any, NamedTuple

from cockpit import Browser, free_port
from crgame_ros.paths import scenarios_directory
from crgame_ros.timing.thread_counters import shorten_time_slice
from crowd import GAME
from live_graph import LiveGraph
import numpy as np

DESIGNS = ('as shipped', 'threads bound', 'real-time priority')
# Steps that the process apart has room for.
ROOM = 4_000_000


class Seen(NamedTuple):
    """What a loop did: shares, and times [ms]."""

    held: float
    p99_ms: float
    worst_ms: float
    waited_ms: float


def _work(period_s: float, work_s: float, listens: 'Synchronized[int]', used: 'Synchronized[int]',
          late_s: Any) -> None:
    shorten_time_slice()
    due = time.monotonic()
    while True:
        due += period_s
        time.sleep(max(0.0, due - time.monotonic()))
        begun = time.monotonic()
        if listens.value and used.value < ROOM:
            late_s[used.value] = begun - due
            used.value += 1
        while time.monotonic() < begun + work_s:
            pass


@contextmanager
def loop_apart(period_s: float, work_s: float) -> Iterator[tuple['Synchronized[int]', Any]]:
    """Run a loop in a process; yield its switch, and a function that returns what it did."""
    context = multiprocessing.get_context('fork')
    listens, used = context.Value('i', 0), context.Value('q', 0)
    late_s = context.Array('d', ROOM, lock=False)
    process = context.Process(target=_work, daemon=True,
                              args=(period_s, work_s, listens, used, late_s))
    process.start()

    def seen() -> Seen:
        late = np.array(late_s[:used.value])
        error_ms = 1e3 * np.abs(np.diff(late))
        return Seen(float((late <= period_s).mean()), float(np.quantile(error_ms, 0.99)),
                    1e3 * float(late.max()), float('nan'))

    try:
        yield listens, seen
    finally:
        process.kill()
        process.join()


def bind(pid: int) -> None:
    """Bind the main thread of a process to one core, and its other threads to the rest."""
    cores = sorted(os.sched_getaffinity(0))
    for thread in Path(f'/proc/{pid}/task').iterdir():
        own = int(thread.name)
        os.sched_setaffinity(own, {cores[0]} if own == pid else set(cores[1:]))


def measure(design: str, values: argparse.Namespace, folder: Path) -> tuple[Seen, Seen]:
    """Return what our loop did, and what the one apart did beside it."""
    rate = 100 if values.crowd else values.rate
    if values.crowd:
        game = folder.with_suffix('.yaml')
        game.write_text(GAME.format(scenarios=scenarios_directory()))
        arguments = [str(game), '--port', str(free_port())]
    else:
        arguments = [str(scenarios_directory() / 'cut_in.yaml'), '--planner', 'idm', '--rate',
                     str(rate), '--duration', '100000']
    if design == 'real-time priority':
        arguments.append('--realtime-priority')
    browser = None
    with loop_apart(1.0 / rate, 1e-6 * values.work) as (listens, seen):
        graph = LiveGraph(folder, arguments, headless=not values.crowd)
        try:
            if values.crowd:
                browser = Browser(graph.page())
            graph.wait_for('recording into')
            if design == 'threads bound':
                bind(graph.node_pids()['sim_node'])
            listens.value = 1
            time.sleep(values.seconds)
            listens.value = 0
            report = graph.stop()
        finally:
            if browser is not None:
                browser.close()
            graph.kill()
        waited = report['late_steps']['by_cause'].get('processor', {'ms': float('nan')})['ms']
        return Seen(1.0 - report['catch_up_steps'] / report['cycles'],
                    report['step_error_p99_ms'], report['worst_lag_ms'], waited), seen()


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--rate', type=int, default=1000, help='[Hz]')
    parser.add_argument('--work', type=float, default=60.0,
                        help='of a step of the loop apart [microseconds]')
    parser.add_argument('--seconds', type=float, default=20.0)
    parser.add_argument('--rounds', type=int, default=3)
    parser.add_argument('--crowd', action='store_true')
    values = parser.parse_args()
    found: dict[str, list[Seen]] = {}
    with tempfile.TemporaryDirectory() as name:
        for turn in range(values.rounds):
            for design in DESIGNS:
                ours, apart = measure(design, values,
                                      Path(name) / f'{turn}{design.replace(" ", "_")}')
                for key, seen in ((design, ours), (f'  apart, beside "{design}"', apart)):
                    found.setdefault(key, []).append(seen)
                    print(f'{turn + 1}: {key}: {seen}', flush=True)
    print(f'\n{"median (worst)":36}{"held":>18}{"p99 [ms]":>18}{"worst [ms]":>18}'
          f'{"waited [ms]":>18}')
    for key, runs in found.items():
        cells = ''
        for part, worst in (('held', min), ('p99_ms', max), ('worst_ms', max),
                            ('waited_ms', max)):
            numbers = [getattr(seen, part) for seen in runs]
            cells += f'{f"{statistics.median(numbers):.4g} ({worst(numbers):.4g})":>18}'
        print(f'{key:36}{cells}', flush=True)


if __name__ == '__main__':
    main()
