# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Smooth reference curves of roads: clothoid chains, circular arcs and quintic connections."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
import math

import numpy as np
from numpy.typing import NDArray

Pose = tuple[float, float, float]


@dataclass(frozen=True)
class Curve:
    """
    A sampled curve.

    :param points: (n, 2) positions [m].
    :param headings: (n,) tangent directions, continuous along the curve [rad].
    """

    points: NDArray[np.float64]
    headings: NDArray[np.float64]

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points)

    def pose(self, index: int) -> Pose:
        """Return (x, y, heading) of a point."""
        x, y = self.points[index]
        return float(x), float(y), float(self.headings[index])

    def offset(self, distance: float) -> NDArray[np.float64]:
        """
        Shift every point to the left of its tangent.

        :param distance: [m]
        :return: (n, 2) points [m]
        """
        normals = np.stack((-np.sin(self.headings), np.cos(self.headings)), axis=-1)
        return self.points + distance * normals

    def shifted(self, distance: float) -> 'Curve':
        """Return the parallel curve at a distance to the left [m]."""
        return Curve(self.offset(distance), self.headings)

    def part(self, first: int, last: int) -> 'Curve':
        """Return the points from index `first` to `last`, both included."""
        return Curve(self.points[first:last + 1], self.headings[first:last + 1])

    def parts(self, cuts: Sequence[float]) -> list['Curve']:
        """Return the parts that end and begin at some arc lengths from the start [m]."""
        indices = [0, *map(self.index_at, cuts), len(self) - 1]
        return [self.part(first, last) for first, last in pairwise(indices)]

    def reversed(self) -> 'Curve':  # noqa: A003
        """Return the curve run through the other way."""
        return Curve(self.points[::-1], self.headings[::-1] + math.pi)

    def index_at(self, arc_length: float) -> int:
        """Return the index of the point nearest to an arc length from the start [m]."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        lengths = np.concatenate(([0.0], np.cumsum(steps)))
        return int(np.argmin(np.abs(lengths - arc_length)))


def clothoids(start: Pose, segments: Sequence[tuple[float, float]], spacing: float) -> Curve:
    """
    Chain segments whose curvature is linear in arc length, from 0 on, and continuous throughout.

    :param start: pose of the first point.
    :param segments: (length [m], curvature at its end [1/m]) of each.
    :param spacing: greatest distance between points [m].
    """
    x, y, heading = start
    curvature = 0.0
    points = [np.array([[x, y]])]
    headings = [np.array([heading])]
    for length, end_curvature in segments:
        count = max(1, math.ceil(length / spacing - 1e-9))
        # Midpoint quadrature over intervals this short is exact to far below the written digits.
        fine = 64
        step = length / (count * fine)
        middles = (np.arange(count * fine) + 0.5) * step
        slope = (end_curvature - curvature) / length
        directions = heading + curvature * middles + 0.5 * slope * middles ** 2
        xs = x + np.cumsum(np.cos(directions)) * step
        ys = y + np.cumsum(np.sin(directions)) * step
        ends = np.arange(1, count + 1) * (length / count)
        points.append(np.stack((xs, ys), axis=-1)[fine - 1::fine])
        headings.append(heading + curvature * ends + 0.5 * slope * ends ** 2)
        x, y = points[-1][-1]
        heading = float(headings[-1][-1])
        curvature = end_curvature
    return Curve(np.concatenate(points), np.concatenate(headings))


def arc(center: tuple[float, float], radius: float, start: float, end: float,
        spacing: float) -> Curve:
    """
    Sample a counter-clockwise circular arc.

    :param start: angle of the first point as seen from the centre [rad].
    :param end: angle of the last point, greater than `start` [rad].
    """
    count = max(2, math.ceil(radius * (end - start) / spacing))
    angles = start + (end - start) * np.arange(count + 1) / count
    points = np.stack((center[0] + radius * np.cos(angles),
                       center[1] + radius * np.sin(angles)), axis=-1)
    return Curve(points, angles + 0.5 * math.pi)


def connection(
    start: Pose, end: Pose, spacing: float, curvatures: tuple[float, float] = (0.0, 0.0),
    stretch: float = 1.0,
) -> Curve:
    """
    Join two poses by a quintic that matches position, direction and curvature at both.

    :param curvatures: at the start and at the end [1/m].
    :param stretch: length of both end tangents over the distance between the poses.
    """
    tangent = stretch * math.hypot(end[0] - start[0], end[1] - start[1])
    rows = []
    for pose, bend in zip((start, end), curvatures, strict=True):
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        rows.append((np.array(pose[:2]), tangent * np.array([cos, sin]),
                     bend * tangent ** 2 * np.array([-sin, cos])))
    (p0, v0, a0), (p1, v1, a1) = rows
    gap, speed = p1 - p0 - v0 - 0.5 * a0, v1 - v0 - a0
    change = a1 - a0
    polynomial = np.stack((p0, v0, 0.5 * a0, 10 * gap - 4 * speed + 0.5 * change,
                           -15 * gap + 7 * speed - change, 6 * gap - 3 * speed + 0.5 * change))
    fine = np.linspace(0.0, 1.0, 4001)
    line = np.vander(fine, 6, increasing=True) @ polynomial
    lengths = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))))
    count = max(2, math.ceil(lengths[-1] / spacing))
    chosen = np.interp(np.linspace(0.0, lengths[-1], count + 1), lengths, fine)
    points = np.vander(chosen, 6, increasing=True) @ polynomial
    slopes = np.vander(chosen, 5, increasing=True) @ (polynomial[1:] * np.arange(1, 6)[:, None])
    headings = np.unwrap(np.arctan2(slopes[:, 1], slopes[:, 0]))
    headings += start[2] - headings[0]
    # The ends are shared with other lanelets and therefore kept to the last digit.
    points[0], points[-1], headings[0] = start[:2], end[:2], start[2]
    headings[-1] = end[2]
    return Curve(points, headings)
