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
from crgame_ros.waypoints.projection import ALONE, CurveIndex, CurvePieces
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # A third of a second to load, which a run without way-points saves.
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
