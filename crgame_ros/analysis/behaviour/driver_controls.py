# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A driver's use of pedals and steering wheel over a run, in even pieces without gaps."""

from collections.abc import Iterator
from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Recording gaps up to this length are interpolated linearly; a longer gap begins a new piece [s].
LONGEST_GAP_S = 0.1


@dataclass(frozen=True)
class DriverControls:
    """
    The controls of one driver, at rising times; rows at which no human drove are left out.

    :param times_s: (R) of the commands since the run's start [s]
    :param throttle: (R) 0 to 1
    :param brake: (R) 0 to 1
    :param wheel_deg: (R) angle of the steering wheel, positive to the left [degrees]
    :param dt_s: nominal step between them [s]
    """

    times_s: FloatArray
    throttle: FloatArray
    brake: FloatArray
    wheel_deg: FloatArray
    dt_s: float

    @classmethod
    def from_commands(cls, times_s: FloatArray, commands: FloatArray, max_wheel_angle: float,
                      dt_s: float) -> 'DriverControls':
        """
        Build the controls from commands.

        :param commands: (R, 4) throttle, brake, steering in [-1, 1] and reverse; NaN where no
            human drove.
        :param max_wheel_angle: angle of the steering wheel at a steering of 1:
            theta_sw = s theta_sw,max (CRG III-C2b) [rad]
        """
        known = np.isfinite(commands[:, :3]).all(axis=1)
        throttle, brake, steering = commands[known, :3].T
        return cls(times_s[known], throttle, brake, math.degrees(max_wheel_angle) * steering, dt_s)

    def pieces(self) -> Iterator[slice]:
        """Yield the pieces in which the driver drove without a gap."""
        gaps = np.flatnonzero(np.diff(self.times_s) > LONGEST_GAP_S + 0.5 * self.dt_s) + 1
        bounds = [0, *gaps.tolist(), len(self.times_s)]
        for first, end in zip(bounds[:-1], bounds[1:], strict=True):
            if end > first:
                yield slice(first, end)

    @property
    def driven_s(self) -> float:
        """Return the time driven by a human: each command counts as one step [s]."""
        return sum((self.times_s[piece][-1] - self.times_s[piece][0] + self.dt_s
                    for piece in self.pieces()), 0.0)

    def even_pieces(self, values: FloatArray) -> list[FloatArray]:
        """
        Resample values linearly, each piece at the nominal step.

        :param values: (R) at `times_s`.
        """
        found = []
        for piece in self.pieces():
            times_s = self.times_s[piece]
            count = round((times_s[-1] - times_s[0]) / self.dt_s) + 1
            found.append(np.interp(times_s[0] + self.dt_s * np.arange(count), times_s,
                                   values[piece]))
        return found
