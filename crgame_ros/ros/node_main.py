# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The main function of every node: environment, start, clean end, one-line errors."""

from collections.abc import Callable
import faulthandler
import gc
import os
from pathlib import Path
import signal
import sys
import threading
import time
from types import FrameType
from typing import Protocol

from crgame_ros.processes import end_with_parent, name_process

NICE_VARIABLE = 'CRGAME_NICE'
# At this signal a node prints the stacks of its threads.
TELL_WHERE = signal.SIGUSR1
# A node that has lost its parent has this long to end in good order; period of that check [s].
_GRACE_S, _LOOK_S = 40.0, 2.0
# Longest time in which a node releases its endpoints [s].
_RELEASE_S = 30.0


class StopFlag:
    """A flag that SIGINT and SIGTERM set; a node's loop polls it and ends in good order."""

    def __init__(self) -> None:
        self.requested = False

    def listen(self) -> None:
        """Replace Python's handlers of SIGINT and SIGTERM."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self.requested = True


class RunnableNode(Protocol):
    """A node with a loop of its own."""

    def run(self, stop: StopFlag) -> None:
        """Work until asked to stop, or until the node is done."""

    def destroy_node(self) -> None:
        """Release the node's endpoints."""


def die_with_parent() -> None:
    """
    End with a parent that asked for it, and at once if a good end takes too long.

    If something hangs, no parent is left to end this process.
    """
    parent = end_with_parent()
    if parent is not None:
        threading.Thread(target=_end_alone, args=(parent,), name='alone', daemon=True).start()


def _end_alone(parent: int) -> None:
    """End this process some time after its parent, even if its main thread hangs."""
    while os.getppid() == parent:
        time.sleep(_LOOK_S)
    time.sleep(_GRACE_S)
    os._exit(1)


def _check_parameters(node: RunnableNode) -> None:
    """
    Refuse parameters of the command line that the node does not have.

    rclpy ignores them: with a misspelt name a node would silently do something else.

    :raises InputError: naming those that it has.
    """
    from crgame_ros.errors import InputError
    has = sorted(getattr(node, '_parameters', {}))
    for name in getattr(node, '_parameter_overrides', {}):
        if name not in has and not name.startswith('qos_overrides.'):
            raise InputError(f'there is no parameter "{name[:100]}"', 'command line',
                             'there are ' + ', '.join(has))


def run_node(create: Callable[[], RunnableNode]) -> None:
    """
    Run a node until it is done, interrupted or shut down.

    Signals are handled here, not by rclpy: its handlers invalidate the context at once, so that
    nothing could be published or drained at the end. The exit code is 0 at the end or after a
    signal, 2 on bad input and 1 on any other known error, always with a one-line reason.

    :param create: builds the node, once rclpy is initialised.
    """
    faulthandler.register(TELL_WHERE)
    name_process(Path(sys.argv[0]).stem)
    die_with_parent()
    from crgame_ros.ros.environment import prepare_environment
    prepare_environment()

    from crgame_ros.errors import CrgameError, InputError, one_line
    from crgame_ros.ros.shared_memory import remove_half_made_ports
    import rclpy
    from rclpy.exceptions import ParameterException
    from rclpy.signals import SignalHandlerOptions

    remove_half_made_ports()
    stop = StopFlag()
    stop.listen()
    code = 0
    node = None
    try:
        try:
            rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        except RuntimeError as error:
            raise InputError(f'ROS refuses it: {one_line(str(error))}', 'command line') from error
        node = create()
        _check_parameters(node)
        # Planners and the recorder yield processor time to the simulation and the driver. The
        # middleware's threads, which already exist, do not: they hold locks that the simulation
        # and the driver wait for.
        os.nice(int(os.environ.get(NICE_VARIABLE, '0')))
        node.run(stop)
    except CrgameError as error:
        print(f'error: {error}', file=sys.stderr, flush=True)
        code = error.exit_code
    except ParameterException as error:
        print(f'error: {" ".join(str(error).split())}', file=sys.stderr, flush=True)
        code = 2
    finally:
        # Fast DDS waits for itself for ever if it destroys an endpoint while the lease of another
        # participant ends. It holds Python's lock then: only C code can end the process.
        faulthandler.dump_traceback_later(_RELEASE_S, exit=True)
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
        # Objects that nodes froze, and reference cycles through rclpy's compiled part, would never
        # be freed. Other compiled packages report such leaks in dozens of lines.
        gc.unfreeze()
        gc.enable()
        if node is not None:
            vars(node).clear()
        gc.collect()
        faulthandler.cancel_dump_traceback_later()
    sys.stdout.flush()
    sys.exit(code)
