# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How fast agents want to drive: each at its own share of the limit, or as an event says."""

from crgame_ros.game.events import ALL_AGENTS, TrafficChange
from crgame_ros.traffic.agents import Agents
from crgame_ros.traffic.lane_graph import IntArray
import numpy as np

# Nobody wants to drive at less of the limit; and who wants a speed of its own does not look at it.
LEAST, UNLIMITED = 0.1, 1e6


class DesiredSpeeds:
    """
    Gives newcomers their desired speeds, and changes those of agents on the road.

    :param mean: of desired speed over speed limit.
    :param spread: its standard deviation between drivers.
    :param generator: of random numbers.
    """

    def __init__(self, mean: float, spread: float, generator: np.random.Generator) -> None:
        self._first_mean = self._mean = mean
        self._spread, self._random = spread, generator
        # What events said of single agents, and of all: factor and own limit [m/s].
        self._said: dict[int, tuple[float, float]] = {}
        self._said_of_all: tuple[float, float] | None = None

    def draw(self, agents: Agents, slot: int) -> None:
        """Give an agent a share of the limit at random."""
        deviation = float(np.clip(self._random.standard_normal(), -2.0, 2.0))
        self._settle(agents, slot, max(LEAST, self._mean * (1.0 + self._spread * deviation)))

    def record(self, agents: Agents, slot: int, factor: float) -> None:
        """Give an agent the share of the limit that it was recorded with."""
        self._settle(agents, slot, factor * (self._mean / self._first_mean))

    def _settle(self, agents: Agents, slot: int, factor: float) -> None:
        agents.share[slot] = factor / self._mean
        agents.factor[slot], agents.top[slot] = self._said.get(
            slot, self._said_of_all or (factor, agents.type_top[slot]))

    def change(self, change: TrafficChange, agents: Agents, slots: IntArray) -> None:
        """Let agents want other speeds; the mean of all is changed, not who is how far from it."""
        factor, speed = change.speed_factor, change.desired_speed
        if factor is None and speed is None:
            return
        of_all = change.agent == ALL_AGENTS
        if of_all:
            self._said.clear()
            self._said_of_all = None if speed is None else (UNLIMITED, speed)
            self._mean = self._mean if factor is None else factor
        for slot in slots.tolist():
            top = float(agents.type_top[slot])
            said = (UNLIMITED, speed) if speed is not None else (float(factor or 0.0), top)
            if not of_all:
                self._said[slot] = said
            elif speed is None:
                said = max(LEAST, self._mean * float(agents.share[slot])), top
            agents.factor[slot], agents.top[slot] = said
