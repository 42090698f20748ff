# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a driver's input to the odometry that shows it, and from a plan request to its plan."""

import argparse
from pathlib import Path
import random
import tempfile
import time
from typing import Any

from live_graph import LiveGraph, RemoteControl
import numpy as np

from crgame_ros.paths import scenarios_directory

PLANNERS = {'idm': 'p99 <= 5', 'constant-velocity': '', 'idm-package': '',
            'reactive': 'p99 <= 100'}
LIMIT_S = 1.0


class InputProbe:
    """Turns a wheel left and right through an external joy device and waits for the car to."""

    def __init__(self) -> None:
        from nav_msgs.msg import Odometry
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from sensor_msgs.msg import JointState, Joy
        self._joy = Joy
        self._node = rclpy.create_node('input_probe')
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._publisher = self._node.create_publisher(Joy, '/hv0/joy', 10)
        self._received: dict[int, float] = {}
        self._rates: dict[int, float] = {}
        self._kept = [
            self._node.create_subscription(Odometry, '/hv0/odom', self._on_odom, 10),
            self._node.create_subscription(JointState, '/hv0/joint_states', self._on_joint, 10)]

    def _on_odom(self, message: Any) -> None:
        stamp = message.header.stamp
        self._received[stamp.sec * 10**9 + stamp.nanosec] = time.monotonic()

    def _on_joint(self, message: Any) -> None:
        stamp = message.header.stamp
        self._rates[stamp.sec * 10**9 + stamp.nanosec] = message.velocity[0]

    def turn(self, direction: float) -> float | None:
        """Turn the wheel; give the time until the odometry of a step that turns with it [s]."""
        self._received.clear()
        self._rates.clear()
        # Axes of the generic gamepad: left stick first; triggers rest at 1.
        message = self._joy(axes=[direction, 0.0, 1.0, 0.0, 0.0, 1.0], buttons=[0] * 11)
        sent = time.monotonic()
        self._publisher.publish(message)
        while time.monotonic() < sent + LIMIT_S:
            self._executor.spin_once(timeout_sec=0.05)
            for stamp, rate in self._rates.items():
                if rate * direction > 0.0 and stamp in self._received:
                    return self._received[stamp] - sent
        return None

    def idle(self, duration_s: float) -> None:
        """Let messages pass."""
        until = time.monotonic() + duration_s
        while time.monotonic() < until:
            self._executor.spin_once(timeout_sec=0.002)

    def close(self) -> None:
        """Leave the graph."""
        self._node.destroy_node()


def input_latency(folder: Path, turns: int) -> None:
    """Measure and print input to odometry."""
    graph = LiveGraph(folder / 'input', ['--driver', 'joy', '--duration', '100000'])
    control = RemoteControl()
    try:
        control.wait_until_running()
        control.deafen()
        probe = InputProbe()
        probe.idle(2.0)
        generator = random.Random(1)
        times, lost = [], 0
        for turn in range(turns):
            # Any phase of the cycle, and long enough for the wheels to turn back and forth.
            probe.idle(0.1 + generator.random() * 0.05)
            answer = probe.turn(0.5 if turn % 2 else -0.5)
            lost += answer is None
            times += [] if answer is None else [answer * 1e3]
        probe.close()
        graph.stop()
    finally:
        control.close()
        graph.kill()
    p50, p99, worst = np.percentile(times, [50, 99, 100])
    print(f'{"input to odometry":34}{p50:9.2f}{p99:9.2f}{worst:9.2f}  p50 <= 11, p99 <= 20   '
          f'({len(times)} turns, {lost} unanswered)')


def plan_latency(folder: Path, game: list[str], duration_s: float) -> None:
    """Measure and print request to plan for each planner."""
    for planner, wanted in PLANNERS.items():
        report = LiveGraph(folder / planner, [
            *game, '--planner', planner, '--duration', str(duration_s)]).wait()
        for av_id, values in report['planners'].items():
            latency = values['latency_ms']
            good = values['accepted'] - (values.get('fallbacks') or 0)
            print(f'{f"request to plan, {planner} ({av_id})":34}{latency["p50"]:9.2f}'
                  f'{latency["p99"]:9.2f}{latency["max"]:9.2f}  {wanted:21}'
                  f'  ({good} of {values["requests"]} requests answered by a real plan)',
                  flush=True)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--turns', type=int, default=300)
    parser.add_argument('--duration', type=float, default=20.0, help='seconds for each planner')
    parser.add_argument('--game', nargs='+', default=[str(scenarios_directory() / 'cut_in.yaml')],
                        help='game file or launcher arguments for the planners')
    values = parser.parse_args()
    print(f'{"[ms]":34}{"p50":>9}{"p99":>9}{"worst":>9}  wanted')
    with tempfile.TemporaryDirectory() as name:
        input_latency(Path(name), values.turns)
        plan_latency(Path(name), values.game, values.duration)


if __name__ == '__main__':
    main()
