# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The path of an object with its arc length."""

import math
from typing import NamedTuple

from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.curve import nearest
from crgame_ros.geometry.reference_point import seen_from
from crgame_ros.waypoints.waypoints import WaypointLane
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Spacing of samples; between them the arc length is linear in the station [m].
_SPACING = 0.25
# Gauss-Legendre points of the integral of |X'| between two samples.
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(3)


class Encounters(NamedTuple):
    """
    Bodies relative to a path, each (O,).

    :param s: arc length of the nearest sample of the path, corrected along it to the centre [m]
    :param d: lateral offset to the left [m]
    :param yaw: heading of the path there [rad]
    """

    s: FloatArray
    d: FloatArray
    yaw: FloatArray


class ObjectPath:
    """
    A way-point lane parametrised by its arc length, straight beyond both ends.

    :param lane: the lane; its stations differ from arc lengths.
    """

    def __init__(self, lane: WaypointLane) -> None:
        self._lane = lane
        count = max(2, math.ceil(lane.length / _SPACING) + 1)
        # The samples include the way-points, between which the curve is smooth.
        self._u: FloatArray = np.union1d(np.linspace(0.0, lane.length, count), lane.s)
        step = np.diff(self._u)
        nodes = self._u[:-1, None] + 0.5 * step[:, None] * (_GAUSS + 1.0)
        arcs = 0.5 * step * (self._speeds(nodes) @ _WEIGHTS)
        self.s: FloatArray = np.concatenate(([0.0], np.cumsum(arcs)))
        here = lane.at(self._u)
        self.curvature: FloatArray = here.curvature
        self.speed_limit: FloatArray = here.speed_limit
        self._poses: FloatArray = np.column_stack(here[:3])
        self.points: FloatArray = self._poses[:, :2]

    def _speeds(self, u: FloatArray) -> FloatArray:
        """Return |X'| at stations of any shape."""
        first = self._lane.tangents(u.reshape(-1))
        return np.hypot(first[:, 0], first[:, 1]).reshape(u.shape)

    @property
    def length(self) -> float:
        """Return the total arc length [m]."""
        return float(self.s[-1])

    def arc_lengths(self, stations: FloatArray) -> FloatArray:
        """Return the arc lengths [m] of stations of the lane [m]."""
        return np.interp(stations, self._u, self.s)

    def pose(self, s: float) -> tuple[float, float, float, float]:
        """Return x [m], y [m], yaw [rad] and curvature [1/m] at an arc length [m]."""
        here = self._lane.at(np.interp([s], self.s, self._u))
        x, y, yaw, curvature = (float(column[0]) for column in here[:4])
        beyond = s - min(max(s, 0.0), self.length)
        if beyond:
            x, y, curvature = x + beyond * math.cos(yaw), y + beyond * math.sin(yaw), 0.0
        return x, y, yaw, curvature

    def meet(self, points: FloatArray, low: float, high: float) -> Encounters:
        """
        Return bodies relative to a part of the path: a path may come back to the same place.

        :param points: (O, 2) centres [m]
        :param low: arc length at which the part begins [m]
        :param high: arc length at which it ends [m]
        """
        first, last = np.searchsorted(self.s, (low, high)).tolist()
        first, last = max(first - 1, 0), min(last + 1, len(self.s))
        row = first + nearest(points, self.points[first:last])
        along, d = seen_from(self._poses[row], points)
        return Encounters(self.s[row] + along, d,
                          wrap_pi_array(self._poses[row, 2] + self.curvature[row] * along))
