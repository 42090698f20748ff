# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Desired speeds, habits and imperfections of the agents' drivers."""

from crgame_ros.game.events import ALL_AGENTS, TrafficChange
from crgame_ros.game.traffic_spec import MAX_REACTION_TIME, TrafficSpec
from crgame_ros.traffic.fleet.agents import Agents
from crgame_ros.traffic.following.leaders import Followers
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray
import numpy as np
from numpy.typing import NDArray

# Least share of the speed limit that a driver desires; share of a driver whose own desired speed
# replaces the limit.
LEAST, UNLIMITED = 0.1, 1e6


class DesiredSpeeds:
    """
    The desired speeds of newcomers and of agents on the road.

    :param mean: of desired speed over speed limit.
    :param spread: its relative standard deviation between drivers.
    :param generator: of random numbers.
    """

    def __init__(self, mean: float, spread: float, generator: np.random.Generator) -> None:
        self._first_mean = self._mean = mean
        self._spread, self._random = spread, generator
        # Factor and own limit [m/s] that events have set for single agents, and for all.
        self._said: dict[int, tuple[float, float]] = {}
        self._said_of_all: tuple[float, float] | None = None

    def draw(self, agents: Agents, slot: int) -> None:
        """Draw an agent's share of the speed limit at random."""
        deviation = float(np.clip(self._random.standard_normal(), -2.0, 2.0))
        self._settle(agents, slot, max(LEAST, self._mean * (1.0 + self._spread * deviation)))

    def record(self, agents: Agents, slot: int, factor: float) -> None:
        """Set an agent's share of the speed limit to the recorded one."""
        self._settle(agents, slot, factor * (self._mean / self._first_mean))

    def _settle(self, agents: Agents, slot: int, factor: float) -> None:
        agents.share[slot] = factor / self._mean
        agents.factor[slot], agents.top[slot] = self._said.get(
            slot, self._said_of_all or (factor, agents.type_top[slot]))

    def change(self, change: TrafficChange, agents: Agents, slots: IntArray) -> None:
        """Change desired speeds; of all agents it is the mean, not the deviation of each."""
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


# Below this speed drivers brake without reaction time [m/s].
WALKING = 2.0


class Drivers:
    """
    The habits and failings of the agents' drivers (A); without any, no random number is drawn.

    :param spec: of the traffic at the start.
    :param agents: the agents; their `late` is set.
    :param followers: their car-following models.
    :param time_step_s: Delta t_c [s]
    :param generator: of random numbers.

    Attributes (A): `run_lights`: whether a driver ignores traffic lights; `politeness`;
    `change_lanes`.
    """

    def __init__(self, spec: TrafficSpec, agents: Agents, followers: Followers,
                 time_step_s: float, generator: np.random.Generator) -> None:
        count = agents.count
        self._agents, self._followers = agents, followers
        self._random, self._time_step_s = generator, time_step_s
        self.politeness = np.full(count, spec.politeness)
        self.change_lanes = np.full(count, spec.lane_changes)
        self.run_lights = self._some(spec.red_runners)
        agents.late[:] = self._some(spec.late_yielders)
        self._imperfection = np.full(count, spec.imperfection)
        self._delay = np.full(count, self._ticks(spec.reaction_time))
        # Decisions of the last ticks; NaN for agents that were absent.
        self._decided = np.full((self._ticks(MAX_REACTION_TIME) + 1, count), np.nan)
        self._last_k = -2**62

    def _some(self, share: float) -> NDArray[np.bool_]:
        """Choose a share of the drivers (A)."""
        count = self._agents.count
        return self._random.random(count) < share if share > 0.0 else np.zeros(count, dtype=bool)

    def _ticks(self, seconds: float) -> int:
        return round(seconds / self._time_step_s)

    def change(self, change: TrafficChange, slots: IntArray) -> None:
        """Change all but the desired speeds of drivers from their next decision on."""
        for values, value in (
                (self.politeness, change.politeness), (self.change_lanes, change.lane_changes),
                (self.run_lights, change.red_runner), (self._agents.late, change.late_yielder),
                (self._imperfection, change.imperfection)):
            if value is not None:
                values[slots] = value
        if change.reaction_time is not None:
            self._delay[slots] = self._ticks(change.reaction_time)
        if change.options:
            self._followers.change(slots, change.options)

    def do(self, k: int, agents: Agents, slots: IntArray, wanted: FloatArray) -> FloatArray:
        """Return the accelerations (A) after reaction time and imperfection [m/s^2]."""
        if self._imperfection.any():
            failure = self._imperfection[slots] * self._followers.max_acceleration[slots]
            wanted = wanted - failure * self._random.random(len(slots)) * (
                agents.speed[slots] > 0.0)
        if self._delay.any():
            if k != self._last_k + 1:
                self._decided[:] = np.nan
            self._last_k = k
            decided, size = self._decided, len(self._decided)
            # A newcomer does not carry out the decisions of the agent that had its slot before.
            decided[:, slots[np.isnan(decided[(k - 1) % size, slots])]] = np.nan
            decided[k % size] = np.nan
            decided[k % size, slots] = wanted
            before = decided[(k - self._delay[slots]) % size, slots]
            # At walking pace the foot is on the brake: braking takes no reaction time.
            ready = np.isnan(before) | ((agents.speed[slots] < WALKING) & (wanted < before))
            wanted = np.where(ready, wanted, before)
        return wanted
