# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Geographic positions in a plane with true distances, and the same plane for converters."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# WGS 84: semi-major axis [m] and flattening.
_RADIUS, _FLATTENING = 6378137.0, 1.0 / 298.257223563


def tangent_plane(degrees: FloatArray) -> FloatArray:
    """
    Return positions on the ellipsoid in the plane that touches it in their middle.

    Distances are true to a part in a million within 5 km of the middle.

    :param degrees: (N, 2) latitude and longitude [deg] by WGS 84
    :return: (N, 2) east and north of the middle [m]
    """
    middle = 0.5 * (degrees.min(axis=0) + degrees.max(axis=0))
    latitude, longitude = np.radians(middle)
    east = np.array([-np.sin(longitude), np.cos(longitude), 0.0])
    up = np.array([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude),
                   np.sin(latitude)])
    offsets = _geocentric(degrees) - _geocentric(middle[None])
    return np.stack((offsets @ east, offsets @ np.cross(up, east)), axis=-1)


def _geocentric(degrees: FloatArray) -> FloatArray:
    """Return the Cartesian coordinates (N, 3) of points on the ellipsoid [m]."""
    latitude, longitude = np.radians(degrees).T
    eccentricity = _FLATTENING * (2.0 - _FLATTENING)
    normal = _RADIUS / np.sqrt(1.0 - eccentricity * np.sin(latitude) ** 2)
    return np.stack((normal * np.cos(latitude) * np.cos(longitude),
                     normal * np.cos(latitude) * np.sin(longitude),
                     normal * (1.0 - eccentricity) * np.sin(latitude)), axis=-1)


def mercator_degrees(positions: FloatArray) -> FloatArray:
    """
    Return the latitude and longitude that web Mercator (EPSG:3857) maps to given positions.

    Converters project with it, which stretches a town at 50 degrees north by half. Positions of a
    plane with true distances, disguised as places near the origin of latitudes and longitudes,
    pass their projection unchanged.

    :param positions: (N, 2) [m]
    :return: (N, 2) latitude and longitude [deg]
    """
    x, y = positions.T / _RADIUS
    return np.degrees(np.stack((2.0 * np.arctan(np.exp(y)) - 0.5 * np.pi, x), axis=-1))
