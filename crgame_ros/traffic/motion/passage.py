# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The side on which a lane passes standing obstacles, and the room there."""

from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Sides whose offsets differ by less count as equal: more room decides, then the side towards the
# middle of the road [m].
TIE = 0.05
# An obstacle's clearance shrinks by less than this under the force of the band [m].
SLACK = 1e-3
EQUAL = 1e-9


class Obstacles(NamedTuple):
    """
    Standing obstacles in the frame of a lane, as boxes along it.

    :param s: (M,) centre along the lane [m]
    :param d: (M,) centre to the left of its centre line [m]
    :param half_length: (M,) along the lane [m]
    :param half_width: (M,) across [m]
    """

    s: Array
    d: Array
    half_length: Array
    half_width: Array

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> 'Obstacles':
        """Return some of them."""
        return Obstacles._make(column[chosen] for column in self)


@dataclass(frozen=True)
class Passage:
    """
    One way past obstacles that overlap along the lane.

    :param first: first node of the grid beside them
    :param low: (n,) least offset from node `first` on [m]
    :param high: (n,) greatest offset [m]
    :param near_s: where the first of them begins [m]
    """

    first: int
    low: Array
    high: Array
    near_s: float


@dataclass(frozen=True)
class PassageRules:
    """
    How near to obstacles agents drive.

    :param clearance: wanted between the sides of a vehicle and an obstacle [m]
    :param min_clearance: with less the lane is blocked [m]
    :param half_width: of the vehicles [m]
    :param half_length: of the vehicles, added before and behind each obstacle [m]
    :param wide_half_width: of the widest vehicles, which the way suits wherever there is room for
        them; at least `half_width` [m]
    :param left_first: whether the left side wins a tie.
    """

    clearance: float
    min_clearance: float
    half_width: float
    half_length: float
    wide_half_width: float
    left_first: bool = True

    def in_the_way(self, obstacles: Obstacles) -> NDArray[np.bool_]:
        """Return which of them are nearer to the centre line than a vehicle and its clearance."""
        reach = obstacles.half_width + self.wide_half_width + self.clearance
        return np.abs(obstacles.d) < reach

    def groups(self, obstacles: Obstacles, step: float) -> list[Obstacles]:
        """
        Group obstacles that a vehicle passes at the same time, in the order along the lane.

        :param step: of the grid: two groups have no node in common [m]
        """
        order = np.lexsort((obstacles.d, obstacles.s - obstacles.half_length))
        obstacles = obstacles.select(order)
        begin = obstacles.s - obstacles.half_length - self.half_length
        end = np.maximum.accumulate(obstacles.s + obstacles.half_length + self.half_length)
        splits = np.flatnonzero(begin[1:] > end[:-1] + 3.0 * step) + 1
        return [obstacles.select(part) for part in np.split(np.arange(len(begin)), splits)]

    def choose(self, group: Obstacles, step: float, left: Array, right: Array,
               for_wide: bool = True) -> Passage | None:
        """
        Return the way past a group, through one of the slots between neighbours across.

        A way with full clearance is better than one without. Then the smaller offset decides,
        then more room, then `left_first`.

        :param step: of the grid [m]
        :param left: (S,) room to the left of the centre line at the nodes [m]
        :param right: (S,) to the right [m]
        :param for_wide: whether to look first for a way for the widest vehicles.
        :return: None where no way leaves the least clearance.
        """
        group = group.select(np.argsort(group.d, kind='stable'))
        best = None
        if for_wide and self.wide_half_width > self.half_width:
            best = self._best(group, self.wide_half_width, step, left, right)
        return best or self._best(group, self.half_width, step, left, right)

    def _best(self, group: Obstacles, half_width: float, step: float, left: Array,
              right: Array) -> Passage | None:
        """Return the best way for vehicles of a width; the group is sorted by d."""
        reach = group.half_length + self.half_length
        first = max(math.floor((group.s - reach).min() / step), 0)
        last = min(math.ceil((group.s + reach).max() / step), len(left) - 1)
        lows, highs = self._slots(group, half_width, step * np.arange(first, last + 1), 0.5 * step)
        edge_high = np.maximum(left[first:last + 1] - half_width, 0.0)
        edge_low = -np.maximum(right[first:last + 1] - half_width, 0.0)
        room = np.minimum(np.minimum(edge_high - lows, highs - edge_low),
                          0.5 * (highs - lows)).min(axis=1)
        best, best_key = None, (True, math.inf, math.inf)
        slots = range(len(room))
        # The first slot tried wins a tie.
        for slot in reversed(slots) if self.left_first else slots:
            if room[slot] < self.min_clearance - EQUAL:
                continue
            margin = min(room[slot], self.clearance) + SLACK
            low = np.maximum(lows[slot] + margin, edge_low)
            high = np.minimum(highs[slot] - margin, edge_high)
            middle = 0.5 * (low + high)
            tight = low > high
            low, high = np.where(tight, middle, low), np.where(tight, middle, high)
            offset = float(np.maximum(np.maximum(low, -high), 0.0).max())
            key = (bool(room[slot] < self.clearance - EQUAL), TIE * round(offset / TIE),
                   -round(float(room[slot]), 6))
            if key < best_key:
                best_key = key
                best = Passage(first, low, high, float((group.s - group.half_length).min()))
        return best

    def _slots(self, group: Obstacles, half_width: float, nodes: Array,
               margin: float) -> tuple[Array, Array]:
        """
        Return the bounds of each slot: slot j passes left of the first j, right of the others.

        :param group: sorted by d
        :param margin: added along the lane, because the band is bounded only at nodes [m]
        :return: lowest and highest offset that touch nothing, both (m + 1, n) [m]
        """
        reach = group.half_length + self.half_length + margin
        beside = np.abs(nodes - group.s[:, None]) <= reach[:, None]
        above = np.where(beside, (group.d + group.half_width + half_width)[:, None], -np.inf)
        below = np.where(beside, (group.d - group.half_width - half_width)[:, None], np.inf)
        unbounded = np.full((1, len(nodes)), np.inf)
        lows = np.maximum.accumulate(np.concatenate((-unbounded, above)), axis=0)
        highs = np.minimum.accumulate(np.concatenate((below, unbounded))[::-1], axis=0)[::-1]
        return lows, highs
