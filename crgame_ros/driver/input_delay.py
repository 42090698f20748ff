# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The delay from an input until the first state that results from it is known here."""

from collections import deque
import statistics

# Enough for the present delay; a single late step does not affect the median.
_KEPT = 21
# Time after which a measurement ends: a run that stands still does not react [s].
_GIVE_UP_S = 1.0


class InputDelay:
    """The delay, measured on one clock with inputs that change something."""

    def __init__(self) -> None:
        self._pending: tuple[float, int] | None = None
        self._measured_ms: deque[float] = deque(maxlen=_KEPT)

    @property
    def turn_ms(self) -> float | None:
        """Return the median of the last measurements [ms]; None before the first."""
        return statistics.median(self._measured_ms) if self._measured_ms else None

    def changed(self, now_s: float, n: int) -> None:
        """
        Note an input that is passed on.

        :param now_s: steady clock [s]
        :param n: newest step that is known.
        """
        if self._pending is None or now_s - self._pending[0] > _GIVE_UP_S:
            self._pending = (now_s, n)

    def stepped(self, now_s: float, n: int) -> None:
        """Note a state that has come."""
        if self._pending is None:
            return
        since_s, before_n = self._pending
        if now_s - since_s > _GIVE_UP_S or n < before_n:
            self._pending = None
        elif n > before_n:
            self._measured_ms.append((now_s - since_s) * 1e3)
            self._pending = None

    def total_ms(self, round_trip_ms: float | None) -> float | None:
        """Return the delay from the hand to the answer at the page [ms], with the round trip."""
        if self.turn_ms is None or round_trip_ms is None:
            return None
        return self.turn_ms + round_trip_ms
