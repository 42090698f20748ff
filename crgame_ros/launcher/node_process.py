# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One node of the graph as a child process."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import json
import os
from pathlib import Path
import signal

from crgame_ros.launcher.forked_node import fork_node
from crgame_ros.ros.node_main import TELL_WHERE

MAX_LINE = 10_000

Parameter = str | bool | int | float | Path | Sequence[str | Path]


@dataclass(frozen=True)
class NodeSpec:
    """
    The specification of a node's process.

    :param executable: sim_node, planner_node, …
    :param name: node name in the graph; the prefix of its output.
    :param parameters: ROS parameters; a path is passed as text.
    :param nice: its niceness, to give the simulation priority.
    :param restart: whether it may be started again when it dies.
    """

    executable: str
    name: str
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    nice: int = 0
    restart: bool = False

    @property
    def module(self) -> str:
        """Return the name of the Python module that is run."""
        return f'crgame_ros.nodes.{self.executable}'

    def arguments(self, namespace: str = '/') -> list[str]:
        """Return the arguments of the command line, for a graph in a namespace."""
        ros = ['--ros-args', '-r', f'__node:={self.name}', '-r', f'__ns:={namespace}']
        for key, value in self.parameters.items():
            # JSON is YAML, which rcl reads: any path stays one text.
            ros += ['-p', f'{key}:={json.dumps(value, ensure_ascii=False, default=str)}']
        return ros


class NodeProcess:
    """
    A running node whose output is read line by line.

    :ivar pid: process id.
    :ivar output: of the node.

    It has its own process group, so that Ctrl-C reaches the launcher only, which ends the nodes in
    good order. If the launcher is killed, the kernel ends the node (`die_with_parent`). A stopped
    node is woken for that, because its process group is orphaned.
    """

    def __init__(self, spec: NodeSpec, namespace: str = '/') -> None:
        self.spec = spec
        self.pid, reading = fork_node(spec.module, spec.arguments(namespace), spec.nice)
        self.output = os.fdopen(reading, 'rb', buffering=0)
        os.set_blocking(reading, False)
        self._code: int | None = None
        self._rest = b''

    def read_lines(self) -> list[str]:
        """Return the complete lines that have come since the last call."""
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
        """Return the exit code, negative for a signal; None while it runs."""
        if self._code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self._code = os.waitstatus_to_exitcode(status) if pid else None
        return self._code

    def interrupt(self) -> None:
        """Ask the node to end."""
        if self.exit_code() is None:
            # In a process that is still loading, SIGINT would cause a traceback.
            os.kill(self.pid, signal.SIGTERM)

    def print_stacks(self) -> None:
        """Signal the node to print the stack of each of its threads."""
        if self.exit_code() is None:
            os.kill(self.pid, TELL_WHERE)

    def kill(self) -> None:
        """End the node at once."""
        if self.exit_code() is None:
            os.kill(self.pid, signal.SIGKILL)
            self._code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])

    def close(self) -> None:
        """Release the pipe."""
        self.output.close()
