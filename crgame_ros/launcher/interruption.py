# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What ends a run from outside: Ctrl-C, a signal, a closed terminal, a pipe that breaks."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
import signal
import sys
from types import FrameType

# A closed terminal is a wish to end like any other.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def print_now(text: str) -> None:
    """
    Print one line at once.

    Where nobody reads it any more the run is asked to end, in good order and silently.
    """
    try:
        print(text, flush=True)
    except OSError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
        os.kill(os.getpid(), signal.SIGHUP)


_RECOVERED = 'still writing the files; once more leaves that to `crgame recover`'


@contextmanager
def writing(tell: Callable[[str], None], warning: str = _RECOVERED) -> Iterator[None]:
    """
    Let the files of a run be written whatever signal comes; a second one is meant.

    :param tell: prints one line.
    :param warning: what it prints at the first signal.
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
