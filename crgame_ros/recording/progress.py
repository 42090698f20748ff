# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Progress messages of long work."""

from collections.abc import Callable
import sys
import time

# Shorter work prints no messages [s].
PERIOD_S = 2.0


def on_stderr(line: str) -> None:
    """Print a line for people at once, apart from the results of a command."""
    print(line, file=sys.stderr, flush=True)


class Progress:
    """
    Reports the progress of a piece of work, at most once in `PERIOD_S`.

    :param say: prints one line.
    :param what: the work, as in `reading bag: 40 %`.
    :param clock: returns the time [s].
    """

    def __init__(self, say: Callable[[str], object], what: str = '',
                 clock: Callable[[], float] = time.monotonic) -> None:
        self._say = say
        self._clock = clock
        self._what = what
        self._told_s = clock()

    def __call__(self, share: float) -> None:
        """Report the share that is done, 0 to 1."""
        now_s = self._clock()
        if now_s - self._told_s >= PERIOD_S:
            self._told_s = now_s
            self._say(f'{self._what}: {100.0 * share:.0f} %')

    def tell(self, what: str, share: float) -> None:
        """Report the share that is done of another piece of work."""
        self._what = what
        self(share)
