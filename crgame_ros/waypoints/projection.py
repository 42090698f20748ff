# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the nearest points on plane curves of cubic pieces, in logarithmic time."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Spacing of the samples in the tree, which gives the places to search [m].
_SAMPLING = 0.5
# Greatest numbers of samples of one piece and of all pieces, which limit memory if way-points are
# far apart.
_MAX_PER_PIECE = 64
_MAX_SAMPLES = 4_000_000
# Number of places refined per point. On one curve the nearest sample is next to the nearest point,
# except where the curve comes back to itself; samples of crossing curves are close together.
ALONE, SEVERAL = 3, 8
_TOLERANCE = 1e-10
# Bisection alone reaches the tolerance within this number of steps, for any sampling.
_MAX_STEPS = 60


class CurvePieces(NamedTuple):
    """
    The cubic pieces of one or several curves; those of one curve are contiguous and in order.

    :param coefficients: (4, P, 2) coefficients of x and y for powers 3, 2, 1, 0 of the distance
        from the start of the piece.
    :param start: (P,) station at which a piece starts [m]
    :param length: (P,) length in stations [m]
    :param curve: (P,) number of its curve.
    """

    coefficients: FloatArray
    start: FloatArray
    length: FloatArray
    curve: IntArray


class Nearest(NamedTuple):
    """The nearest points of N points: curve (N,), station s [m], offset d and distance [m]."""

    curve: IntArray
    s: FloatArray
    d: FloatArray
    distance: FloatArray


class CurveIndex:
    """
    An index of curves that finds their nearest points to given points.

    A k-d tree over samples of the curves gives the places to search, in O(log P) for each point.
    There, Newton steps on the squared distance find the point; bisection keeps them between the
    neighbouring samples. The best of several places counts. If more curves than that are within
    half a sampling distance (0.25 m) of each other, the result may be on one that is not nearest.

    :param pieces: pieces of the curves; they must not be changed afterwards.
    """

    def __init__(self, pieces: CurvePieces) -> None:
        # A slow import, which most runs do not need.
        from scipy.spatial import cKDTree
        self._pieces = pieces
        most = int(np.clip(_MAX_SAMPLES // len(pieces.start), 1, _MAX_PER_PIECE))
        counts = np.clip(np.ceil(pieces.length / _SAMPLING), 1, most).astype(np.int64)
        self._piece: IntArray = np.repeat(np.arange(len(counts)), counts)
        number = np.arange(len(self._piece)) - np.repeat(np.cumsum(counts) - counts, counts)
        step = (pieces.length / counts)[self._piece]
        self._low: FloatArray = number * step
        self._high: FloatArray = np.where(number + 1 == counts[self._piece],
                                          pieces.length[self._piece], self._low + step)
        # Every interval has a sample at its start; the last one of a curve at its end as well.
        curve = pieces.curve[self._piece]
        last = np.flatnonzero(np.append(curve[1:] != curve[:-1], True))
        first = np.flatnonzero(np.insert(curve[1:] != curve[:-1], 0, True))
        before = np.arange(len(curve)) - 1
        before[first] = -1
        self._before: IntArray = np.concatenate((before, last))
        self._after: IntArray = np.concatenate((np.arange(len(curve)), np.full(len(last), -1)))
        starts = self._at(self._piece, self._low)[0]
        ends = self._at(self._piece[last], self._high[last])[0]
        self._tree = cKDTree(np.concatenate((starts, ends)))

    def nearest(self, points: FloatArray, candidates: int = SEVERAL) -> Nearest:
        """
        Find the nearest point of any curve for each of many points.

        :param points: (N, 2) finite x, y [m]
        :param candidates: number of places to search for each point; `ALONE` suffices for one
            curve.
        :return: s within its curve; d is the offset along the normal there, positive to the left,
            and |d| the distance unless the nearest point is an end.
        """
        count = min(candidates, self._tree.n)
        _, samples = self._tree.query(points, k=list(range(1, count + 1)))
        rows = np.repeat(np.arange(len(points)), count)
        piece, u = self._refine(points[rows], samples.reshape(-1))
        position, tangent, _ = self._at(piece, u)
        offset = points[rows] - position
        distance = np.hypot(*offset.T).reshape(-1, count)
        best = np.argmin(distance, axis=1)
        chosen = np.arange(len(points)) * count + best
        offset, tangent, piece = offset[chosen], tangent[chosen], piece[chosen]
        across = tangent[:, 0] * offset[:, 1] - tangent[:, 1] * offset[:, 0]
        return Nearest(self._pieces.curve[piece], self._pieces.start[piece] + u[chosen],
                       across / np.maximum(np.hypot(*tangent.T), 1e-12),
                       distance[np.arange(len(points)), best])

    def _refine(self, points: FloatArray, samples: IntArray) -> tuple[IntArray, FloatArray]:
        """Return the piece nearest to each point around its sample, and the place on it."""
        before, after = self._before[samples], self._after[samples]
        here = np.where(after < 0, before, after)
        u = np.where(after < 0, self._high[here], self._low[here])
        slope, _ = self._slopes(self._piece[here], u, points)
        # The squared distance decreases to one side of the sample; an end has only one side.
        backwards = (slope > 0.0) & (before >= 0)
        fixed = (slope > 0.0) & (before < 0) | (slope <= 0.0) & (after < 0)
        interval = np.where(backwards, before, here)
        u = np.where(backwards, self._high[interval], u)
        low = np.where(fixed, u, self._low[interval])
        high = np.where(fixed, u, self._high[interval])
        piece = self._piece[interval]
        open_rows = np.flatnonzero(~fixed)
        for _ in range(_MAX_STEPS):
            if not len(open_rows):
                break
            at = open_rows
            slope, bend = self._slopes(piece[at], u[at], points[at])
            low[at] = np.where(slope <= 0.0, u[at], low[at])
            high[at] = np.where(slope > 0.0, u[at], high[at])
            trial = u[at] - slope / np.where(bend > 0.0, bend, 1.0)
            useful = (bend > 0.0) & (trial >= low[at]) & (trial <= high[at])
            trial = np.where(useful, trial, 0.5 * (low[at] + high[at]))
            moved = np.abs(trial - u[at])
            u[at] = trial
            open_rows = at[moved > _TOLERANCE]
        return piece, u

    def _slopes(self, piece: IntArray, u: FloatArray,
                points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the first and second derivative of half the squared distance."""
        position, first, second = self._at(piece, u)
        offset = position - points
        return (np.einsum('ij,ij->i', offset, first),
                np.einsum('ij,ij->i', first, first) + np.einsum('ij,ij->i', offset, second))

    def _at(self, piece: IntArray, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position and derivatives (n, 2) on pieces."""
        c3, c2, c1, c0 = self._pieces.coefficients[:, piece]
        t = u[:, None]
        return (((c3 * t + c2) * t + c1) * t + c0, (3.0 * c3 * t + 2.0 * c2) * t + c1,
                6.0 * c3 * t + 2.0 * c2)
