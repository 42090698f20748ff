# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One node of the graph as a child process."""

from dataclasses import dataclass, field
import os
import signal
import subprocess
import sys
import time

from crgame_ros.ros.node_main import NICE_VARIABLE, PARENT_VARIABLE

MAX_LINE = 10_000


@dataclass(frozen=True)
class NodeSpec:
    """
    How to start a node.

    :param executable: sim_node, planner_node, …
    :param name: node name in the graph; the prefix of its output.
    :param parameters: ROS parameters.
    :param nice: how far it steps back behind the simulation.
    :param restart: whether it may be started again when it dies.
    """

    executable: str
    name: str
    parameters: dict[str, str] = field(default_factory=dict)
    nice: int = 0
    restart: bool = False

    def command(self) -> list[str]:
        """Give the command line."""
        ros = ['--ros-args', '-r', f'__node:={self.name}']
        for key, value in self.parameters.items():
            ros += ['-p', f'{key}:={value}']
        return [sys.executable, '-u', '-m', f'crgame_ros.nodes.{self.executable}', *ros]


class NodeProcess:
    """
    A running node whose output is read line by line.

    It gets a session of its own, so that Ctrl-C reaches the launcher only, which ends the nodes
    in good order; should the launcher be killed, the kernel ends the node (`die_with_parent`).
    """

    def __init__(self, spec: NodeSpec) -> None:
        self.spec = spec
        self.started_s = time.monotonic()
        environment = os.environ | {PARENT_VARIABLE: str(os.getpid()),
                                    NICE_VARIABLE: str(spec.nice)}
        self._process = subprocess.Popen(
            spec.command(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, env=environment, start_new_session=True)
        assert self._process.stdout is not None
        self.output = self._process.stdout
        os.set_blocking(self.output.fileno(), False)
        self._rest = b''

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def read_lines(self) -> list[str]:
        """Give the complete lines that have come since the last call."""
        while True:
            try:
                data = os.read(self.output.fileno(), 65536)
            except BlockingIOError:
                break
            if not data:
                break
            self._rest += data
        *lines, self._rest = self._rest.split(b'\n')
        if len(self._rest) > MAX_LINE:
            lines.append(self._rest)
            self._rest = b''
        return [line.decode('utf-8', 'replace').rstrip() for line in lines]

    def exit_code(self) -> int | None:
        """Give the exit code, negative for a signal; None while it runs."""
        return self._process.poll()

    def interrupt(self) -> None:
        """Ask the node to end."""
        if self.exit_code() is None:
            # To a process that is still importing, SIGINT would mean a traceback.
            self._process.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End the node at once."""
        if self.exit_code() is None:
            self._process.kill()
            self._process.wait()

    def close(self) -> None:
        """Release the pipe."""
        self.output.close()
