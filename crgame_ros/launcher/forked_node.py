# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Turning a fork of the launcher into a node.

The imports of a node take one to three seconds, the agents' compiled code and planners the
longest. The launcher loads them once. Its forks share them and start at once, and so do
replacements of a node that has died. The launcher never uses DDS and has no threads of its own,
which a fork could not copy.
"""

from collections.abc import Sequence
import gc
from importlib import import_module
import os
import signal
import sys
import traceback
from typing import NoReturn

from crgame_ros.launcher.interruption import ENDING
from crgame_ros.ros.node_main import (
    die_with_parent,
    name_process,
    NICE_VARIABLE,
    PARENT_VARIABLE,
)

# Upper limit of a process's open files.
MAX_FILES = 1 << 20


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


def fork_node(module: str, arguments: Sequence[str], nice: int) -> tuple[int, int]:
    """
    Start a node in a process group of its own.

    :param module: of the node; its `main` is called.
    :param arguments: its command line.
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
        _end(code)


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


def _end(code: int) -> NoReturn:
    os._exit(code & 0xff)
