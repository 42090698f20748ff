# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The steering reversal rate (Markkula and Engstroem 2006).

G. Markkula, J. Engstroem: A steering wheel reversal rate metric for assessing effects of visual
and cognitive secondary task load. ITS World Congress, London, 2006.
"""

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

ORDER = 2
# A shorter piece cannot show reversals of 0.6 Hz [s].
SHORTEST_S = 2.0


class ReversalSetting(NamedTuple):
    """
    Settings of the reversal rate.

    :param cutoff_hz: cut-off frequency of the low pass [Hz]
    :param gap_deg: the wheel must turn by more than this angle [degrees]
    """

    cutoff_hz: float
    gap_deg: float


VISUAL = ReversalSetting(0.6, 3.0)
COGNITIVE = ReversalSetting(2.0, 0.1)


def smoothed(angles_deg: FloatArray, dt_s: float, cutoff_hz: float) -> FloatArray:
    """
    Filter angles forwards and backwards by a Butterworth low pass of order 2.

    :param angles_deg: (N) dt apart, N > 9 [degrees]
    """
    from scipy.signal import butter, filtfilt  # Takes a second.
    numerator, denominator = butter(ORDER, cutoff_hz, fs=1.0 / dt_s)
    return np.asarray(filtfilt(numerator, denominator, angles_deg))


def stationary_points(angles_deg: FloatArray) -> FloatArray:
    """
    Return the angles at which the difference changes sign, or the previous one is zero.

    The first sample counts as one, as in the code of the authors.
    """
    steps = np.diff(angles_deg)
    before, after = steps[:-1], steps[1:]
    turns = (np.sign(before) * np.sign(after) < 0.0) | (before == 0.0)
    return np.concatenate((angles_deg[:1], angles_deg[1:-1][turns]))


def count_reversals(points_deg: FloatArray, gap_deg: float) -> int:
    """Count the reversals among stationary points, upwards and downwards."""
    return _upwards(points_deg, gap_deg) + _upwards(-points_deg, gap_deg)


def _upwards(points_deg: FloatArray, gap_deg: float) -> int:
    count, kept = 0, math.inf
    for point in points_deg.tolist():
        if point - kept > gap_deg:
            count, kept = count + 1, point
        elif point <= kept:
            kept = point
    return count


def reversal_rate(pieces: Sequence[FloatArray], dt_s: float, setting: ReversalSetting) -> float:
    """
    Return the reversals of a steering wheel per minute.

    :param pieces: angles of the steering wheel, each dt apart and without a gap; those shorter
        than `SHORTEST_S` are left out [degrees]
    :return: NaN if no piece is left, or the cut-off is beyond half the sampling rate [1/min]
    """
    # A filter of order 2 is padded by 9 samples at either end.
    long = [piece for piece in pieces if len(piece) * dt_s >= SHORTEST_S and len(piece) > 9]
    if not long or setting.cutoff_hz >= 0.5 / dt_s:
        return math.nan
    # A wheel that never turns has no reversals; its run then needs no filter, which takes seconds.
    count = sum(count_reversals(stationary_points(smoothed(piece, dt_s, setting.cutoff_hz)),
                                setting.gap_deg) for piece in long if piece.min() < piece.max())
    return 60.0 * count / (dt_s * sum(len(piece) - 1 for piece in long))
