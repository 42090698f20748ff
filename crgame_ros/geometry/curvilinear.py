# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The curvilinear coordinate frame along a reference path (CRG 1)."""

from commonroad_clcs.pycrccosy import (
    CartesianProjectionDomainError,
    CurvilinearCoordinateSystem,
    CurvilinearProjectionDomainLateralError,
    CurvilinearProjectionDomainLongitudinalError,
)
from crgame_ros.errors import InputError
from crgame_ros.geometry.polyline import ReferencePath
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The library accepts headings strictly inside ±2 pi only; the margin covers its own extension.
HEADING_LIMIT = 2.0 * np.pi - 0.2


class CurvilinearFrame:
    """
    Coordinates (s, d) along a path: arc length and orthogonal offset to the left (CRG 1).

    The conversion is that of Wuersching and Althoff (CRG reference 9). The frame covers the part
    of the path from `first` on over which its heading stays within the library's limit of 2 pi,
    so that roundabouts and closed loops work piece by piece.

    :param path: the reference path.
    :param first: arc length of the path at which the frame begins [m]
    :param last: arc length at which it ends at the latest [m]
    :param lateral_limit: largest offset that may be mapped [m]
    """

    def __init__(self, path: ReferencePath, first: float = 0.0, last: float = np.inf,
                 lateral_limit: float = 20.0) -> None:
        low = int(np.clip(first / path.step, 0, len(path.heading) - 4))
        high = int(np.clip(last / path.step, low + 3, len(path.heading) - 1)) + 1
        turn = np.floor(path.heading[low] / (2.0 * np.pi) + 0.5) * 2.0 * np.pi
        outside = np.flatnonzero(np.abs(path.heading[low:high] - turn) > HEADING_LIMIT)
        if len(outside):
            high = low + max(int(outside[0]), 4)
        self.path = path
        self.first = low * path.step
        self.last = (high - 1) * path.step
        points = np.ascontiguousarray(path.points[low:high])
        self._frame = CurvilinearCoordinateSystem(points, lateral_limit, 0.1)
        origin = self._frame.convert_to_curvilinear_coords(*points[1], False)
        # The library prolongs the path at both ends; its s starts before ours.
        self._shift = self.first + path.step - float(origin[0])

    @property
    def points(self) -> Array:
        """Points of the path that the frame covers, (n, 2) [m]."""
        low = round(self.first / self.path.step)
        return self.path.points[low:round(self.last / self.path.step) + 1]

    def to_curvilinear(self, x: float, y: float) -> tuple[float, float] | None:
        """
        Map a position to (s, d) (CRG 1).

        :return: s along the path and d to its left [m], or None outside the frame's domain.
        """
        try:
            s, d = self._frame.convert_to_curvilinear_coords(x, y)
        except (CartesianProjectionDomainError, RuntimeError, ValueError):
            return None
        return float(s) + self._shift, float(d)

    def to_cartesian(self, s: float, d: float) -> tuple[float, float]:
        """
        Map (s, d) to a position, the inverse of CRG 1.

        :raises InputError: if (s, d) lies outside the frame's domain.
        """
        try:
            x, y = self._frame.convert_to_cartesian_coords(s - self._shift, d)
        except (CurvilinearProjectionDomainLateralError, RuntimeError, ValueError,
                CurvilinearProjectionDomainLongitudinalError) as error:
            raise InputError(
                f'(s, d) = ({s:.2f}, {d:.2f}) lies outside the domain', 'curvilinear frame',
                f's may run from {self.first:.1f} to {self.last:.1f} m') from error
        return float(x), float(y)

    def to_curvilinear_many(self, points: Array) -> Array:
        """
        Map positions (n, 2) to (s, d), (n, 2) [m]; rows outside the domain are NaN.

        The library drops points outside its domain from a batch without a word, hence the
        test of each beforehand.
        """
        result = np.full(points.shape, np.nan)
        inside = np.array([bool(np.isfinite(point).all())
                           and self._frame.cartesian_point_inside_projection_domain(*point)
                           for point in points], dtype=bool)
        if inside.any():
            mapped = np.array(self._frame.convert_list_of_points_to_curvilinear_coords(
                np.ascontiguousarray(points[inside]), 1))
            if len(mapped) == inside.sum():
                result[inside] = mapped + (self._shift, 0.0)
            else:
                result[inside] = [self.to_curvilinear(*point) or (np.nan, np.nan)
                                  for point in points[inside]]
        return result
