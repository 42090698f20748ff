# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The true world as sim_node publishes it, step by step, for nodes that follow it."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectStates
from crgame_ros.messages.joints import vehicles_from_joints
from crgame_ros.messages.world_messages import WorldMessages
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import from_time
from crgame_ros.ros.run_time import RunTime, TimeCourse, USUAL_NS
from crgame_ros.ros.scenario_documents import ScenarioSet
import numpy as np
from numpy.typing import NDArray
from trajectory_msgs.msg import JointTrajectory

FloatArray = NDArray[np.float64]
# Messages kept until their counterpart arrives; both are published within a millisecond. States of
# several seconds are kept, so that a delayed node on a busy machine misses none.
MAX_WAITING, MAX_STATES = 50, 1000


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
        """Return the driven vehicles' states, (V, 8)."""
        return vehicles_from_joints(self.positions, self.velocities, self.accelerations)


class WorldFollower:
    """
    The states of vehicles and `/traffic/objects`, combined in order and without a gap.

    :param endpoints: of the node.
    :param states: topic of the vehicles, at every step or at scenario time steps alone.
    :param begin_anew: called where the run begins again, as in a recording that is played again,
        before the first of its steps is returned.
    """

    def __init__(self, endpoints: Endpoints, states: str,
                 begin_anew: Callable[[], object] = lambda: None) -> None:
        self._begin_anew = begin_anew
        self._time = RunTime()
        self._states = endpoints.polled(states)
        self._objects = endpoints.polled('/traffic/objects', depth=MAX_WAITING)
        self._scenario: ScenarioSet | None = None
        self._waiting: deque[JointTrajectory] = deque(maxlen=MAX_STATES)
        # Messages far ahead of the others: of a run that goes on there, or false.
        self._ahead: list[JointTrajectory] = []
        self._objects_by_n: dict[int, ObjectStates] = {}
        self._latest: ObjectStates | None = None

    def begin(self, scenario: ScenarioSet) -> None:
        """Follow another run; messages of it that have already come are kept."""
        self._scenario = scenario
        # A new run begins ahead of the one before. One that is played again goes back, which its
        # messages tell.
        begins_ns = scenario.game.scheduler.clock_offset_ns
        if self._time.at_ns is None or begins_ns > self._time.at_ns:
            self._time = RunTime(at_ns=begins_ns)
        self._waiting.extend(self._ahead)
        self._ahead.clear()
        self._reader = WorldMessages(scenario.objects)
        self._objects_by_n.clear()
        self._latest = None

    def drop(self) -> None:
        """Discard the received messages, which may be the end of an unknown run."""
        self._receive_states()
        self._waiting.clear()

    def steps(self) -> Iterator[WorldStep]:
        """Yield every step that is complete, once."""
        self._receive_states()
        if self._scenario is None:
            return
        self._receive_objects(self._scenario)
        while self._waiting:
            step = self._complete(self._scenario, self._waiting[0])
            if step is None:
                return
            self._waiting.popleft()
            if step.n >= 0:
                yield step

    def _receive_states(self) -> None:
        while (message := self._states.pop()) is not None:
            course = self._time.follow(_stamp_ns(message))
            if course is TimeCourse.AHEAD:
                self._ahead.append(message)
                continue
            if self._ahead and course is not TimeCourse.BEHIND:
                # Time has moved on to there only if this message follows those.
                if 0 <= _stamp_ns(message) - _stamp_ns(self._ahead[-1]) <= USUAL_NS:
                    self._waiting.extend(self._ahead)
                self._ahead.clear()
            if course is TimeCourse.BACK:
                self._waiting.clear()
                self._objects_by_n.clear()
                self._latest = None
                self._begin_anew()
            if course is not TimeCourse.BEHIND:
                self._waiting.append(message)

    def _receive_objects(self, scenario: ScenarioSet) -> None:
        scheduler = scenario.game.scheduler
        while (message := self._objects.pop()) is not None:
            n = scheduler.tick_of_stamp(from_time(message.header.stamp))
            if n is None:
                continue
            try:
                self._objects_by_n[n] = self._reader.object_states(message)
            except InputError:
                # From the game before or after this one.
                continue
            # Objects of a far future step are erroneous.
            while len(self._objects_by_n) > MAX_WAITING:
                del self._objects_by_n[max(self._objects_by_n)]

    def _complete(self, scenario: ScenarioSet, message: JointTrajectory) -> WorldStep | None:
        """Return a step, None if its objects have not come yet; n < 0: of another run."""
        scheduler = scenario.game.scheduler
        n = scheduler.step_of_stamp(_stamp_ns(message))
        nothing = np.empty((0, 4))
        foreign = WorldStep(-1, False, nothing, nothing, nothing,
                            ObjectStates(nothing, nothing))
        try:
            joints = self._reader.vehicle_joints(message)
        except InputError:
            return foreign
        if n < 0:
            return foreign
        tick = scheduler.is_tick(n)
        if tick:
            fresh = self._objects_by_n.pop(n, None)
            # Objects come in order: after newer ones, those of this tick never come.
            if fresh is None and max(self._objects_by_n, default=-1) < n \
                    and len(self._waiting) < MAX_WAITING // 2:
                return None
            self._latest = fresh or self._latest
            self._objects_by_n = {at: states for at, states in self._objects_by_n.items()
                                  if at > n}
        if self._latest is None:
            return foreign
        return WorldStep(n, tick, joints[0], joints[1], joints[2], self._latest)


def _stamp_ns(message: JointTrajectory) -> int:
    return from_time(message.header.stamp)
