# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What spoils a drive from outside: a page that is gone, a machine that sleeps."""

from collections.abc import Callable
import time

# A machine that slept for less was only busy [s].
SLEEP_S = 0.5


def _boot_s() -> float:
    # It goes on while the machine sleeps; the steady clock does not.
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class Disturbance:
    """
    Watches over one drive.

    :param patience_s: for which the participant's page may be gone [s].
    :param steady_s: clock that stands while the machine sleeps [s].
    :param boot_s: clock that does not [s].
    """

    def __init__(self, patience_s: float, steady_s: Callable[[], float] = time.monotonic,
                 boot_s: Callable[[], float] = _boot_s) -> None:
        self._patience_s, self._steady_s, self._boot_s = patience_s, steady_s, boot_s
        self._ahead_s = boot_s() - steady_s()
        self._lost_s: float | None = None

    def look(self, lost: bool) -> str | None:
        """
        Return why the drive does not count, None while it does.

        :param lost: whether nobody holds the participant's seat now.
        """
        now_s = self._steady_s()
        slept_s = self._boot_s() - now_s - self._ahead_s
        if slept_s > SLEEP_S:
            return f'the machine slept for {slept_s:.0f} s'
        if not lost:
            self._lost_s = None
        elif self._lost_s is None:
            self._lost_s = now_s
        elif now_s - self._lost_s > self._patience_s:
            return f"the participant's page was gone for {self._patience_s:g} s"
        return None
