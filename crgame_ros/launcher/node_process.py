# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
One node of the graph as a child process: a fork of the launcher, or a program.

The imports of a node take one to three seconds, the agents' compiled code and planners the
longest. The launcher loads them once. Its forks share them and start at once, and so do
replacements of a node that has died. The launcher never uses DDS and has no threads of its own,
which a fork could not copy.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import gc
from importlib import import_module
import json
import os
from pathlib import Path
import signal
import sys
import traceback

from crgame_ros.launcher.interruption import ENDING
from crgame_ros.processes import name_process, PARENT_VARIABLE
from crgame_ros.ros.node_main import die_with_parent, NICE_VARIABLE, TELL_WHERE

MAX_LINE = 10_000

Parameter = str | bool | int | float | Path | Sequence[str | Path]
# Upper limit of a process's open files.
MAX_FILES = 1 << 20


@dataclass(frozen=True)
class NodeSpec:
    """
    The specification of a node's process.

    :param executable: sim_node, planner_node, …
    :param parameters: ROS parameters; a path is passed as text.
    :param nice: its niceness, to give the simulation priority.
    :param vehicle: id of the only one that it is for, a parameter of it; empty if it is for all.
    """

    executable: str
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    nice: int = 0
    vehicle: str = ''

    @property
    def name(self) -> str:
        """Return the node's name in the graph; the prefix of its output."""
        return f'{self.executable}_{self.vehicle}' if self.vehicle else self.executable

    @property
    def module(self) -> str:
        """Return the name of the Python module that is run."""
        return f'crgame_ros.nodes.{self.executable}'

    def arguments(self, namespace: str = '/') -> list[str]:
        """Return the arguments of the command line, for a graph in a namespace."""
        ros = ['--ros-args', '-r', f'__node:={self.name}', '-r', f'__ns:={namespace}']
        own: Mapping[str, Parameter] = {'vehicle': self.vehicle} if self.vehicle else {}
        for key, value in {**own, **self.parameters}.items():
            # JSON is YAML, which rcl reads: any path stays one text.
            ros += ['-p', f'{key}:={json.dumps(value, ensure_ascii=False, default=str)}']
        return ros


class NodeProcess:
    """
    A running node whose output is read line by line.

    It has its own process group, so that Ctrl-C reaches the launcher only, which ends the nodes in
    good order. If the launcher is killed, the kernel ends the node (`die_with_parent`). A stopped
    node is woken for that, because its process group is orphaned.
    """

    def __init__(self, spec: NodeSpec, namespace: str = '/') -> None:
        self.spec = spec
        self.pid, reading = _fork_node(spec.module, spec.arguments(namespace), spec.nice)
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


def load(names: Sequence[str]) -> None:
    """
    Import the nodes' modules before the first fork.

    :param names: modules, or functions of theirs to be called, as `module:function`.
    """
    for name in names:
        module, _, function = name.partition(':')
        try:
            found = import_module(module)
        except Exception:
            # The node that needs it fails as well, and reports the error.
            continue
        if function:
            getattr(found, function)()
    gc.collect()
    # Memory pages that no collection touches stay shared.
    gc.freeze()


def _fork_node(module: str, arguments: Sequence[str], nice: int) -> tuple[int, int]:
    """
    Start a node in a process group of its own.

    :param module: of the node; its `main` is called.
    :param nice: its niceness, to give the simulation priority.
    :return: process id, and a descriptor from which its output is read.
    """
    reading, writing = os.pipe()
    parent = os.getpid()
    sys.stdout.flush()
    sys.stderr.flush()
    # Signals are blocked until the fork has removed the launcher's handlers.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    pid = os.fork()
    if pid:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        os.close(writing)
        return pid, reading
    code = 1
    try:
        _detach(writing)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        os.environ |= {PARENT_VARIABLE: str(parent), NICE_VARIABLE: str(nice)}
        die_with_parent()
        name_process(module.rpartition('.')[2])
        code = _run(module, arguments)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        # The launcher's own work on the stack below must not go on here.
        os._exit(code & 0xff)


def _detach(output: int) -> None:
    """Release the launcher's process group, signal handlers, files and terminal."""
    os.setpgid(0, 0)
    # Signals that the terminal sent to the group until now were meant for the launcher.
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    for number in ENDING:
        signal.signal(number, signal.SIG_DFL)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(output, 1)
    os.dup2(output, 2)
    os.closerange(3, MAX_FILES)
    sys.stdin = open(0, closefd=False)
    for name, place in (('stdout', 1), ('stderr', 2)):
        setattr(sys, name, open(place, 'w', buffering=1, errors='backslashreplace',
                                closefd=False))


def _run(name: str, arguments: Sequence[str]) -> int:
    """Run a node to its end, and return its exit code."""
    module = import_module(name)
    sys.argv[:] = [str(module.__file__), *arguments]
    try:
        module.main()
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return end.code or 0
        print(end.code, file=sys.stderr)
        return 1
    return 0
