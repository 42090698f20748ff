# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A driver that repeats recorded commands, cycle by cycle."""

import math

import numpy as np
from numpy.typing import NDArray

from crgame_ros.driver.command import DriverCommand, RELEASED
from crgame_ros.driver.source import DriverSource


class ReplayDriver(DriverSource):
    """
    Repeats the commands that a recorded run consumed; released after their end.

    :param commands: (cycles, 4) throttle, brake, steering, reverse of cycle 0, 1, …; NaN where an
        AV followed its plan.
    """

    def __init__(self, commands: NDArray[np.float64]) -> None:
        self._commands = [DriverCommand(row[0], row[1], row[2], row[3] == 1.0)
                          for row in commands.tolist()]

    def drives(self, n: int) -> bool:
        """Tell whether somebody drove in the recorded cycle n."""
        return n < len(self._commands) and not math.isnan(self._commands[n].throttle)

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """Give the recorded command of cycle n."""
        return self._commands[n] if n < len(self._commands) else RELEASED
