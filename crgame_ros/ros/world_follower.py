# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The true world as sim_node publishes it, step by step, for nodes that follow it."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from trajectory_msgs.msg import JointTrajectory

from crgame_ros.planner.joints import vehicles_from_joints
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import from_time
from crgame_ros.ros.scenario_documents import ScenarioSet
from crgame_ros.scenario.objects import ObjectStates

FloatArray = NDArray[np.float64]
# Kept while their other half is on its way; both are published within a millisecond.
MAX_WAITING = 50


@dataclass(frozen=True)
class WorldStep:
    """
    The world at one published step.

    :param n: simulation step.
    :param tick: whether the objects are new.
    :param positions: (V, 4) joints of the driven vehicles
    :param velocities: (V, 4)
    :param accelerations: (V, 4)
    :param objects: all other objects, at the last tick.
    """

    n: int
    tick: bool
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    objects: ObjectStates

    @property
    def states(self) -> FloatArray:
        """States (V, 8) of the driven vehicles."""
        return vehicles_from_joints(self.positions, self.velocities, self.accelerations)


class WorldFollower:
    """
    Puts the states of vehicles and `/traffic/objects` together, in order and without a gap.

    :param endpoints: of the node.
    :param states: topic of the vehicles, at every step or at scenario time steps alone.
    """

    def __init__(self, endpoints: Endpoints, states: str) -> None:
        self._states = endpoints.polled(states)
        self._objects = endpoints.polled('/traffic/objects', depth=MAX_WAITING)
        self._scenario: ScenarioSet | None = None
        self._waiting: deque[JointTrajectory] = deque(maxlen=MAX_WAITING)
        self._objects_by_n: dict[int, ObjectStates] = {}
        self._latest: ObjectStates | None = None

    def begin(self, scenario: ScenarioSet) -> None:
        """Follow another run; what has come of it already stays."""
        self._scenario = scenario
        self._objects_by_n.clear()
        self._latest = None

    def steps(self) -> Iterator[WorldStep]:
        """Give every step that is complete, once."""
        while (message := self._states.take()) is not None:
            self._waiting.append(message)
        if self._scenario is None:
            return
        self._take_objects(self._scenario)
        while self._waiting:
            step = self._complete(self._scenario, self._waiting[0])
            if step is None:
                return
            self._waiting.popleft()
            if step.n >= 0:
                yield step

    def _take_objects(self, scenario: ScenarioSet) -> None:
        scheduler, count = scenario.game.scheduler, 3 * len(scenario.others)
        while (message := self._objects.take()) is not None:
            n = scheduler.tick_of_stamp(from_time(message.header.stamp))
            if n is not None and message.points and len(message.points[0].positions) == count:
                point = message.points[0]
                self._objects_by_n[n] = ObjectStates(
                    np.array(point.positions).reshape(-1, 3),
                    np.array(point.velocities).reshape(-1, 3))

    def _complete(self, scenario: ScenarioSet, message: JointTrajectory) -> WorldStep | None:
        """Give a step, None if its objects are still on their way; n < 0: of another run."""
        scheduler, count = scenario.game.scheduler, 4 * len(scenario.driven)
        n = scheduler.step_of_stamp(from_time(message.header.stamp))
        nothing = np.empty((0, 4))
        foreign = WorldStep(-1, False, nothing, nothing, nothing,
                            ObjectStates(nothing, nothing))
        if n < 0 or not message.points or len(message.points[0].positions) != count:
            return foreign
        tick = scheduler.is_tick(n)
        if tick:
            fresh = self._objects_by_n.pop(n, None)
            # Objects come in order: behind newer ones, those of this tick never will.
            if fresh is None and max(self._objects_by_n, default=-1) < n \
                    and len(self._waiting) < MAX_WAITING // 2:
                return None
            self._latest = fresh or self._latest
            self._objects_by_n = {at: states for at, states in self._objects_by_n.items()
                                  if at > n}
        if self._latest is None:
            return foreign
        point = message.points[0]
        positions, velocities, accelerations = (np.array(values).reshape(-1, 4) for values in (
            point.positions, point.velocities, point.accelerations))
        return WorldStep(n, tick, positions, velocities, accelerations, self._latest)
