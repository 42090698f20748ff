# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The host's own jitter: a process that does nothing but sleep to absolute deadlines."""

import multiprocessing
from multiprocessing.sharedctypes import Synchronized
import time


def _sleep(period_s: float, listening: 'Synchronized[int]', worst: 'Synchronized[float]',
           deadlines: 'Synchronized[int]', missed: 'Synchronized[int]') -> None:
    deadline = time.monotonic()
    while True:
        deadline += period_s
        time.sleep(max(0.0, deadline - time.monotonic()))
        late = time.monotonic() - deadline
        if listening.value:
            worst.value = max(worst.value, late)
            deadlines.value += 1
            missed.value += late > period_s
        # A lag is counted once, not again by every deadline that it covers.
        deadline = max(deadline, time.monotonic() - period_s)


class BareLoop:
    """Runs beside the measured program and keeps the worst stall while asked to listen."""

    def __init__(self, period_s: float) -> None:
        context = multiprocessing.get_context('fork')
        self._listening = context.Value('i', 0)
        self._worst = context.Value('d', 0.0)
        self._deadlines, self._missed = context.Value('q', 0), context.Value('q', 0)
        self._process = context.Process(
            target=_sleep, daemon=True, args=(period_s, self._listening, self._worst,
                                              self._deadlines, self._missed))
        self._process.start()

    def listen(self, on: bool) -> None:
        """Start or stop counting stalls."""
        self._listening.value = int(on)

    @property
    def worst_ms(self) -> float:
        """Worst lateness while listening [ms]."""
        return 1e3 * float(self._worst.value)

    @property
    def held(self) -> float:
        """Share of the deadlines met within a period while listening."""
        return 1.0 - self._missed.value / max(1, self._deadlines.value)

    def stop(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
