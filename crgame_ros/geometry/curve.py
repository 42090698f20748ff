# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A curve in the plane, and the curvilinear coordinates (s, d) along it (CRG 1)."""

from bisect import bisect_right
from collections.abc import Sequence
from functools import cached_property
import math

from crgame_ros.geometry.reference_point import beside, seen_from
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Points times segments handled at once, which bounds the memory of a projection.
_CHUNK = 2_000_000
# Up to this many points are refined one by one: numpy calls cost more than the arithmetic.
_FEW = 12
# A projection is repeated until points are this close to their normals [m], or this many times.
_SETTLED, _MOST_ROUNDS = 1e-9, 20
# Beyond the centre of a bend, s does not run on faster than this allows.
_LEAST_STRETCH = 0.3


class Curve:
    """
    A curve with arc lengths s and lateral offsets d to the left; straight beyond both ends.

    Positions are linear between the points, and headings too, so that lines of constant d are
    continuous where the curve bends.

    :param points: (n, 2), n >= 2, no two successive ones equal [m]
    :param s: (n) their arc lengths, the first 0 [m]
    :param heading: (n) the directions there, unwrapped: no jumps of 2 pi [rad]
    """

    def __init__(self, points: FloatArray, s: FloatArray, heading: FloatArray) -> None:
        self.points = points
        self.s = s
        self.heading = heading

    @classmethod
    def from_polyline(cls, points: FloatArray) -> 'Curve':
        """
        Build a curve from vertices; the heading at a vertex is between those of its segments.

        :param points: (n, 2), n >= 2, not all equal; repeated ones are dropped [m]
        """
        points = points[np.concatenate(([True], np.hypot(*np.diff(points, axis=0).T) > 1e-6))]
        chord = np.diff(points, axis=0)
        angle = np.unwrap(np.arctan2(chord[:, 1], chord[:, 0]))
        middle = 0.5 * (angle[1:] + angle[:-1])
        return cls(points, arc_length(points), np.concatenate((angle[:1], middle, angle[-1:])))

    @property
    def length(self) -> float:
        """Return the length [m]."""
        return float(self.s[-1])

    @cached_property
    def steps(self) -> FloatArray:
        """Return the lengths of the segments, (n - 1) [m]."""
        return np.asarray(np.hypot(*np.diff(self.points, axis=0).T))

    @cached_property
    def directions(self) -> FloatArray:
        """Return unit vectors along the segments, (n - 1, 2)."""
        return np.asarray(np.diff(self.points, axis=0) / self.steps[:, None])

    @cached_property
    def _segments(self) -> tuple[FloatArray, ...]:
        """Return x and y of the segments' starts and of their directions, each (n - 1)."""
        return tuple(np.ascontiguousarray(column) for column in (
            *self.points[:-1].T, *self.directions.T))

    @cached_property
    def _bends(self) -> FloatArray:
        """Return the curvature of segments, and of the straight parts at both ends, (n + 1)."""
        return np.concatenate(([0.0], np.diff(self.heading) / np.diff(self.s), [0.0]))

    @cached_property
    def _spans(self) -> tuple[list[float], list[tuple[float, ...]], list[float]]:
        """
        Return the arc lengths, the segments and `_bends` as lists, for scalar code.

        A segment holds x and y of its start, x and y of its direction, the heading and its slope.
        """
        slopes = np.diff(self.heading) / np.diff(self.s)
        rows = np.column_stack((self.points[:-1], self.directions, self.heading[:-1], slopes))
        return self.s.tolist(), [tuple(row) for row in rows.tolist()], self._bends.tolist()

    def place(self, s: float) -> tuple[float, float, float, float, float]:
        """
        Return one arc length [m] and the values of `pose_at` there.

        :return: s, x [m], y [m], heading [rad] and curvature [1/m]
        """
        at, spans, bends = self._spans
        after = bisect_right(at, s)
        segment = 0 if after == 0 else after - 1 if after < len(at) else after - 2
        x, y, along_x, along_y, heading, slope = spans[segment]
        beyond = s - at[segment]
        if after == len(at):
            heading = float(self.heading[-1])
        elif after:
            heading = slope * beyond + heading
        return s, x + beyond * along_x, y + beyond * along_y, heading, bends[after]

    def rates(self, s: float, d: float, *vectors: Sequence[float]) -> list[float]:
        """
        Return how fast s grows along vectors, as ds/dt along the velocity of a projected point.

        :param s: arc length of the point [m]
        :param d: its offset to the left [m]
        :param vectors: each (2), such as velocities [m/s]
        :return: one for each, in its unit.
        """
        _, _, _, heading, bend = self.place(s)
        cos, sin = math.cos(heading), math.sin(heading)
        after = bisect_right(self._spans[0], s)
        segment = min(max(after - 1, 0), len(self.steps) - 1)
        along_x, along_y = self._spans[1][segment][2:4]
        # The point stays on the normal of the heading, which turns along s.
        stretch = cos * along_x + sin * along_y - bend * d
        return [(x * cos + y * sin) / max(stretch, _LEAST_STRETCH) for x, y in vectors]

    def heading_at(self, s: FloatArray) -> FloatArray:
        """Return the headings at arc lengths of any shape, not wrapped [rad]."""
        return np.asarray(np.interp(s, self.s, self.heading), dtype=np.float64)

    def pose_at(self, s: FloatArray) -> FloatArray:
        """
        Return x [m], y [m], heading [rad] and curvature [1/m] at arc lengths.

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
        """Return the (..., 3) poses at arc lengths and offsets (...); yaw is not wrapped."""
        return beside(self.pose_at(s), d)

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Find arc lengths and offsets (N), (N) of points (N, 2): the inverse of `poses`."""
        if len(points) == 1:
            s, d = self.project_one(*points[0].tolist())
            return np.array([s]), np.array([d])
        rows = max(1, _CHUNK // len(self.steps))
        if len(points) > rows:
            parts = [self.project(points[i:i + rows]) for i in range(0, len(points), rows)]
            return (np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts]))
        best, along = self._nearest_segments(points[:, :1], points[:, 1:])
        return self._settle(points, self.s[best] + along)

    def project_one(self, x: float, y: float) -> tuple[float, float]:
        """Find the arc length and the offset of one point [m], bit for bit as `project` does."""
        best, along = self._nearest_segments(x, y)
        s = trial = float(self.s[best[0]] + along[0])
        d, error = 0.0, math.inf
        for _ in range(_MOST_ROUNDS):
            _, here_x, here_y, heading, _ = self.place(trial)
            dx, dy, cos, sin = x - here_x, y - here_y, math.cos(heading), math.sin(heading)
            ahead = dx * cos + dy * sin
            if not abs(ahead) < error:
                break
            s, d, error = trial, dy * cos - dx * sin, abs(ahead)
            if not error > _SETTLED:
                break
            trial = trial + ahead
        return s, d

    def _nearest_segments(self, x: FloatArray | float, y: FloatArray | float
                          ) -> tuple[NDArray[np.intp], FloatArray]:
        """
        Return the segments nearest to points, and the points' distances along these.

        :param x: (N, 1), or one number for one point [m]
        :param y: likewise [m]
        :return: (N) numbers of segments, and (N), which go on beyond both ends of the curve [m]
        """
        begin_x, begin_y, to_x, to_y = self._segments
        dx, dy = x - begin_x, y - begin_y
        along = np.atleast_2d(dx * to_x + dy * to_y)
        inside = np.minimum(np.maximum(along, 0.0), self.steps)
        # In place: fresh memory takes as long as the arithmetic.
        dy *= to_x
        dx *= to_y
        dy -= dx
        dy *= dy
        away = along - inside
        away *= away
        away += dy
        best = away.argmin(axis=1)
        inside[:, 0] = np.minimum(along[:, 0], self.steps[0])
        inside[:, -1] = np.where(along[:, -1] > 0.0, along[:, -1], inside[:, -1])
        return best, inside[np.arange(len(best)), best]

    def _settle(self, points: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Move s until each point is on the normal of the interpolated heading, or nearest."""
        error = np.full_like(s, np.inf)
        trial = s
        d = np.zeros_like(s)
        for _ in range(_MOST_ROUNDS):
            along, aside = seen_from(self.pose_at(trial), points)
            better = np.abs(along) < error
            s = np.where(better, trial, s)
            d = np.where(better, aside, d)
            error = np.where(better, np.abs(along), error)
            trial = np.where(better, trial + along, s)
            if not (better & (np.abs(along) > _SETTLED)).any():
                break
        return s, d

    def refine(self, points: FloatArray, guess: FloatArray, rounds: int = 3,
               exact: float = 0.0) -> tuple[FloatArray, FloatArray]:
        """
        Project points whose arc length is nearly known, by Newton's method.

        :param points: (N, 2); NaN gives NaN [m]
        :param guess: (N) arc lengths [m]
        :param rounds: number of corrections.
        :param exact: stop earlier once all points are this close to their normals [m]
        :return: arc lengths s and offsets d to the left, both (N) [m]
        """
        if len(points) <= _FEW:
            return self._refine_few(points.tolist(), guess.tolist(), rounds, exact)
        s = np.asarray(guess, dtype=np.float64)
        aside = np.zeros_like(s)
        for left in range(rounds, -1, -1):
            s = self._within(s)
            pose = self.pose_at(s)
            along, aside = seen_from(pose, points)
            if exact and np.abs(along).max() < exact:
                break
            if left or exact:
                # Beyond the centre of curvature Newton's step would point the wrong way.
                along /= np.maximum(1.0 - pose[:, 3] * aside, _LEAST_STRETCH)
            s = s + along
        return s, aside

    def _refine_few(self, points: list[list[float]], s: list[float], rounds: int,
                    exact: float) -> tuple[FloatArray, FloatArray]:
        """Compute the result of `refine`, bit for bit, with scalars."""
        aside, steps, place = [0.0] * len(s), [0.0] * len(s), self.place
        for left in range(rounds, -1, -1):
            near = exact > 0.0
            for i, (x, y) in enumerate(points):
                s[i], here_x, here_y, heading, bend = place(s[i])
                dx, dy, cos, sin = x - here_x, y - here_y, math.cos(heading), math.sin(heading)
                along, d = dx * cos + dy * sin, dy * cos - dx * sin
                near = near and abs(along) < exact
                stretch = 1.0 - bend * d if left or exact else 1.0
                aside[i], steps[i] = d, along / (
                    stretch if not stretch < _LEAST_STRETCH else _LEAST_STRETCH)
            if near:
                break
            for i, step in enumerate(steps):
                s[i] += step
        return np.array(s), np.array(aside)

    def _within(self, s: FloatArray) -> FloatArray:
        """Return the arc lengths unchanged: the curve is straight beyond its ends."""
        return s


def arc_length(points: FloatArray) -> FloatArray:
    """Sum the lengths of the segments of a polyline (n, 2): (n) from 0 [m]."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate(([0.0], np.cumsum(lengths)))


def nearest(points: FloatArray, samples: FloatArray) -> NDArray[np.intp]:
    """Return the row of the sample (M, 2) that is nearest to each of points (N, 2)."""
    dx, dy = points[:, :1] - samples[:, 0], points[:, 1:] - samples[:, 1]
    # In place: fresh memory takes as long as the arithmetic.
    dx *= dx
    dy *= dy
    dx += dy
    return dx.argmin(axis=1)
