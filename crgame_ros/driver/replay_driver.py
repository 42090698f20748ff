# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A driver that repeats recorded commands, cycle by cycle."""

import math

from crgame_ros.driver.source import DriverSource
from crgame_ros.driver.watchdog import SeatWatchdog
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
import numpy as np
from numpy.typing import NDArray


class ReplayDriver(DriverSource):
    """
    A driver that repeats the commands consumed in a recorded run.

    After their end the driver counts as lost: pedals and steering return at their rates, then the
    brake is applied gently and stays on, in simulation time.

    :param commands: (cycles, 6) throttle, brake, steering, reverse, lights and put_back of cycle
        0, 1, …; NaN where an AV followed its plan. Recordings of earlier versions have the first
        four or five.
    """

    def __init__(self, commands: NDArray[np.float64]) -> None:
        self._commands = [_command(row) for row in commands.tolist()]
        self._recorded = len(self._commands)
        self._end = SeatWatchdog()

    def drives(self, n: int) -> bool:
        """Return whether a driver drove in the recorded cycle n."""
        return n < self._recorded and not math.isnan(self._commands[n].throttle)

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """Return the recorded command of cycle n; after the last one, that of a lost driver."""
        if n >= len(self._commands) == self._recorded:
            last = self._commands[-1] if self._commands else RELEASED
            self._end.filter(last, 0.0, dt_s, 0.0)
        while n >= len(self._commands):
            # With an infinite speed the watchdog never releases the brake again.
            self._commands.append(self._end.filter(RELEASED, math.inf, dt_s, math.inf))
        return self._commands[n]


def _command(row: list[float]) -> DriverCommand:
    throttle, brake, steering, reverse, *switches = row
    lights, put_back = (*(each if each == each else 0.0 for each in switches), 0.0, 0.0)[:2]
    return DriverCommand(throttle, brake, steering, reverse == 1.0, int(lights), put_back == 1.0)
