# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The speeds from which one slows down in time for all that comes."""

import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class SpeedEnvelope:
    """
    The speed allowed at each arc length, so that all that comes can be slowed down for.

    v(s)^2 = min over s' >= s of V(s')^2 + 2 b (s' - s), where V is the limit at s'.

    :param s: (n,) arc lengths, ascending [m]
    :param limit: (n,) V, finite [m/s]
    :param deceleration: b [m/s^2]
    """

    def __init__(self, s: FloatArray, limit: FloatArray, deceleration: float) -> None:
        self._s = s
        potential = limit**2 + 2.0 * deceleration * s
        reachable = np.minimum.accumulate(potential[::-1])[::-1]
        self._squares: FloatArray = np.maximum(reachable - 2.0 * deceleration * s, 0.0)

    @property
    def speeds(self) -> FloatArray:
        """Speed allowed at each of the arc lengths, (n,) [m/s]."""
        return np.asarray(np.sqrt(self._squares))

    def at(self, s: float) -> float:
        """Return the speed allowed at an arc length [m/s]; exact under constant deceleration."""
        return math.sqrt(np.interp(s, self._s, self._squares))
