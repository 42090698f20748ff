# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The naive baseline of CRG section IV-C: mechanisms off, planner, checks and recording inline."""

from array import array
from dataclasses import replace
import json
from pathlib import Path
import time

from crgame_ros.game.game import TimingSpec
from crgame_ros.recording.metadata import TopicQos
from crgame_ros.recording.writer import BagWriter
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.observer import drivability_monitor
from crgame_ros.simulation.offline import observed_run, PlannerSeat
from crgame_ros.simulation.offline_driver import offline_driver
from crgame_ros.simulation.setup import Setup
from crgame_ros.timing.cycle_rows import CycleTable, TIMING_COLUMNS
from crgame_ros.timing.time_controller import TimeController
from crgame_ros.timing.timing_metrics import TimingMetrics, TimingSummary
import numpy as np


class NaiveLoop:
    """
    One loop that does everything: drive, plan, check, record, then sleep what is left of the step.

    :param setup: the run.
    :param folder: where it records.
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
        self.metrics = TimingMetrics(self._dt_s)
        self._monitor = drivability_monitor(observed_run(setup))
        self._writer = BagWriter(folder, now_ns=time.monotonic_ns)
        self._channel = self._writer.add_topic('/state', 'std_msgs/msg/String', TopicQos())
        self._result = self._simulation.begin()
        self._started = False
        self._rows = array('d')

    @property
    def cycles(self) -> CycleTable:
        """Return the cycles so far, as the graph publishes its own."""
        rows = np.array(self._rows).reshape(-1, len(TIMING_COLUMNS))
        return CycleTable(TIMING_COLUMNS, rows)

    def run(self, duration_s: float) -> None:
        """Run for a stretch of wall time; the time between stretches doesn't count."""
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
        self.metrics.add(cycle.ideal_s, cycle.actual_s, busy_s, cycle.dropped_s)
        self._rows.extend((
            0.0, cycle.n, simulation.scheduler.k(simulation.n), cycle.ideal_s, cycle.actual_s,
            cycle.step_error_s, cycle.cumulative_error_s, busy_s, sleep_s, cycle.dt_eff_s,
            cycle.resets, cycle.dropped_s))

    def close(self) -> TimingSummary:
        """Finish the recording and give the metrics."""
        self._writer.close()
        return self.metrics.summary()
