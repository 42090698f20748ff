# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Equally spaced rays, and which of them meet a given sector."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# Of the spacing of rays: takes in a ray that only rounding keeps out of a sector.
_ROUNDING = 1e-9


class RayFan:
    """
    Rays over a field of view, the first and the last on its borders.

    Over a full circle the rays are spaced evenly, so that the last does not double the first.

    :param field_of_view: full angle [rad]
    :param rays: number of rays
    """

    def __init__(self, field_of_view: float, rays: int) -> None:
        full = field_of_view > 2.0 * math.pi - 1e-9
        gaps = rays if full else rays - 1
        self._last = rays - 1
        # A single ray points ahead.
        self._first = -0.5 * field_of_view if gaps else 0.0
        self._spacing = field_of_view / gaps if gaps else 1.0
        self.angles: Array = self._first + self._spacing * np.arange(rays, dtype=np.float64)

    def within(self, start: Array, width: Array) -> tuple[Index, Index]:
        """
        Pair rays and the sectors that they lie in.

        :param start: (K) direction at which each sector begins, any representation [rad]
        :param width: (K) angle that it covers counter-clockwise [rad]
        :return: (Q) rays and (Q) sectors, of every pair
        """
        begin = np.mod(start - self._first, 2.0 * np.pi)
        # A sector beyond a full turn from the first ray covers rays at the beginning again.
        begin = np.concatenate((begin, begin - 2.0 * np.pi)) / self._spacing
        end = begin + np.concatenate((width, width)) / self._spacing
        low = np.maximum(np.ceil(begin - _ROUNDING), 0.0).astype(np.intp)
        high = np.minimum(np.floor(end + _ROUNDING), self._last).astype(np.intp)
        counts = np.maximum(high - low + 1, 0)
        sectors = np.repeat(np.tile(np.arange(len(start)), 2), counts)
        before = np.cumsum(counts) - counts
        rays = np.arange(len(sectors)) - np.repeat(before - low, counts)
        return rays, sectors
