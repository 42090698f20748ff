# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which lanes are near a point: a grid over the map, made once."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from crgame_ros.traffic.lane_graph import FloatArray, IntArray, LaneGraph

CELL = 3.0
# How far from a centre line a body's centre may be and still reach into the lane [m].
REACH = 9.0


class LaneCells:
    """
    The lanes near each cell of a grid, with the arc length nearest to the cell.

    :param graph: the lanes.
    """

    def __init__(self, graph: LaneGraph) -> None:
        self._graph = graph
        self._origin = np.array([graph.x.min(), graph.y.min()]) - 2.0 * REACH
        extent = np.array([graph.x.max(), graph.y.max()]) + 2.0 * REACH - self._origin
        self._columns = int(extent[1] / CELL) + 2
        self._rows = int(extent[0] / CELL) + 2
        reach = int(np.ceil(REACH / CELL))
        around = np.arange(-reach, reach + 1)
        shift = (around[:, None] * self._columns + around[None, :]).ravel()
        keys, lanes, guesses = [], [], []
        for lane in range(len(graph)):
            rows = slice(int(graph.first[lane]), int(graph.first[lane] + graph.count[lane]))
            points = np.stack((graph.x[rows], graph.y[rows]), axis=-1)
            cells = np.unique((np.unique(self._cells(points))[:, None] + shift).ravel())
            distance, nearest = cKDTree(points).query(self._centers(cells))
            near = distance <= REACH + CELL
            keys.append(cells[near])
            lanes.append(np.full(int(near.sum()), lane))
            guesses.append(nearest[near] * graph.step[lane])
        key, lane_of, guess = (np.concatenate(x) for x in (keys, lanes, guesses))
        order = np.lexsort((lane_of, key))
        self._keys, self._starts = np.unique(key[order], return_index=True)
        self._ends = np.append(self._starts[1:], len(key))
        self._lanes: IntArray = lane_of[order]
        self._guesses: FloatArray = guess[order]

    def near(self, points: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """
        List the lanes near points (N, 2).

        :return: for each pair of a point and a lane the point's row, the lane, and the arc length
            about which the point is
        """
        found = np.searchsorted(self._keys, self._cells(points))
        found = np.minimum(found, len(self._keys) - 1)
        known = self._keys[found] == self._cells(points)
        size = np.where(known, self._ends[found] - self._starts[found], 0)
        rows, place = spans(self._starts[found], size)
        return rows, self._lanes[place], self._guesses[place]

    def _cells(self, points: FloatArray) -> IntArray:
        cell = np.floor((points - self._origin) / CELL).astype(np.int64)
        inside = ((cell >= 0) & (cell < (self._rows, self._columns))).all(axis=1)
        return np.where(inside, cell[:, 0] * self._columns + cell[:, 1], -1)

    def _centers(self, cells: IntArray) -> FloatArray:
        both = np.stack((cells // self._columns, cells % self._columns), axis=-1)
        return np.asarray(self._origin + (both + 0.5) * CELL)


def spans(starts: NDArray[np.int64], sizes: NDArray[np.int64]) -> tuple[IntArray, IntArray]:
    """
    Write out ranges one behind the other.

    :return: for each element the number of its range, and its value start, start + 1, …
    """
    rows = np.repeat(np.arange(len(starts)), sizes)
    before = np.cumsum(sizes) - sizes
    return rows, np.arange(len(rows)) - before[rows] + starts[rows]
