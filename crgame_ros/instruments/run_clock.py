# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The run's clock, this machine's, that of LSL, and the corrections between them.

Every cycle's start on the steady clock is recorded (`/timing/cycle`): nothing is estimated. A
state of step n is that of this start. What happens between two starts lies between their steps;
a pause of the run is such a stretch.

Each sample is recorded with its stamp as sent and the offset that was known then. Between two
measurements the offset follows a straight line: a clock that drifts by 50 ppm is then corrected
without steps.
"""

from bisect import bisect_left
from collections import deque
import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
# Starts of cycles that are kept: a minute of the fastest simulation that is published.
KEPT = 60_000
# Fewer measurements make no slope.
_LEAST = 3


def run_times_s(steady_s: FloatArray, starts: FloatArray, dt_s: float) -> FloatArray:
    """
    Return when something happened, on the run's clock (R) [s since the run's start].

    Before the first known cycle and after the last, the run's clock goes on as the steady clock.

    :param steady_s: (R) on the machine's steady clock [s]
    :param starts: (N, 2) steps n, increasing, and the starts of their cycles [s]; one or more.
    :param dt_s: simulation step [s]
    """
    times_s, begun_s = starts[:, 0] * dt_s, starts[:, 1]
    found = np.interp(steady_s, begun_s, times_s)
    found += np.minimum(steady_s - begun_s[0], 0.0) + np.maximum(steady_s - begun_s[-1], 0.0)
    return np.asarray(found)


class CycleStarts:
    """
    The starts of the latest cycles of a run that goes on.

    :param dt_s: simulation step [s]
    """

    def __init__(self, dt_s: float) -> None:
        self._dt_s = dt_s
        self._ns: deque[int] = deque(maxlen=KEPT)
        self._starts_s: deque[float] = deque(maxlen=KEPT)

    def add(self, n: int, start_s: float) -> None:
        """Add a cycle [s]; one that comes late or twice is left out."""
        if not self._ns or n > self._ns[-1]:
            self._ns.append(n)
            self._starts_s.append(start_s)

    @property
    def newest(self) -> int | None:
        """Return the newest step whose start is known; None without any."""
        return self._ns[-1] if self._ns else None

    def steady_s(self, n: int) -> float | None:
        """
        Return when a step was, on the steady clock [s]; None while that is not known yet.

        A step before the first known one was as much earlier as the schedule has it; one whose
        cycle was not heard is that of the next.
        """
        if not self._ns or n > self._ns[-1]:
            return None
        if n < self._ns[0]:
            return self._starts_s[0] - (self._ns[0] - n) * self._dt_s
        return self._starts_s[bisect_left(self._ns, n)]


def corrected_s(connections: NDArray[np.int64], sent_s: FloatArray, offsets_s: FloatArray,
                ) -> FloatArray:
    """
    Return stamps on the steady clock of this machine (R) [s]; NaN where no offset is known.

    :param connections: (R) stretches of one clock; offsets of one are not those of another.
    :param sent_s: (R) stamps on the sender's clock, in the order of their arrival [s]
    :param offsets_s: (R) offsets known at the arrival; NaN before the first measurement [s]
    """
    found = np.full(len(sent_s), np.nan)
    for connection in np.unique(connections):
        mine = connections == connection
        at_s, measured_s = _measured(sent_s[mine], offsets_s[mine])
        if len(at_s):
            found[mine] = sent_s[mine] + np.interp(sent_s[mine], at_s, measured_s)
    return found


def clock_drift(connections: NDArray[np.int64], sent_s: FloatArray,
                offsets_s: FloatArray) -> float:
    """
    Return by how much the sender's clock runs faster than this machine's [s/s].

    It is the slope of the line of least squares through the offsets of the longest connection;
    NaN with fewer than three. Parameters are those of `corrected_s`.
    """
    if not len(connections):
        return math.nan
    numbers, counts = np.unique(connections, return_counts=True)
    mine = connections == numbers[np.argmax(counts)]
    at_s, measured_s = _measured(sent_s[mine], offsets_s[mine])
    if len(at_s) < _LEAST:
        return math.nan
    from_mean_s = at_s - at_s.mean()
    return float(-np.sum(from_mean_s * measured_s) / np.sum(from_mean_s ** 2))


def _measured(sent_s: FloatArray, offsets_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """
    Return the measurements of a connection: their times on the sender's clock, and the offsets.

    The first sample with a new offset tells when it was measured.
    """
    known = np.flatnonzero(np.isfinite(offsets_s))
    fresh = known[np.diff(offsets_s[known], prepend=np.nan) != 0.0]
    # Some programs stamp out of order.
    fresh = fresh[np.argsort(sent_s[fresh], kind='stable')]
    return sent_s[fresh], offsets_s[fresh]
