# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Polylines in the plane, and smooth, uniformly sampled paths made of them."""

import math

from crgame_ros.errors import InputError
from crgame_ros.geometry.curve import arc_length, Curve, nearest
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SAMPLING = 0.25
# Share of a step by which a length may miss a multiple of it.
ROUNDING = 1e-6
# Lengths [m] and angles [rad] that agree in these digits are equal.
EQUAL_DIGITS = 6
COARSE = 4
# The smoothing widths tried in turn until the curvature bound holds [m].
WIDTHS = (2.5, 4.0, 6.0, 9.0)


class ReferencePath(Curve):
    """
    A smooth curve, tabulated uniformly over its arc length, without extension beyond its ends.

    :param step: distance between samples [m]
    :param points: (N, 2) positions [m]
    :param heading: (N) direction of the tangent, unwrapped: no jumps of 2 pi [rad]
    :param curvature: (N) derivative of the heading, positive to the left [1/m]
    """

    def __init__(self, step: float, points: Array, heading: Array, curvature: Array) -> None:
        super().__init__(points, step * np.arange(len(heading), dtype=np.float64), heading)
        self.step = step
        self.curvature = curvature
        self._table: Array = np.column_stack((points, heading, curvature))
        self._slopes: Array = np.diff(self._table, axis=0)
        self._bend_slopes: Array = np.diff(curvature)
        # Scalar code reads lists fastest.
        self._rows: list[list[float]] = self._table.tolist()
        self._changes: list[list[float]] = self._slopes.tolist()
        self._end = self.length
        self._last = len(heading) - 1.000001
        self._last_span = len(heading) - 2

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
        # Where the length is a multiple of the step, rounding does not decide on the last point.
        count = max(2, int(s[-1] / step + ROUNDING) + 1)
        grid = step * np.arange(count)
        return cls(step, np.column_stack((np.interp(grid, s, smooth[:, 0]),
                                          np.interp(grid, s, smooth[:, 1]))),
                   np.interp(grid, s, heading), np.interp(grid, s, curvature))

    def pose_at(self, s: Array) -> Array:
        """
        Interpolate the path.

        :param s: (...) arc lengths, clipped to the path; NaN counts as 0 [m]
        :return: (..., 4) x [m], y [m], heading [rad] and curvature [1/m]
        """
        index, share = self._cells(s)
        return self._table.take(index, 0) + self._slopes.take(index, 0) * share[..., None]

    def bends_at(self, s: Array) -> Array:
        """Interpolate the curvature alone, as `pose_at` does [1/m]."""
        index, share = self._cells(s)
        return self.curvature.take(index) + self._bend_slopes.take(index) * share

    def _cells(self, s: Array) -> tuple[NDArray[np.intp], Array]:
        """Return the samples before arc lengths, and the share of the way to the next ones."""
        # fmax and fmin prefer a number to NaN.
        position = np.fmin(np.fmax(s / self.step, 0.0), self._last)
        index = position.astype(np.intp)
        return index, position - index

    def place(self, s: float) -> tuple[float, float, float, float, float]:
        """Return the arc length clipped to the path [m], and the values of `pose_at` there."""
        # Comparisons take a third of the time of `min` and `max`.
        if s < 0.0:
            s = 0.0
        elif s > self._end:
            s = self._end
        position = s / self.step
        if position > self._last:
            position = self._last
        # NaN counts as 0.
        if not position >= 0.0:
            position = 0.0
        index = int(position)
        share = position - index
        x, y, heading, curvature = self._rows[index]
        to_x, to_y, to_heading, to_curvature = self._changes[index]
        return (s, x + to_x * share, y + to_y * share, heading + to_heading * share,
                curvature + to_curvature * share)

    def rows(self, first: float, last: float, least: int = 1) -> slice:
        """Return the samples between two arc lengths [m], `least` segments or more."""
        end = len(self._rows) - 1
        low = int(min(max(first / self.step, 0), end - least))
        return slice(low, int(min(max(last / self.step, low + least), end)) + 1)

    def project(self, points: Array, first: float = -math.inf,
                last: float = math.inf) -> tuple[Array, Array]:
        """
        Find the nearest points of the path.

        :param points: (..., 2) positions; NaN gives NaN [m]
        :param first: arc length at which the searched part begins [m]
        :param last: arc length at which it ends [m]
        :return: arc lengths s and offsets d to the left of the path, both (...) [m]
        """
        rows = self.rows(first, last)
        coarse = slice(rows.start, rows.stop, COARSE)
        shape = points.shape[:-1]
        flat = points.reshape(-1, 2)
        guess = self.s[coarse][nearest(flat, self.points[coarse])]
        s, d = self.refine(flat, guess)
        return s.reshape(shape), d.reshape(shape)

    def _within(self, s: Array) -> Array:
        """Return arc lengths clipped to the path: points beyond it are projected to its ends."""
        return np.minimum(np.maximum(s, 0.0), self.length)

    def locate(self, x: float, y: float, guess: float) -> tuple[float, float, float]:
        """
        Refine one arc length as `refine` does, but beyond the ends along the last segments.

        :return: s [m], d [m] and the heading of the path there [rad]
        """
        s, step, last = guess, self.step, self._last_span
        for left in (2, 1, 0):
            index = int(s / step)
            index = 0 if index < 0 else last if index > last else index
            f = s / step - index
            here_x, here_y, heading, curvature = self._rows[index]
            to_x, to_y, to_heading, _ = self._changes[index]
            heading += f * to_heading
            cos, sin = math.cos(heading), math.sin(heading)
            dx, dy = x - here_x - f * to_x, y - here_y - f * to_y
            d = dy * cos - dx * sin
            along = dx * cos + dy * sin
            stretch = 1.0 - curvature * d
            s += along / (stretch if stretch > 0.3 else 0.3) if left else along
        return s, d, heading

    def curvature_at(self, s: float) -> float:
        """Interpolate the curvature at one arc length [m], clipped to the path [1/m]."""
        position = s / self.step
        index = int(position)
        index = 0 if index < 0 else self._last_span if index > self._last_span else index
        f = position - index
        f = 0.0 if f < 0.0 else 1.0 if f > 1.0 else f
        return self._rows[index][3] + f * self._changes[index][3]


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
