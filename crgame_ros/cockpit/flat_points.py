# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Points for the page: flat lists of rounded coordinates."""

import numpy as np
from numpy.typing import NDArray
import shapely

Points = NDArray[np.float64]

# Tolerance of line simplification [m], too small to see; neighbours keep shared vertices.
TOLERANCE = 0.01
_DECIMALS = 3


def flat(points: Points) -> list[float]:
    """Return points (N, D) as one flat list [m]."""
    return [rounded(value) for value in np.asarray(points, dtype=np.float64).ravel()]


def rounded(value: float) -> float:
    """Return a coordinate rounded to millimetres [m]."""
    return round(float(value), _DECIMALS)


def simplified(vertices: Points) -> Points:
    """
    Return a polyline without the vertices that change it by less than a centimetre.

    :param vertices: (N, 2), or (N, 3) whose heights stay as exact [m]
    :return: the vertices that are left, including the first and the last
    """
    points = np.asarray(vertices, dtype=np.float64)
    kept = shapely.get_coordinates(
        shapely.simplify(shapely.LineString(points[:, :2]), TOLERANCE))
    if points.shape[1] < 3:
        return kept
    steps = np.hypot(*np.diff(points[:, :2], axis=0).T)
    s = np.concatenate(([0.0], np.cumsum(steps)))
    profile = shapely.get_coordinates(shapely.simplify(
        shapely.LineString(np.column_stack((s, points[:, 2]))), TOLERANCE))
    needed = {tuple(row) for row in kept.tolist()}
    return points[[tuple(row) in needed for row in points[:, :2].tolist()]
                  | np.isin(s, profile[:, 0])]
