# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Interruptions of a run: Ctrl-C, another signal, a closed terminal, a broken pipe."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import os
import signal
import subprocess
import sys
from types import FrameType

# A closed terminal ends a run like Ctrl-C.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def print_now(text: str) -> None:
    """
    Print one line at once.

    If the output has no reader any more, ask the run to end, in good order and silently.
    """
    try:
        print(text, flush=True)
    except OSError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
        os.kill(os.getpid(), signal.SIGHUP)


def run_to_its_end(command: Sequence[str]) -> int:
    """
    Run a command on this terminal.

    Ctrl-C reaches it too, and it is left to end in good order: `subprocess.run` would kill it.

    :return: its exit code.
    """
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL)
    try:
        return process.wait()
    except KeyboardInterrupt:
        process.wait()
        raise


_RECOVERED = 'still writing the files; once more leaves that to `crgame recover`'


@contextmanager
def writing(tell: Callable[[str], None], warning: str = _RECOVERED) -> Iterator[None]:
    """
    Protect the writing of a run's files from the first signal; a second one ends it.

    :param warning: printed at the first signal.
    """
    heard = 0

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        nonlocal heard
        heard += 1
        if heard > 1:
            raise KeyboardInterrupt
        tell(warning)

    before = {number: signal.signal(number, on_signal) for number in ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
