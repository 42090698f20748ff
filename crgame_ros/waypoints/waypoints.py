# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A lane given by way-points with width and speed limit (FS II-A1)."""

from collections.abc import Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Literal, NamedTuple, TYPE_CHECKING

from crgame_ros.errors import InputError
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.curve import arc_length
from crgame_ros.geometry.reference_point import beside
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

FloatArray = NDArray[np.float64]
Interpolation = Literal['cubic', 'step']

# Default interpolation of each quantity.
DEFAULT_KINDS: Mapping[str, Interpolation] = MappingProxyType(
    {'width': 'cubic', 'speed_limit': 'step'})
# Way-points closer than this are merged [m].
_SAME = 1e-6
# Beyond this, double precision does not resolve a micrometre [m].
MAX_COORDINATE = 1e9
_WHERE = 'way-points'
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


class LaneSample(NamedTuple):
    """
    A lane at N stations, each (N,).

    :param x: [m]
    :param y: [m]
    :param yaw: heading theta in (-pi, pi] [rad]
    :param curvature: kappa, positive to the left [1/m]
    :param width: w [m]
    :param speed_limit: v_lim [m/s]; infinite where there is none.
    """

    x: FloatArray
    y: FloatArray
    yaw: FloatArray
    curvature: FloatArray
    width: FloatArray
    speed_limit: FloatArray


class LanePosition(NamedTuple):
    """Stations s (N,) and offsets d (N,) to the left of the lane's centre [m]."""

    s: FloatArray
    d: FloatArray


class WaypointLane:
    """
    A lane through way-points, with every quantity a function of the station s (FS 1).

    The station of a way-point is the length of the straight lines up to it (FS II-A1). Along the
    curve it is a parameter, whose difference from the arc length is of second order in the
    distance of the way-points.

    - x, y: cubic spline with continuous curvature through the way-points. Its ends are not-a-knot:
      a natural end has no curvature, but most lanes end in the middle of a bend.
    - `cubic` width and speed limit: a cubic polynomial between any two way-points (PCHIP) that
      stays between their values, so that no width is negative and no limit is exceeded, which a
      spline would not guarantee.
    - `step`: the value of the last way-point passed, from that way-point on.

    Beyond its ends a lane is clamped: stations are limited to [0, length].

    :param x: (W,) [m]; W >= 2 way-points, of which at least two differ. If several are at the
        same place, the last counts.
    :param y: (W,) [m]
    :param width: (W,) w >= 0 [m]
    :param speed_limit: (W,) v_lim > 0 [m/s]; infinite where there is none.
    :param kinds: `cubic` or `step` for `width` (cubic) and `speed_limit` (step); position is
        cubic, because heading and curvature are its derivatives.
    :raises InputError: if a value is out of these bounds.
    """

    def __init__(self, x: FloatArray, y: FloatArray, width: FloatArray, speed_limit: FloatArray,
                 kinds: Mapping[str, Interpolation] | None = None) -> None:
        columns = _checked({'x': x, 'y': y, 'width': width, 'speed_limit': speed_limit})
        points = np.stack((columns['x'], columns['y']), axis=-1)
        kept = np.arange(len(points))
        apart = np.append(np.hypot(*np.diff(points, axis=0).T) > _SAME, True)
        while not apart.all():
            kept = kept[apart]
            apart = np.append(np.hypot(*np.diff(points[kept], axis=0).T) > _SAME, True)
        self.points: FloatArray = points[kept]
        if len(self.points) < 2:
            raise InputError('all way-points are the same', _WHERE, 'give two places at least')
        self.s: FloatArray = arc_length(self.points)
        self.kinds: Mapping[str, Interpolation] = MappingProxyType(
            _checked_kinds({**DEFAULT_KINDS, **(kinds or {})}))
        from scipy.interpolate import CubicSpline
        self._curve = CubicSpline(self.s, self.points)
        self.width: FloatArray = columns['width'][kept]
        self.speed_limit: FloatArray = columns['speed_limit'][kept]
        if self.kinds['speed_limit'] == 'cubic' and not np.isfinite(self.speed_limit).all():
            raise InputError('a cubic speed limit needs one at every way-point', _WHERE,
                             'give the missing limits, or interpolate them as steps')

    @classmethod
    def from_rows(cls, rows: FloatArray,
                  kinds: Mapping[str, Interpolation] | None = None) -> 'WaypointLane':
        """Build a lane from rows (W, 4): x, y, width, speed limit."""
        return cls(rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3], kinds)

    @property
    def rows(self) -> FloatArray:
        """Return the way-points (W, 4): x, y, width, speed limit; the inverse of `from_rows`."""
        return np.column_stack((self.points, self.width, self.speed_limit))

    @property
    def length(self) -> float:
        """Return the station of the last way-point [m]."""
        return float(self.s[-1])

    @property
    def pieces(self) -> CurvePieces:
        """Return the curve as cubic pieces, for an index over several lanes."""
        return CurvePieces(np.asarray(self._curve.c), self.s[:-1], np.diff(self.s),
                           np.zeros(len(self.s) - 1, dtype=np.int64))

    def at(self, s: FloatArray) -> LaneSample:
        """
        Evaluate the lane (FS 1); heading and curvature come from analytic derivatives.

        theta = atan2(y', x'); kappa = (x' y'' - y' x'') / (x'^2 + y'^2)^(3/2).

        :param s: (N,) stations [m], clamped to [0, length]
        """
        s = np.clip(np.asarray(s, dtype=np.float64), 0.0, self.length)
        position, first, second = self._curve(s), self._curve(s, 1), self._curve(s, 2)
        speed = np.maximum(np.hypot(first[..., 0], first[..., 1]), 1e-9)
        turning = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
        return LaneSample(position[..., 0], position[..., 1],
                          wrap_pi_array(np.arctan2(first[..., 1], first[..., 0])),
                          turning / speed**3, self._quantity('width', s),
                          self._quantity('speed_limit', s))

    def tangents(self, s: FloatArray) -> FloatArray:
        """Return the derivatives (N, 2) of the position by the station, of about unit length."""
        return np.asarray(self._curve(np.clip(s, 0.0, self.length), 1), dtype=np.float64)

    def poses(self, s: FloatArray, d: FloatArray) -> FloatArray:
        """
        Return poses beside the lane: the inverse of `project`.

        :param s: (N,) stations [m]
        :param d: (N,) offsets to the left [m]
        :return: (N, 3) x [m], y [m], yaw [rad]
        """
        return beside(np.column_stack(self.at(s)[:3]), d)

    def project(self, points: FloatArray) -> LanePosition:
        """
        Find the nearest point of the lane's centre line for each of many points, in O(log W) each.

        :param points: (N, 2) [m]
        :return: s in [0, length] and the offset d along the normal there, positive to the left;
            |d| is the distance unless the nearest point is an end of the lane.
        """
        found = self._index.nearest(np.asarray(points, dtype=np.float64), ALONE)
        return LanePosition(found.s, found.d)

    @cached_property
    def _index(self) -> CurveIndex:
        return CurveIndex(self.pieces)

    @cached_property
    def _cubics(self) -> dict[str, 'PchipInterpolator']:
        from scipy.interpolate import PchipInterpolator
        return {name: PchipInterpolator(self.s, getattr(self, name))
                for name, kind in self.kinds.items() if kind == 'cubic'}

    def _quantity(self, name: str, s: FloatArray) -> FloatArray:
        if self.kinds[name] == 'cubic':
            return np.asarray(self._cubics[name](s), dtype=np.float64)
        values: FloatArray = getattr(self, name)
        return values[np.searchsorted(self.s, s, side='right') - 1]


def _checked(columns: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Check the columns of a lane, and return them as new arrays."""
    count = len(columns['x'])
    if count < 2:
        raise InputError(f'there is {count} way-point' if count else 'there are no way-points',
                         _WHERE, 'give two at least')
    arrays = {name: np.array(column, dtype=np.float64) for name, column in columns.items()}
    for name, array in arrays.items():
        if array.shape != (count,):
            raise InputError(f'"{name}" has the shape {array.shape}', _WHERE,
                             f'give {count} numbers, one for each way-point')
        low, high = {'width': (0.0, MAX_COORDINATE), 'speed_limit': (0.0, np.inf)}.get(
            name, (-MAX_COORDINATE, MAX_COORDINATE))
        bad = np.flatnonzero(~((array >= low) & (array <= high))
                             | (name == 'speed_limit') & (array == 0.0))
        if len(bad):
            raise InputError(f'"{name}" of way-point {bad[0]} is {array[bad[0]]:g}', _WHERE,
                             'give finite coordinates, a width of 0 or more, a positive limit')
    return arrays


def _checked_kinds(kinds: dict[str, Interpolation]) -> dict[str, Interpolation]:
    for name, kind in kinds.items():
        if name not in DEFAULT_KINDS:
            raise InputError(f'"{name}" has no choice of interpolation', _WHERE,
                             'choose it for ' + ' and '.join(DEFAULT_KINDS))
        if kind not in ('cubic', 'step'):
            raise InputError(f'the interpolation of "{name}" is "{kind}"', _WHERE,
                             'use cubic or step')
    return kinds
