# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether states are those of one continuous motion."""

from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray


def disagreement(states: NDArray[np.float64], dt_s: float) -> tuple[float, float]:
    """
    Return how far displacements differ from what the speeds say [m/s], and go to the side [m/s].

    :param states: (N, 8) at the rear axle
    :param dt_s: between them
    """
    steps = np.diff(states[:, :2], axis=0) / dt_s
    yaws = np.unwrap(states[:, StateColumn.YAW])
    middle, speeds = 0.5 * (yaws[1:] + yaws[:-1]), states[:, StateColumn.SPEED]
    along = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    aside = steps[:, 1] * np.cos(middle) - steps[:, 0] * np.sin(middle)
    return (float(np.abs(along - 0.5 * (speeds[1:] + speeds[:-1])).max()),
            float(np.abs(aside).max()))
