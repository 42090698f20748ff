# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a reactive object sees of the others."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ObjectSurroundings:
    """
    The others that are there, as rectangles.

    :param poses: (O, 3) centre x [m], y [m], yaw [rad]
    :param velocities: (O, 3) their derivatives.
    :param lengths: (O,) [m]
    :param widths: (O,) [m]
    """

    poses: FloatArray
    velocities: FloatArray
    lengths: FloatArray
    widths: FloatArray

    def chosen(self, rows: NDArray[np.bool_]) -> 'ObjectSurroundings':
        """Return some of them."""
        return ObjectSurroundings(self.poses[rows], self.velocities[rows], self.lengths[rows],
                                  self.widths[rows])

    @property
    def speeds(self) -> FloatArray:
        """Speeds (O,) [m/s]."""
        return np.hypot(self.velocities[:, 0], self.velocities[:, 1])
