# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Angles in radians: normalisation and interpolation by the shortest way."""

import math

import numpy as np
from numpy.typing import NDArray


def wrap_pi(angle: float) -> float:
    """
    Normalise an angle to (-pi, pi] (the operator wrap_pi of CRG, equations 6, 9 and 10).

    :param angle: [rad]
    :return: the same direction in (-pi, pi] [rad]
    """
    if -math.pi < angle <= math.pi:
        return angle
    wrapped = math.remainder(angle, 2.0 * math.pi)
    return math.pi if wrapped == -math.pi else wrapped


def wrap_pi_array(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normalise an array of angles [rad] to (-pi, pi]; NaN stays NaN."""
    wrapped = np.pi - np.mod(np.pi - angles, 2.0 * np.pi)
    # The remainder of a tiny negative number rounds up to the modulus itself.
    return np.asarray(np.where(wrapped <= -np.pi, np.pi, wrapped), dtype=np.float64)


def interpolate_angle(start: float, end: float, fraction: float) -> float:
    """
    Interpolate between two angles by the shortest way.

    :param start: angle at fraction 0 [rad]
    :param end: angle at fraction 1 [rad]
    :param fraction: position between them [-]
    :return: angle in (-pi, pi] [rad]
    """
    return wrap_pi(start + fraction * wrap_pi(end - start))
