# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The agents that traffic_node moves, as sim_node uses them."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from crgame_ros.game.events import TrafficOrder
from crgame_ros.game.objects import ObjectStates
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.messages.joints import JointSeries, object_joint_names
from crgame_ros.simulation.traffic_setup import TrafficSetup
import numpy as np

if TYPE_CHECKING:
    from crgame_ros.traffic.fleet.world_view import WorldView

# Agents with late states go on for this long [s], then brake to a stop [m/s^2].
ROLLS_ON_S = 0.5
DECELERATION = 3.0


class RemoteTraffic:
    """
    The states on `/traffic/agents`, and substitutes for them while they are late.

    :param take: returns the states that have come.
    :param traffic: the agents at the first tick.
    :param scheduler: the run's time grids, with its clock offset.
    """

    def __init__(self, take: Callable[[], list[JointSeries]], traffic: TrafficSetup,
                 scheduler: ScenarioScheduler) -> None:
        self._take = take
        self._names = tuple(name for item in traffic.descriptions
                            for name in object_joint_names(item.id))
        self._scheduler = scheduler
        self._shown = traffic.make().states
        self._k = scheduler.k0
        # The tick for which states were last requested.
        self._now = self._k
        self._waiting: dict[int, ObjectStates] = {}

    def wants(self, stamp_ns: int) -> bool:
        """Return whether states with this stamp can be used; late ones cannot."""
        n = self._scheduler.tick_of_stamp(stamp_ns)
        return n is not None and self._now <= self._scheduler.k(n) <= self._now + 2

    def states_for(self, k: int) -> tuple[ObjectStates, int]:
        """Return the agents at tick k, and the tick of the latest received states."""
        self._now = k
        for series in self._take():
            self._keep(series, k)
        fresh = self._waiting.pop(k, None)
        if fresh is not None:
            self._shown, self._k = fresh, k
            self._waiting = {at: states for at, states in self._waiting.items() if at > k}
        elif k > self._k:
            self._shown = _gone_on(self._shown, k - self._k, self._scheduler.time_step_s)
        return self._shown, self._k

    def is_ahead(self) -> bool:
        """Return whether the agents of the next tick have come."""
        for series in self._take():
            self._keep(series, self._k)
        return self._k + 1 in self._waiting

    def publish(self, view: 'WorldView') -> None:
        """Do nothing: traffic_node reads the published world."""

    def obey(self, order: TrafficOrder) -> None:
        """Do nothing: traffic_node reads the published events."""

    def _keep(self, series: JointSeries, k: int) -> None:
        """Keep states for this tick or a later one; discard others."""
        n = self._scheduler.tick_of_stamp(series.stamp_ns)
        if n is None or series.names != self._names or len(series.times_ns) != 1:
            return
        at = self._scheduler.k(n)
        if k <= at <= k + 1:
            self._waiting[at] = ObjectStates(series.positions[0].reshape(-1, 3),
                                             series.velocities[0].reshape(-1, 3))


def _gone_on(states: ObjectStates, late: int, time_step_s: float) -> ObjectStates:
    """Move agents one tick on; their states have been late for `late` ticks."""
    velocities = states.velocities.copy()
    if late * time_step_s > ROLLS_ON_S:
        speed = np.hypot(velocities[:, 0], velocities[:, 1])
        slower = np.maximum(0.0, speed - DECELERATION * time_step_s)
        velocities *= (slower / np.maximum(speed, 1e-9))[:, None]
    return ObjectStates(states.poses + time_step_s * velocities, velocities)
