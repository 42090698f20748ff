# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How a vehicle follows its leaders over a run: distributions of gaps and headways (SAE J2944)."""

from dataclasses import dataclass, field
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# A vehicle that hardly moves has no headway in time: it would be as long as one likes [m/s].
LEAST_SPEED = 1.0
# Shares of the time are given below these [s].
SHORT_S = (1, 2)


class Following(NamedTuple):
    """
    A vehicle and its leader at a tick.

    :param gap: from the vehicle's front to the leader's rear, along the vehicle's path [m]
    :param headway: from the vehicle's front to the leader's front, along the path [m]
    :param speed: of the vehicle along its path [m/s]
    :param leader: number of the leader among vehicles and objects.
    :param leader_speed: of the leader along the vehicle's path [m/s]
    :param comes_aside: speed of the leader across the path, towards the vehicle's side [m/s]
    """

    gap: float
    headway: float
    speed: float
    leader: int
    leader_speed: float
    comes_aside: float


class Distribution(NamedTuple):
    """
    What a value was over the ticks of a run; NaN where there is none.

    :param mean: [m] or [s]
    :param median: [m] or [s]
    :param below: shares of the ticks with values below those of `SHORT_S`, 0 to 1.
    """

    mean: float
    median: float
    below: tuple[float, ...]


@dataclass
class Headways:
    """
    The ticks of one vehicle in a run.

    :ivar ticks: at which the vehicle was there.
    :ivar approaching: ticks at which it was closing in on its leader, with a finite ttc.
    :ivar following: one for each tick with a leader.
    :ivar following_ticks: these ticks, counted from 0.
    """

    ticks: int = 0
    approaching: int = 0
    following: list[Following] = field(default_factory=list)
    following_ticks: list[int] = field(default_factory=list)

    def add(self, following: Following | None, ttc_s: float) -> None:
        """Add a tick; `following` is None without a leader."""
        if following is not None:
            self.following.append(following)
            self.following_ticks.append(self.ticks)
        self.ticks += 1
        self.approaching += math.isfinite(ttc_s)

    def share_following(self) -> float:
        """Return the share of the ticks with a leader."""
        return self._share(len(self.following))

    def share_approaching(self) -> float:
        """Return the share of the ticks with a finite ttc."""
        return self._share(self.approaching)

    def distances(self) -> dict[str, Distribution]:
        """Return the distributions of gap and headway [m]."""
        values = self._values()
        return {'gap': _distribution(values[:, 0]), 'headway': _distribution(values[:, 1])}

    def times(self) -> dict[str, Distribution]:
        """Return those of gap and headway divided by the speed [s], above `LEAST_SPEED`."""
        values = self._values()
        moving = values[values[:, 2] > LEAST_SPEED]
        return {'time_gap': _distribution(moving[:, 0] / moving[:, 2]),
                'time_headway': _distribution(moving[:, 1] / moving[:, 2])}

    def _values(self) -> NDArray[np.float64]:
        return np.array([each[:3] for each in self.following],
                        dtype=np.float64).reshape(-1, 3)

    def _share(self, count: int) -> float:
        return count / self.ticks if self.ticks else math.nan


def _distribution(values: NDArray[np.float64]) -> Distribution:
    if not len(values):
        return Distribution(math.nan, math.nan, (math.nan,) * len(SHORT_S))
    return Distribution(float(values.mean()), float(np.median(values)),
                        tuple(float((values < limit).mean()) for limit in SHORT_S))
