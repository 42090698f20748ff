# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Points as the page gets them: flat lists of rounded coordinates."""

import numpy as np
from numpy.typing import NDArray
import shapely

Points = NDArray[np.float64]

# Lines lose vertices that the eye would not miss [m]; neighbours share theirs, and keep so.
TOLERANCE = 0.01
_DECIMALS = 3


def flat(points: Points) -> list[float]:
    """Flatten points (N, D) [m]."""
    return [rounded(value) for value in np.asarray(points, dtype=np.float64).ravel()]


def rounded(value: float) -> float:
    """Round a coordinate to millimetres [m]."""
    return round(float(value), _DECIMALS)


def simplified(vertices: Points) -> Points:
    """
    Drop the vertices of a polyline without which it is the same within a centimetre.

    :param vertices: (N, 2), or (N, 3) of which the heights keep as true [m]
    :return: those that are left, first and last among them
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
