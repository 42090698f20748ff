# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A driver that repeats recorded commands, cycle by cycle."""

import numpy as np
from numpy.typing import NDArray

from crgame_ros.driver.command import DriverCommand, RELEASED
from crgame_ros.driver.source import DriverSource


class ReplayDriver(DriverSource):
    """
    Repeats the commands that a recorded run consumed; released after their end.

    :param commands: (cycles, 4) throttle, brake, steering, reverse of cycle 0, 1, …
    """

    def __init__(self, commands: NDArray[np.float64]) -> None:
        self._commands = [DriverCommand(row[0], row[1], row[2], bool(row[3]))
                          for row in commands.tolist()]

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """Give the recorded command of cycle n."""
        return self._commands[n] if n < len(self._commands) else RELEASED
