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
"""A line with arc length and lateral offset: the centre of a lane."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Positions times segments handled at once, which bounds the memory of a projection.
_CHUNK = 2_000_000


class LaneLine:
    """
    A polyline with arc length s and offset d to the left; straight beyond both ends.

    The heading is interpolated between the vertices, so that lines of constant d are continuous
    where the polyline bends.

    :param points: (n, 2) vertices [m], n >= 2, not all equal; repeated ones are dropped.
    """

    def __init__(self, points: FloatArray) -> None:
        step = np.hypot(*np.diff(points, axis=0).T)
        self.points = points[np.concatenate(([True], step > 1e-6))]
        chord = np.diff(self.points, axis=0)
        self._step = np.hypot(*chord.T)
        self._direction = chord / self._step[:, None]
        self.s: FloatArray = np.concatenate(([0.0], np.cumsum(self._step)))
        angle = np.unwrap(np.arctan2(chord[:, 1], chord[:, 0]))
        middle = 0.5 * (angle[1:] + angle[:-1])
        self.headings: FloatArray = np.concatenate((angle[:1], middle, angle[-1:]))

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(self.s[-1])

    def poses(self, s: FloatArray, d: FloatArray) -> FloatArray:
        """Give the (N, 3) poses at arc lengths (N) and offsets (N); yaw is not wrapped."""
        segment = np.clip(np.searchsorted(self.s, s, side='right') - 1, 0, len(self._step) - 1)
        yaw = np.interp(s, self.s, self.headings)
        position = self.points[segment] + (s - self.s[segment])[:, None] * self._direction[segment]
        return np.stack((position[:, 0] - d * np.sin(yaw), position[:, 1] + d * np.cos(yaw), yaw),
                        axis=-1)

    def project(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Find arc lengths and offsets (N), (N) of positions (N, 2): the inverse of `poses`."""
        rows = max(1, _CHUNK // len(self._step))
        if len(positions) > rows:
            parts = [self.project(positions[i:i + rows]) for i in range(0, len(positions), rows)]
            return (np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts]))
        offset = positions[:, None, :] - self.points[None, :-1, :]
        along = np.einsum('nij,ij->ni', offset, self._direction)
        inside = np.clip(along, 0.0, self._step)
        across = (offset[..., 1] * self._direction[:, 0] - offset[..., 0] * self._direction[:, 1])
        best = np.argmin((along - inside) ** 2 + across ** 2, axis=1)
        row = np.arange(len(positions))
        inside[:, 0] = np.minimum(along[:, 0], self._step[0])
        inside[:, -1] = np.where(along[:, -1] > 0.0, along[:, -1], inside[:, -1])
        return self._refine(positions, self.s[best] + inside[row, best])

    def _refine(self, positions: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Move s until the position lies on the normal of the interpolated heading."""
        zero = np.zeros_like(s)
        error = np.full_like(s, np.inf)
        trial = s
        d = zero
        for _ in range(20):
            pose = self.poses(trial, zero)
            delta = positions - pose[:, :2]
            cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
            along = delta[:, 0] * cos + delta[:, 1] * sin
            better = np.abs(along) < error
            s = np.where(better, trial, s)
            d = np.where(better, delta[:, 1] * cos - delta[:, 0] * sin, d)
            error = np.where(better, np.abs(along), error)
            trial = np.where(better, trial + along, s)
            if not np.any(better & (np.abs(along) > 1e-9)):
                break
        return s, d
