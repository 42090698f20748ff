# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Time stamps of other clocks, corrected by the offsets that LSL has measured.

Each sample is recorded with its stamp as sent and the offset that was known then. Between two
measurements the offset follows a straight line: a clock that drifts by 50 ppm is then corrected
without steps.
"""

import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
# Fewer measurements make no slope.
_LEAST = 3


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
