# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A loop without time to spare serves orders all the same."""

import time

from crgame_ros.game.game import TimingSpec
from crgame_ros.nodes.sim.live_run import Pacer
from crgame_ros.nodes.sim.step_watch import StepWatch
from crgame_ros.timing.time_controller import TimeController
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor

DT_S, LONGEST = 0.004, 8


class CountingExecutor(SingleThreadedExecutor):
    """An executor that counts how often it looked for orders."""

    served = 0

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Look for an order."""
        self.served += 1
        super().spin_once(timeout_sec=timeout_sec)


# Left over of each step [s]: nothing, and less than serving may take.
@pytest.mark.parametrize('left_s', [-0.001, 0.0005])
def test_orders_are_served_after_a_bounded_number_of_steps(left_s: float,
                                                           ros_domain: int) -> None:
    """Each eighth step at the latest, also where no step is late and none has time to spare."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)
    executor = CountingExecutor(context=context)
    controller = TimeController(TimingSpec(drift_reset=False), DT_S)
    pacer = Pacer(lambda: executor.spin_once(timeout_sec=0.0), controller, DT_S, LONGEST)
    controller.start(time.monotonic_ns())
    served = []
    with StepWatch() as watch:
        for n in range(1, 10 * LONGEST):
            before = executor.served
            pacer.wait(n, watch, lambda _now_ns: None)
            if executor.served > before:
                served.append(n)
            controller.begin_cycle(time.monotonic_ns())
            due_ns = controller.deadline_ns()
            while time.monotonic_ns() < due_ns - left_s * 1e9:
                pass
    executor.shutdown()
    rclpy.shutdown(context=context)
    assert len(served) >= 9
    assert max(late - early for early, late in zip([0, *served], served, strict=False)) <= LONGEST
