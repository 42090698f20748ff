# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pace of the live loop: when a cycle is due, and what is done until then."""

from collections.abc import Callable
import time

from crgame_ros.nodes.sim.step_watch import StepWatch
from crgame_ros.timing.late_step import Phase
from crgame_ros.timing.time_controller import TimeController
from rclpy.executors import SingleThreadedExecutor

NS_PER_S = 1_000_000_000
# How often the executor looks for service calls [Hz], and the least time left for it [ns].
SERVICE_RATE = 20.0
SERVICE_SLACK_NS = 1_500_000
# The scheduler wakes a sleeper this much late at best [ns]; the rest is waited for awake.
WAKE_UP_NS = 120_000
# Reading a driver's command takes so long [ns]; where steps are long it is done before their time.
READ_NS, LONG_STEP_S = 100_000, 5e-3


class Pacer:
    """
    Waits for each cycle's time on the steady clock, and serves orders where there is time for it.

    :param executor: runs the services.
    :param controller: knows when cycles are due.
    :param dt_s: nominal step [s]
    """

    def __init__(self, executor: SingleThreadedExecutor, controller: TimeController,
                 dt_s: float) -> None:
        self._executor = executor
        self._controller = controller
        # At high rates half a step has to do, or nobody could ever stop the run.
        self._slack_ns = min(SERVICE_SLACK_NS, 0.5 * dt_s * NS_PER_S)
        self._every = max(1, round(1.0 / dt_s / SERVICE_RATE))
        self._awake_ns = WAKE_UP_NS + (READ_NS if dt_s >= LONG_STEP_S else 0)
        # When the present cycle was due, and since when it was waited for, steady clock [ns].
        self.due_ns = 0
        self.idle_from_ns = 0

    def wait(self, n: int, watch: StepWatch, read: Callable[[int], None]) -> None:
        """
        Serve orders now and then, and wait until the cycle after step n is due (CRG 11).

        :param watch: is told what is done.
        :param read: is told the time [ns] shortly before, to take in what has come by then.
        """
        self.due_ns = self._controller.deadline_ns()
        self.idle_from_ns = time.monotonic_ns()
        left_ns = self.due_ns - self.idle_from_ns
        # A loop that is late all the time must be stoppable too.
        if (left_ns > self._slack_ns and n % self._every == 0) \
                or self._controller.serves_orders_now:
            watch.mark(Phase.SERVICES)
            self._executor.spin_once(timeout_sec=0)
        watch.mark(Phase.WAIT)
        left_ns = self.due_ns - time.monotonic_ns()
        if left_ns > self._awake_ns:
            time.sleep((left_ns - self._awake_ns) / NS_PER_S)
        watch.mark(Phase.INPUTS)
        now_ns = time.monotonic_ns()
        if self.due_ns - now_ns > READ_NS:
            read(now_ns)
        while time.monotonic_ns() < self.due_ns:
            pass
