# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A search for the lanes of many poses at once, fast enough for every tick of a simulation."""

from collections.abc import Sequence
import math

from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.polyline import EQUAL_DIGITS
from crgame_ros.geometry.reference_point import seen_from
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
# Nearest samples that are compared: among lanes side by side, crossing and merging, these contain
# the best one.
CANDIDATES = 16
# Only every second sample of the tables is used.
STRIDE = 2
# A pose farther than this from every centre line is on no lane [m].
REACH = 3.0


class LaneLookup:
    """
    The lanes' centre lines as samples in one tree.

    :param tables: poses (n, 3) along the centre line of each lane, at equal distances.
    :param spacing: that distance [m]
    :param max_angle: greatest angle between a pose and a lane on which it drives [rad]
    """

    def __init__(self, tables: Sequence[FloatArray], spacing: float, max_angle: float) -> None:
        # A slow import, which only some predictions need.
        from scipy.spatial import cKDTree
        tables = [table[::STRIDE] for table in tables]
        self._poses = np.concatenate(tables)
        self._lane = np.repeat(np.arange(len(tables)), [len(table) for table in tables])
        starts = np.concatenate(([0], np.cumsum([len(table) for table in tables])[:-1]))
        self._s = STRIDE * spacing * (np.arange(len(self._poses)) - starts[self._lane])
        self._tree = cKDTree(self._poses[:, :2])
        self._max_angle = max_angle

    def find(self, poses: FloatArray) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
        """
        Return lane (-1: none), arc length and offset to the left of poses (N, 3).

        Of the lanes whose direction fits, it is the one whose centre line is nearest.
        """
        count = min(CANDIDATES, len(self._poses))
        distance, sample = self._tree.query(poses[:, :2], k=count, distance_upper_bound=REACH)
        distance, sample = distance.reshape(-1, count), sample.reshape(-1, count)
        known = np.minimum(sample, len(self._poses) - 1)
        angle = np.abs(wrap_pi_array(poses[:, None, 2] - self._poses[known, 2]))
        cost = np.round(np.where(angle <= self._max_angle, distance, math.inf), EQUAL_DIGITS)
        # Lanes that fork lie upon each other at first: of equally near ones the first counts.
        nearest_first = cost == cost.min(axis=1, keepdims=True)
        best = np.argmin(np.where(nearest_first, known, len(self._poses)), axis=1)
        rows = np.arange(len(poses))
        found = np.isfinite(cost[rows, best])
        nearest = known[rows, best]
        along, aside = seen_from(self._poses[nearest], poses[:, :2])
        return np.where(found, self._lane[nearest], -1), self._s[nearest] + along, aside
