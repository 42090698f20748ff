# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the project's loop to the naive one (CRG section IV-C, figure 14 and table I)."""

from array import array
from collections.abc import Callable
from dataclasses import dataclass, replace
import json
import os
from pathlib import Path
import time

from crgame_ros.analysis.pictures.timing_figure import TimedRun
from crgame_ros.analysis.pictures.timing_table import TIMING_ROWS, TimingTable
from crgame_ros.analysis.runs.run import Run
from crgame_ros.game.game import TimingSpec
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_setup
from crgame_ros.recording.metadata import TopicQos
from crgame_ros.recording.writer import BagWriter
from crgame_ros.reproduction.expectation import (
    Expectation,
    Finding,
    judge,
    Judgement,
)
from crgame_ros.reproduction.recorded_human import run_live
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.observer import drivability_monitor
from crgame_ros.simulation.offline import observed_run, offline_driver, PlannerSeat
from crgame_ros.simulation.setup import Setup
from crgame_ros.timing.cycle_rows import CycleTable, TIMING_COLUMNS
from crgame_ros.timing.metrics import TimingMetrics, TimingSummary
from crgame_ros.timing.time_controller import TimeController
import numpy as np


class NaiveLoop:
    """
    A single loop: drive, plan, check, record, then sleep for the rest of the step.

    :param setup: the run.
    :param folder: folder of its recording.
    """

    def __init__(self, setup: Setup, folder: Path) -> None:
        self._simulation = Simulation(setup)
        self._seats = [PlannerSeat(setup, index, self._simulation, 0, time.perf_counter)
                       for index in range(len(setup.avs))]
        self._drivers = [offline_driver(setup, index) for index in range(len(setup.humans))]
        self._dt_s = setup.scheduler.dt_s
        spec: TimingSpec = replace(
            setup.game.timing, pacing=False, frame_skipping=False, drift_reset=False,
            measured_interval=False)
        self._controller = TimeController(spec, self._dt_s)
        self._monitor = drivability_monitor(observed_run(setup))
        self._writer = BagWriter(folder, now_ns=time.monotonic_ns)
        self._channel = self._writer.add_topic('/state', 'std_msgs/msg/String', TopicQos())
        self._result = self._simulation.begin()
        self._started = False
        self._rows = array('d')

    @property
    def cycles(self) -> CycleTable:
        """Return the cycles so far, as the graph publishes them for its own loop."""
        rows = np.array(self._rows).reshape(-1, len(TIMING_COLUMNS))
        return CycleTable(TIMING_COLUMNS, rows)

    def run(self, duration_s: float) -> None:
        """Run for a duration of wall time; the time between calls does not count."""
        now_ns = time.monotonic_ns()
        if self._started:
            self._controller.resume(now_ns)
        else:
            self._controller.start(now_ns)
            self._started = True
        end_ns = now_ns + int(duration_s * 1e9)
        while time.monotonic_ns() < end_ns:
            left_ns = self._controller.deadline_ns() - time.monotonic_ns()
            if left_ns > 0:
                time.sleep(left_ns * 1e-9)
            self._cycle(max(0, left_ns) * 1e-9)

    def _cycle(self, sleep_s: float) -> None:
        start_ns = time.monotonic_ns()
        cycle = self._controller.begin_cycle(start_ns)
        simulation = self._simulation
        for seat in self._seats:
            if seat.id in self._result.requests:
                seat.ask(self._result.requests[seat.id])
            seat.deliver()
        commands = [driver.command(simulation.n, self._dt_s) for driver in self._drivers]
        self._result = simulation.step(cycle.dt_eff_s, commands)
        states = np.array(simulation.states)
        self._monitor.observe(simulation.n, simulation.scheduler.since_tick_s(simulation.n),
                              states, self._result.objects)
        text = json.dumps({'n': simulation.n, 'states': states.tolist()}).encode()
        data = b'\0\1\0\0' + (len(text) + 1).to_bytes(4, 'little') + text + b'\0'
        self._writer.write(self._channel, data, time.time_ns())
        busy_s = (time.monotonic_ns() - start_ns) * 1e-9
        self._rows.extend((
            0.0, cycle.n, simulation.scheduler.k(simulation.n), cycle.ideal_s, cycle.actual_s,
            cycle.step_error_s, cycle.cumulative_error_s, busy_s, sleep_s, cycle.dt_eff_s,
            cycle.resets, cycle.dropped_s))

    def close(self) -> TimingSummary:
        """Finish the recording, and return the metrics."""
        self._writer.close()
        metrics = TimingMetrics(self._dt_s)
        metrics.add_rows(self.cycles.timing_rows())
        return metrics.summary()


PROPOSED, NAIVE = 'Proposed', 'Naive'
# Table I as printed in the paper, by metric: values of the proposed and the naive loop, in the
# units of `TIMING_ROWS`.
PAPER_TABLE = {
    'Final Error': ('1.48', '402.38'),
    'Average Step Error': ('4.10', '22.84'),
    'Maximum Cumulative Error': ('90.67', '1998.47'),
    'Timeout Ratio': ('37.7', '56.4'),
    'Final Real-Time Ratio': ('1.00', '0.97'),
    'Average Real-Time Ratio': ('0.99', '0.84'),
    'Minimum Real-Time Ratio': ('0.10', '0.04'),
    'Time Efficiency': ('99.99', '34.36'),
    'Precision Ratio': ('1.00e-4', '2.85e-2')}


# Beside other programs that use more of the machine, the loops cannot be compared [-].
MOST_OTHERS = 0.1


@dataclass(frozen=True)
class Synchronization:
    """
    The cycles of both loops.

    :param proposed: cycles of the project's loop in a live graph.
    :param naive: cycles of the naive loop.
    :param others: shares of the machine's processor time that other programs used beside the
        project's loop and beside the naive one [-]
    """

    proposed: TimedRun
    naive: TimedRun
    others: tuple[float, float] = (0.0, 0.0)

    @property
    def is_valid(self) -> bool:
        """Tell whether other programs left enough of the machine to compare the loops."""
        return max(self.others) <= MOST_OTHERS

    @property
    def load(self) -> str:
        """Return what other programs used, in a sentence, and whether the comparison is valid."""
        return (f'Other programs used {self.others[0]:.0%} of the machine beside our loop and '
                f'{self.others[1]:.0%} beside the naive one' + (
                    '.' if self.is_valid else f': the comparison is not valid. At most '
                    f'{MOST_OTHERS:.0%} may be used: end them, and repeat it.'))

    @property
    def table(self) -> TimingTable:
        """Return table I for both loops."""
        return TimingTable((self.proposed, self.naive))

    def rows(self) -> list[dict[str, object]]:
        """Return table I with the paper's values, as JSON-compatible rows."""
        ours, naive = self.table.summaries
        return [{'metric': row.name, 'unit': row.unit,
                 'proposed': row.value(ours), 'naive': row.value(naive),
                 'paper_proposed': float(PAPER_TABLE[row.name][0]),
                 'paper_naive': float(PAPER_TABLE[row.name][1])} for row in TIMING_ROWS]


def measure_synchronization(game: Path, planner: str, duration_s: float,
                            folder: Path) -> Synchronization:
    """
    Run the graph live, then the naive loop, for the same wall time.

    :param duration_s: wall time of each [s]
    :param folder: folder of both runs' files, with subfolders `proposed` and `naive`.
    :raises CrgameError: if a run failed.
    """
    beside_proposed = others_beside(
        lambda: run_live(game, planner, folder / 'proposed', duration_s))
    proposed = Run.of_recording(folder / 'proposed', name=PROPOSED).timed
    setup = effective_setup(RunRequest(game=game, planners=(planner,)))
    loop = NaiveLoop(setup, folder / 'naive')
    beside_naive = others_beside(lambda: loop.run(duration_s))
    loop.close()
    return Synchronization(proposed, TimedRun(NAIVE, loop.cycles, setup.scheduler.dt_s),
                           (beside_proposed, beside_naive))


def others_beside(work: Callable[[], object]) -> float:
    """
    Do some work, and measure what other programs use meanwhile.

    :return: the share of the machine's processor time that neither this process nor its ended
        children used [-]
    """
    begin_s, busy_s, own_s = time.monotonic(), _busy_s(), sum(os.times()[:4])
    work()
    others_s = _busy_s() - busy_s - (sum(os.times()[:4]) - own_s)
    whole_s = (time.monotonic() - begin_s) * (os.cpu_count() or 1)
    return max(0.0, others_s) / whole_s


def _busy_s() -> float:
    """Return the time that all processors worked, or were taken by the host, since boot [s]."""
    with open('/proc/stat', encoding='ascii') as file:
        user, nice, system, _idle, _wait, *interrupts_and_stolen = map(
            int, file.readline().split()[1:9])
    return (user + nice + system + sum(interrupts_and_stolen)) / os.sysconf('SC_CLK_TCK')


def _smaller(name: str) -> Expectation[tuple[TimingSummary, TimingSummary]]:
    """Build the expectation that a metric of table I is smaller in the project's loop."""
    row = next(each for each in TIMING_ROWS if each.name == name)
    paper = PAPER_TABLE[name]

    def check(found: tuple[TimingSummary, TimingSummary]) -> Finding:
        ours, naive = map(row.value, found)
        return Finding(ours < naive, f'{ours:{row.form}} {row.unit}, naive '
                       f'{naive:{row.form}} {row.unit}')

    return Expectation(
        f'{name} is smaller', 'Our loop has the smaller one, on any machine: a loop with a '
        'schedule returns to it after whatever delayed it, one without keeps every delay.',
        f'{paper[0]} {row.unit}, naive {paper[1]} {row.unit} (table I)', check)


# The other rows depend on the machine: a fast one has no timeouts in either loop.
TIMING_EXPECTATIONS = tuple(map(_smaller, (
    'Final Error', 'Average Step Error', 'Maximum Cumulative Error')))


def judge_synchronization(found: Synchronization) -> tuple[Judgement, ...]:
    """Judge the expectations on table I that hold on any machine; none if it is not valid."""
    if not found.is_valid:
        return ()
    ours, naive = found.table.summaries
    return judge('timing', TIMING_EXPECTATIONS, (ours, naive))
