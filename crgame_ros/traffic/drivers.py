# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What drivers make of what they have decided: late, not quite, or not at all."""

import numpy as np
from numpy.typing import NDArray

from crgame_ros.traffic.agents import Agents
from crgame_ros.traffic.lane_graph import FloatArray, IntArray
from crgame_ros.traffic.spec import TrafficSpec

# [m/s]
WALKING = 2.0


class Drivers:
    """
    The failings of the agents' drivers (A); without any nothing is drawn at random.

    :param spec: reaction time, imperfection and share of those who ignore lights.
    :param count: of the agents.
    :param max_acceleration: [m/s^2]
    :param time_step_s: Delta t_c [s]
    :param generator: of random numbers.

    Attribute `run_lights` (A): who ignores traffic lights.
    """

    def __init__(self, spec: TrafficSpec, count: int, max_acceleration: float,
                 time_step_s: float, generator: np.random.Generator) -> None:
        self._failure = spec.imperfection * max_acceleration
        self._random = generator
        self.run_lights: NDArray[np.bool_] = (
            generator.random(count) < spec.red_runners if spec.red_runners > 0.0
            else np.zeros(count, dtype=bool))
        # What was decided at the last ticks; NaN for those who were not there.
        self._decided = np.full((round(spec.reaction_time / time_step_s), count), np.nan)

    def do(self, k: int, agents: Agents, slots: IntArray, wanted: FloatArray) -> FloatArray:
        """Give the accelerations (A) that come of those that are wanted (A) [m/s^2]."""
        if self._failure > 0.0:
            wanted = wanted - self._failure * self._random.random(len(slots)) * (
                agents.speed[slots] > 0.0)
        if len(self._decided):
            row = self._decided[k % len(self._decided)]
            before = row[slots]
            row[:] = np.nan
            row[slots] = wanted
            # At walking pace the foot is on the brake.
            ready = np.isnan(before) | ((agents.speed[slots] < WALKING) & (wanted < before))
            wanted = np.where(ready, wanted, before)
        return wanted
