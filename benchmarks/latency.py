# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a driver's input to the odometry that shows it, and from a plan request to its plan."""

import argparse
from pathlib import Path
import random
import tempfile
import time

from crgame_ros.paths import scenarios_directory
from live_graph import LiveGraph, RemoteControl
import numpy as np
from odometry_probe import OdometryProbe

PLANNERS = {'idm': 'p99 <= 5', 'constant-velocity': '', 'idm-package': '',
            'reactive': 'p99 <= 100'}

STEP_S = 0.01


class InputProbe(OdometryProbe):
    """Turns a wheel left and right by an external joy device and waits until the car turns."""

    def __init__(self) -> None:
        super().__init__()
        from sensor_msgs.msg import Joy
        self._joy = Joy
        self._publisher = self.node.create_publisher(Joy, '/hv0/joy', 10)

    def turn(self, direction: float) -> float | None:
        """Turn the wheel; return the time until the odometry of a step that turns with it [s]."""
        # Axes of the generic gamepad: left stick first; triggers rest at 1.
        message = self._joy(axes=[direction, 0.0, 1.0, 0.0, 0.0, 1.0], buttons=[0] * 11)
        sent_s = time.time()
        self._publisher.publish(message)
        found = self.wait_for_turn(direction)
        return None if found is None else found[1] - sent_s


def input_latency(folder: Path, turns: int, *arguments: str) -> None:
    """
    Measure and print input to odometry.

    :param arguments: of the launcher.
    """
    graph = LiveGraph(folder / 'input', ['--driver', 'joy', '--duration', '100000', *arguments])
    control = RemoteControl()
    try:
        control.wait_until_running()
        control.deafen()
        probe = InputProbe()
        probe.listen(2.0)
        # Every phase of the cycle equally often: drawn at random, 300 of them would leave the
        # median uncertain by 0.3 ms.
        phases = [(turn + 0.5) / turns * STEP_S for turn in range(turns)]
        random.Random(1).shuffle(phases)
        times, lost = [], 0
        for turn, phase_s in enumerate(phases):
            # Long enough for the wheels to turn back and forth.
            probe.listen(0.1)
            probe.wait_for_step()
            time.sleep(phase_s)
            answer = probe.turn(0.5 if turn % 2 else -0.5)
            lost += answer is None
            times += [] if answer is None else [answer * 1e3]
        probe.close()
        graph.stop()
    finally:
        control.close()
        graph.kill()
    p50, p99, worst = np.percentile(times, [50, 99, 100])
    what = ' '.join(('input to odometry', *arguments))
    print(f'{what:34}{p50:9.2f}{p99:9.2f}{worst:9.2f}  p50 <= 6, p99 <= 11    '
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
        # With open topics no reader of the run compares partitions.
        for arguments in ((), ('--open-topics',)):
            input_latency(Path(name, *arguments), values.turns, *arguments)
        plan_latency(Path(name), values.game, values.duration)


if __name__ == '__main__':
    main()
