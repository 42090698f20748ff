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
"""A curve in the plane by its arc length."""

from functools import cached_property

from crgame_ros.geometry.pose_frame import beside, seen_from
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Positions times segments handled at once, which bounds the memory of a projection.
_CHUNK = 2_000_000


class Curve:
    """
    A polyline with arc length s and offset d to the left; straight beyond both ends.

    The heading is interpolated between the vertices, so that lines of constant d are continuous
    where the polyline bends.

    :param points: (n, 2) vertices [m], n >= 2, not all equal; repeated ones are dropped.
    """

    def __init__(self, points: FloatArray) -> None:
        step = np.hypot(*np.diff(points, axis=0).T)
        self.points: FloatArray = points[np.concatenate(([True], step > 1e-6))]
        chord = np.diff(self.points, axis=0)
        self.steps: FloatArray = np.hypot(*chord.T)
        self.directions: FloatArray = chord / self.steps[:, None]
        self.s: FloatArray = np.concatenate(([0.0], np.cumsum(self.steps)))
        angle = np.unwrap(np.arctan2(chord[:, 1], chord[:, 0]))
        middle = 0.5 * (angle[1:] + angle[:-1])
        self.heading: FloatArray = np.concatenate((angle[:1], middle, angle[-1:]))

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(self.s[-1])

    @cached_property
    def _bends(self) -> FloatArray:
        """Curvature of the segments, and of the straight parts before and behind, (n + 1)."""
        return np.concatenate(([0.0], np.diff(self.heading) / np.diff(self.s), [0.0]))

    def heading_at(self, s: FloatArray) -> FloatArray:
        """Give the headings at arc lengths of any shape, not wrapped [rad]."""
        return np.asarray(np.interp(s, self.s, self.heading), dtype=np.float64)

    def pose_at(self, s: FloatArray) -> FloatArray:
        """
        Give x [m], y [m], heading [rad] and curvature [1/m] at arc lengths.

        :param s: (...) [m]
        :return: (..., 4); the heading is not wrapped.
        """
        after = self.s.searchsorted(s, side='right')
        segment = np.minimum(np.maximum(after - 1, 0), len(self.steps) - 1)
        result = np.empty((*s.shape, 4))
        result[..., :2] = (self.points[segment]
                           + (s - self.s[segment])[..., None] * self.directions[segment])
        result[..., 2] = self.heading_at(s)
        result[..., 3] = self._bends[after]
        return result

    def poses(self, s: FloatArray, d: FloatArray) -> FloatArray:
        """Give the (..., 3) poses at arc lengths and offsets (...); yaw is not wrapped."""
        return beside(self.pose_at(s), d)

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Find arc lengths and offsets (N), (N) of points (N, 2): the inverse of `poses`."""
        rows = max(1, _CHUNK // len(self.steps))
        if len(points) > rows:
            parts = [self.project(points[i:i + rows]) for i in range(0, len(points), rows)]
            return (np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts]))
        offset = points[:, None, :] - self.points[None, :-1, :]
        along = np.einsum('nij,ij->ni', offset, self.directions)
        inside = np.clip(along, 0.0, self.steps)
        across = offset[..., 1] * self.directions[:, 0] - offset[..., 0] * self.directions[:, 1]
        best = np.argmin((along - inside) ** 2 + across ** 2, axis=1)
        row = np.arange(len(points))
        inside[:, 0] = np.minimum(along[:, 0], self.steps[0])
        inside[:, -1] = np.where(along[:, -1] > 0.0, along[:, -1], inside[:, -1])
        return self._settle(points, self.s[best] + inside[row, best])

    def _settle(self, points: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Move s until each point lies on the normal of the interpolated heading, or is best."""
        error = np.full_like(s, np.inf)
        trial = s
        d = np.zeros_like(s)
        for _ in range(20):
            along, aside = seen_from(self.pose_at(trial), points)
            better = np.abs(along) < error
            s = np.where(better, trial, s)
            d = np.where(better, aside, d)
            error = np.where(better, np.abs(along), error)
            trial = np.where(better, trial + along, s)
            if not np.any(better & (np.abs(along) > 1e-9)):
                break
        return s, d
