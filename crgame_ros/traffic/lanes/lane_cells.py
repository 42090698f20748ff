# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lanes near a point: a grid over the map, built once."""

import math
from typing import NamedTuple

from crgame_ros.traffic.compiling.compiled import bare
from crgame_ros.traffic.lanes.lane_graph import FloatArray, heading_difference, IntArray, LaneGraph
from crgame_ros.traffic.lanes.lane_table import first_at_least
import numpy as np
from scipy.spatial import cKDTree

CELL = 3.0
# How far from a centre line a body's centre may be and still reach into the lane [m].
REACH = 9.0


class CellTable(NamedTuple):
    """
    The cells with lanes, as arrays.

    :param origin_x, origin_y: corner of the grid [m]
    :param columns, rows: number of cells in y and in x.
    :param keys: (K) of the cells with lanes, ascending, by rows; `row_starts` (rows + 1) index of
        each row's first key, `starts` (K + 1) index of each cell's first lane.
    :param lanes: (N) of all cells, cell by cell.
    :param guesses: (N) arc length of the lane nearest to the cell [m]
    :param turning: (L) greatest angle between any two parts of a lane [rad]
    :param widest: (L) greatest distance from its middle to its edge [m]
    """

    origin_x: float
    origin_y: float
    columns: int
    rows: int
    keys: IntArray
    row_starts: IntArray
    starts: IntArray
    lanes: IntArray
    guesses: FloatArray
    turning: FloatArray
    widest: FloatArray


@bare
def cell_of(cells: CellTable, x: float, y: float) -> int:
    """Return the row of the cell around a point, or -1 where no lane is near."""
    row, column = math.floor((x - cells.origin_x) / CELL), math.floor(
        (y - cells.origin_y) / CELL)
    if not (0 <= row < cells.rows and 0 <= column < cells.columns):
        return -1
    key = int(row) * cells.columns + int(column)
    low = first_at_least(cells.keys, cells.row_starts[int(row)], cells.row_starts[int(row) + 1],
                         key)
    return int(low) if low < len(cells.keys) and cells.keys[low] == key else -1


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
            rows = graph.rows_of(lane)
            points = np.stack((graph.x[rows], graph.y[rows]), axis=-1)
            cells = np.unique((np.unique(self._cells(points))[:, None] + shift).ravel())
            distance, nearest = cKDTree(points).query(self._centers(cells))
            near = distance <= REACH + CELL
            keys.append(cells[near])
            lanes.append(np.full(int(near.sum()), lane))
            guesses.append(nearest[near] * graph.step[lane])
        key, lane_of, guess = (np.concatenate(x) for x in (keys, lanes, guesses))
        order = np.lexsort((lane_of, key))
        filled, starts = np.unique(key[order], return_index=True)
        self.table = CellTable(
            float(self._origin[0]), float(self._origin[1]), self._columns, self._rows, filled,
            np.searchsorted(filled, np.arange(self._rows + 1) * self._columns),
            np.append(starts, len(key)), lane_of[order].astype(np.int64), guess[order],
            np.array([self._turning(i) for i in range(len(graph))]),
            np.maximum.reduceat(graph.half_width, graph.first))

    def _turning(self, lane: int) -> float:
        """Return the greatest angle between headings or chords of a lane [rad]."""
        graph, first = self._graph, int(self._graph.first[lane])
        rows = slice(first, first + int(graph.count[lane]))
        chords = np.arctan2(np.diff(graph.y[rows]), np.diff(graph.x[rows]))
        turned = np.concatenate((heading_difference(chords, graph.yaw[first]),
                                 graph.yaw[rows] - graph.yaw[first]))
        return float(np.ptp(turned))

    def _cells(self, points: FloatArray) -> IntArray:
        cell = np.floor((points - self._origin) / CELL).astype(np.int64)
        inside = ((cell >= 0) & (cell < (self._rows, self._columns))).all(axis=1)
        return np.where(inside, cell[:, 0] * self._columns + cell[:, 1], -1)

    def _centers(self, cells: IntArray) -> FloatArray:
        both = np.stack((cells // self._columns, cells % self._columns), axis=-1)
        return np.asarray(self._origin + (both + 0.5) * CELL)
