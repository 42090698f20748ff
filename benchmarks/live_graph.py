# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The whole graph as a subprocess, for benchmarks that measure it."""

from collections.abc import Sequence
import json
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import time
from typing import Any

from crgame_ros.ros.environment import free_domain_id, prepare_environment

START_LIMIT_S = 60.0


class LiveGraph:
    """
    A run of the launcher in a ROS domain of its own.

    :param folder: folder of the run.
    :param arguments: further arguments of the launcher.
    :param headless: without the cockpit.
    :param source: the checkout whose program runs; None for the working directory's.
    """

    def __init__(self, folder: Path, arguments: Sequence[str], *, headless: bool = True,
                 source: Path | None = None) -> None:
        prepare_environment()
        self.folder = folder
        self.domain = free_domain_id()
        os.environ['ROS_DOMAIN_ID'] = str(self.domain)
        environment = {key: value for key, value in os.environ.items()
                       if key != 'PYTHONDONTWRITEBYTECODE'}
        self._log = folder.with_suffix('.log')
        self._log.parent.mkdir(parents=True, exist_ok=True)
        self._stream = self._log.open('wb')
        self._process = subprocess.Popen(
            [sys.executable, '-m', 'crgame_ros.launcher.main', '--out', str(folder),
             *(['--headless'] if headless else []), *arguments], stdout=self._stream,
            stderr=subprocess.STDOUT, env=environment, cwd=source, start_new_session=True)

    @property
    def running(self) -> bool:
        """Return whether the launcher still runs."""
        return self._process.poll() is None

    def node_pids(self) -> dict[str, int]:
        """Return the process ids that the launcher has printed, by node."""
        text = self._log.read_text(encoding='utf-8', errors='replace')
        return {name: int(pid) for name, pid in re.findall(
            r'^(\S+): process (\d+)$', text, re.MULTILINE)}

    def cpu_seconds(self) -> dict[str, float]:
        """Return the processor time of each node that still runs [s]."""
        used = {}
        for name, pid in self.node_pids().items():
            try:
                fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
            except OSError:
                continue
            used[name] = (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
        return used

    def wait_for(self, pattern: str) -> str:
        """Wait for a regular expression in the launcher's output; return its last group."""
        until_s = time.monotonic() + START_LIMIT_S
        while time.monotonic() < until_s:
            text = self._log.read_text(encoding='utf-8', errors='replace')
            if (found := re.search(pattern, text)) is not None:
                return found[found.lastindex or 0]
            time.sleep(0.05)
        sys.exit(f'it did not come to "{pattern}"; the output is in {self._log}')

    def page(self) -> str:
        """Wait for the address of the cockpit."""
        return self.wait_for(r'the cockpit is at (http://\S+)')

    def wait(self) -> dict[str, Any]:
        """Wait for the end of the run and return its timing report."""
        code = self._process.wait()
        self._stream.close()
        if code != 0:
            sys.exit(f'the run failed ({code}); its output is in {self._log}')
        report: dict[str, Any] = json.loads((self.folder / 'timing.json').read_text())
        return report

    def stop(self) -> dict[str, Any]:
        """End the run in good order and return its timing report."""
        self._process.send_signal(signal.SIGINT)
        return self.wait()

    def kill(self) -> None:
        """End the run, whatever its state."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(15.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
        self._stream.close()


class RemoteControl:
    """A client of sim_node's services, and a look at its clock."""

    def __init__(self) -> None:
        import rclpy
        from rosgraph_msgs.msg import Clock
        from std_srvs.srv import Trigger
        self._rclpy = rclpy
        self._trigger = Trigger
        rclpy.init()
        self._node = rclpy.create_node('benchmark')
        self._clients: dict[str, Any] = {}
        self._clock_ns = 0
        self._subscription = self._node.create_subscription(Clock, '/clock', self._on_clock, 10)

    def _on_clock(self, message: Any) -> None:
        self._clock_ns = message.clock.sec * 10**9 + message.clock.nanosec

    def wait_until_running(self) -> None:
        """Wait until simulation time advances."""
        first, limit_s = 0, time.monotonic() + START_LIMIT_S
        while time.monotonic() < limit_s:
            self._rclpy.spin_once(self._node, timeout_sec=0.1)
            if first and self._clock_ns > first:
                return
            first = first or self._clock_ns
        sys.exit('the graph did not start')

    def call(self, name: str) -> None:
        """Call a service of sim_node, such as pause."""
        if name not in self._clients:
            self._clients[name] = self._node.create_client(self._trigger, f'/sim/{name}')
            self._clients[name].wait_for_service(START_LIMIT_S)
        future = self._clients[name].call_async(self._trigger.Request())
        self._rclpy.spin_until_future_complete(self._node, future, timeout_sec=START_LIMIT_S)

    def deafen(self) -> None:
        """Stop listening to the clock, so as not to load the measured graph."""
        self._node.destroy_subscription(self._subscription)

    def close(self) -> None:
        """Leave the graph."""
        self._node.destroy_node()
        self._rclpy.try_shutdown()
