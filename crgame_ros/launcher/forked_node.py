# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Turning a fork of the launcher into a node.

What nodes need takes each of them one to three seconds to load, the agents' compiled code and
planners the longest. The launcher loads it once. Its forks share it and begin at once, and so do
those that take the place of a node that has died. The launcher never speaks DDS and has no threads
of its own, which a fork could not take along.
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

# No process has more open files.
MAX_FILES = 1 << 20


def load(names: Sequence[str]) -> None:
    """
    Import what nodes import, before the first fork.

    :param names: modules, or functions of theirs to be called, as `module:function`.
    """
    for name in names:
        module, _, function = name.partition(':')
        try:
            found = import_module(module)
        except Exception:
            # The node that needs it fails as well, and says how.
            continue
        if function:
            getattr(found, function)()
    gc.collect()
    # Pages that no collection touches stay shared.
    gc.freeze()


def fork_node(module: str, arguments: Sequence[str], nice: int) -> tuple[int, int]:
    """
    Start a node in a process group of its own.

    :param module: in which it is; its `main` is called.
    :param arguments: of its command line.
    :param nice: how far it steps back behind the simulation.
    :return: process id, and a descriptor from which its output is read.
    """
    reading, writing = os.pipe()
    parent = os.getpid()
    sys.stdout.flush()
    sys.stderr.flush()
    # A signal that comes before the fork has let go of the launcher's handlers waits until then.
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
    """Give up what is the launcher's: its group, signals, files and terminal."""
    os.setpgid(0, 0)
    # What the terminal sent to all of the group until now was meant for the launcher.
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
    """Run a node to its end, and give its exit code."""
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
