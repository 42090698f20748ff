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
"""Polylines in the plane, and the smooth, uniformly sampled path that is made of them."""

from dataclasses import dataclass
import functools
import math

from crgame_ros.errors import InputError
from crgame_ros.geometry.curve import arc_length
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SAMPLING = 0.25
COARSE = 4
# The smoothing widths tried in turn until the curvature bound holds [m].
WIDTHS = (2.5, 4.0, 6.0, 9.0)


@dataclass(frozen=True)
class ReferencePath:
    """
    A smooth path, sampled uniformly over its arc length.

    :param step: distance between samples [m]
    :param points: (N, 2) positions [m]
    :param heading: (N) direction of the tangent, unwrapped: no jumps of 2 pi [rad]
    :param curvature: (N) derivative of the heading, positive to the left [1/m]
    """

    step: float
    points: Array
    heading: Array
    curvature: Array

    @classmethod
    def from_polyline(cls, points: Array, step: float = 0.5,
                      max_curvature: float = 0.3) -> 'ReferencePath':
        """
        Smooth a polyline and sample it uniformly.

        Smoothing is Gaussian, applied twice to the residual so that circles keep their radius to
        fourth order; its width grows until the curvature stays below the bound.

        :param points: (n, 2) with n >= 2 [m]
        :param step: distance between samples [m]
        :param max_curvature: bound that the widest smoothing may still exceed [1/m]
        :raises InputError: if fewer than two distinct finite points are given.
        """
        dense = resample(points, SAMPLING)
        for width in WIDTHS:
            smooth = _smooth(_smooth_residual(dense, width / SAMPLING), 1.0)
            tangents = np.gradient(smooth, axis=0)
            speed = np.hypot(tangents[:, 0], tangents[:, 1])
            speed = np.maximum(speed, 1e-6)
            heading = np.unwrap(np.arctan2(tangents[:, 1], tangents[:, 0]))
            curvature = _smooth(np.gradient(heading) / speed, 0.5 / SAMPLING)
            if np.abs(curvature).max() <= max_curvature:
                break
        s = arc_length(smooth)
        count = max(2, int(s[-1] / step) + 1)
        grid = step * np.arange(count)
        return cls(step, np.column_stack((np.interp(grid, s, smooth[:, 0]),
                                          np.interp(grid, s, smooth[:, 1]))),
                   np.interp(grid, s, heading), np.interp(grid, s, curvature))

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return self.step * (len(self.heading) - 1)

    @functools.cached_property
    def s(self) -> Array:
        """Arc length of every sample, (N) [m]."""
        return self.step * np.arange(len(self.heading), dtype=np.float64)

    @functools.cached_property
    def rows(self) -> tuple[list[float], list[float], list[float], list[float]]:
        """Give x, y, heading and curvature as lists, which scalar code reads fastest."""
        return (self.points[:, 0].tolist(), self.points[:, 1].tolist(), self.heading.tolist(),
                self.curvature.tolist())

    def pose_at(self, s: Array) -> Array:
        """
        Interpolate the path.

        :param s: (...) arc lengths, clipped to the path; NaN counts as 0 [m]
        :return: (..., 4) x [m], y [m], heading [rad] and curvature [1/m]
        """
        # fmax and fmin prefer a number to NaN.
        position = np.fmin(np.fmax(s / self.step, 0.0), len(self.heading) - 1.000001)
        index = position.astype(np.intp)
        table, slope = self._table
        return table.take(index, 0) + slope.take(index, 0) * (position - index)[..., None]

    def project(self, points: Array, first: float = -math.inf,
                last: float = math.inf) -> tuple[Array, Array]:
        """
        Find the nearest points of the path.

        :param points: (..., 2) positions; NaN gives NaN [m]
        :param first: arc length at which the searched part begins [m]
        :param last: arc length at which it ends [m]
        :return: arc lengths s and offsets d to the left of the path, both (...) [m]
        """
        low = int(np.clip(first / self.step, 0, len(self.heading) - 2))
        high = int(np.clip(last / self.step, low + 1, len(self.heading) - 1)) + 1
        coarse = self.points[low:high:COARSE]
        shape = points.shape[:-1]
        flat = points.reshape(-1, 2)
        known = np.nan_to_num(flat)
        distance = ((known[:, 0, None] - coarse[None, :, 0]) ** 2
                    + (known[:, 1, None] - coarse[None, :, 1]) ** 2)
        guess = self.step * (low + COARSE * np.argmin(distance, axis=1))
        s, d = self.refine(flat, guess)
        return s.reshape(shape), d.reshape(shape)

    def refine(self, points: Array, guess: Array, iterations: int = 3) -> tuple[Array, Array]:
        """
        Project points whose arc length is nearly known, by Newton's method.

        :param points: (n, 2) [m]
        :param guess: (n) arc lengths [m]
        :return: s and d, both (n) [m]; beyond the ends of the path along its end tangents.
        """
        absent = np.isnan(points[:, 0])
        points = np.nan_to_num(points)
        s = np.asarray(guess, dtype=np.float64)
        lateral = np.zeros_like(s)
        for remaining in range(iterations, -1, -1):
            inside = np.minimum(np.maximum(s, 0.0), self.length)
            pose = self.pose_at(inside)
            cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
            dx, dy = points[:, 0] - pose[:, 0], points[:, 1] - pose[:, 1]
            along, lateral = dx * cos + dy * sin, dy * cos - dx * sin
            # Beyond the centre of curvature Newton's step would point the wrong way.
            stretch = np.maximum(1.0 - pose[:, 3] * lateral, 0.3)
            s = inside + along / (stretch if remaining else 1.0)
        return np.where(absent, np.nan, s), np.where(absent, np.nan, lateral)

    @functools.cached_property
    def _table(self) -> tuple[Array, Array]:
        """Give the samples and the differences to the next ones."""
        table = np.column_stack((self.points, self.heading, self.curvature))
        return table, np.diff(table, axis=0)


def resample(points: Array, step: float) -> Array:
    """
    Sample a polyline uniformly, keeping both its ends.

    :param points: (n, 2); repeated points are dropped [m]
    :param step: wanted distance between samples, met within half a sample [m]
    :raises InputError: if fewer than two distinct finite points are given.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise InputError('is no list of finite points', 'polyline', 'give an array (n, 2)')
    s = arc_length(points)
    kept = np.concatenate(([True], np.diff(s) > 1e-6))
    points, s = points[kept], s[kept]
    if len(points) < 2:
        raise InputError('has fewer than two distinct points', 'polyline')
    grid = np.linspace(0.0, s[-1], max(2, round(s[-1] / step) + 1))
    return np.column_stack((np.interp(grid, s, points[:, 0]), np.interp(grid, s, points[:, 1])))


def _smooth_residual(values: Array, width: float) -> Array:
    once = _smooth(values, width)
    return once + _smooth(values - once, width)


def _smooth(values: Array, width: float) -> Array:
    """Convolve (n) or (n, 2) with a Gaussian [samples], reflecting through the end points."""
    if values.ndim == 2:
        return np.column_stack([_smooth(column, width) for column in values.T])
    reach = min(int(math.ceil(3.0 * width)), len(values) - 1)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    kernel /= kernel.sum()
    padded = np.concatenate((2.0 * values[0] - values[reach:0:-1], values,
                             2.0 * values[-1] - values[-2:-reach - 2:-1]))
    return np.convolve(padded, kernel, mode='valid')
