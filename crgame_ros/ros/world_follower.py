# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The true world as sim_node publishes it, for nodes that follow it or observe the run."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.objects import ObjectStates
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.joints import vehicles_from_joints, WorldMessages
from crgame_ros.occupancy.tiles import TiledOccupancy
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.node_main import StopFlag
from crgame_ros.ros.run_time import RunTime, TimeCourse, USUAL_NS
from crgame_ros.ros.scenario_documents import ScenarioDocuments, ScenarioSet
from crgame_ros.ros.spinning import poll
from crgame_ros.simulation.observer import documented_run, ObservedRun, RunObserver
import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

FloatArray = NDArray[np.float64]
# Messages kept until their counterpart arrives; both are published within a millisecond. States of
# several seconds are kept, so that a delayed node on a busy machine misses none.
MAX_WAITING, MAX_STATES = 50, 1000
PERIOD_S = 0.005

Observer = TypeVar('Observer', bound=RunObserver)


@dataclass(frozen=True)
class WorldStep:
    """
    The world at one published step.

    :param n: simulation step.
    :param tick: whether the objects are new.
    :param joints: (3, V, 4) positions, velocities and accelerations of the driven vehicles' joints
    :param objects: all other objects, at the last tick.
    """

    n: int
    tick: bool
    joints: FloatArray
    objects: ObjectStates

    @property
    def states(self) -> FloatArray:
        """Return the driven vehicles' states, (V, 8)."""
        return vehicles_from_joints(*self.joints)


class WorldFollower:
    """
    A run's documents, and the states of its vehicles and `/traffic/objects`, in order, no gap.

    :param states: topic of the vehicles, at every step or at scenario time steps alone.
    :param begin: called where a run begins, or begins again, as in a recording that is played
        again, before the first of its steps is returned.
    :ivar scenario: the run's documents; None before the first run.
    """

    def __init__(self, endpoints: Endpoints, states: str,
                 begin: Callable[[], object] = lambda: None) -> None:
        self.begin = begin
        self.scenario: ScenarioSet | None = None
        self._documents = ScenarioDocuments(endpoints)
        self._time = RunTime()
        self._states = endpoints.polled(states)
        self._objects = endpoints.polled('/traffic/objects', depth=MAX_WAITING)
        self._waiting: deque[JointTrajectory] = deque(maxlen=MAX_STATES)
        # Messages far ahead of the others: of a run that goes on there, or false.
        self._ahead: list[JointTrajectory] = []
        self._objects_by_n: dict[int, ObjectStates] = {}
        self._latest: ObjectStates | None = None

    def look(self) -> None:
        """
        Begin another run if its documents have come.

        :raises CrgameError: if a document cannot be used.
        """
        scenario = self._documents.poll()
        if scenario is not None:
            self.follow(scenario)
            self.begin()

    def follow(self, scenario: ScenarioSet) -> None:
        """Follow another run; messages of it that have already come are kept."""
        self.scenario = scenario
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
        scenario = self.scenario
        if scenario is None:
            return
        self._receive_objects(scenario)
        while self._waiting:
            step = self._complete(scenario, self._waiting[0])
            if step is None:
                return
            self._waiting.popleft()
            if step.n >= 0:
                yield step

    def _receive_states(self) -> None:
        for message in self._states.waiting():
            course = self._time.follow(stamp_of(message))
            if course is TimeCourse.AHEAD:
                self._ahead.append(message)
                continue
            if self._ahead and course is not TimeCourse.BEHIND:
                # Time has moved on to there only if this message follows those.
                if 0 <= stamp_of(message) - stamp_of(self._ahead[-1]) <= USUAL_NS:
                    self._waiting.extend(self._ahead)
                self._ahead.clear()
            if course is TimeCourse.BACK:
                self._waiting.clear()
                self._objects_by_n.clear()
                self._latest = None
                if self.scenario is not None:
                    self.begin()
            if course is not TimeCourse.BEHIND:
                self._waiting.append(message)

    def _receive_objects(self, scenario: ScenarioSet) -> None:
        scheduler = scenario.game.scheduler
        for message in self._objects.waiting():
            n = scheduler.tick_of_stamp(stamp_of(message))
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
        n = scheduler.step_of_stamp(stamp_of(message))
        nothing = np.empty((3, 0, 4))
        foreign = WorldStep(-1, False, nothing, ObjectStates(nothing[0], nothing[1]))
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
        return WorldStep(n, tick, joints, self._latest)


class ObserverNode(Node, ABC, Generic[Observer]):
    """A node that passes each published state to an observer, a new one for each run."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.endpoints = Endpoints(self)
        self._world = WorldFollower(self.endpoints, '/vehicles/state', self._begin)
        self._observer: Observer | None = None

    @abstractmethod
    def make(self, run: ObservedRun) -> Observer:
        """
        Build the observer of a run.

        :raises CrgameError: if the run cannot be observed; the node then waits for the next one.
        """

    @abstractmethod
    def publish(self, observer: Observer, stamp_ns: int) -> None:
        """
        Publish the findings on a state that has just been observed.

        :param stamp_ns: of the state [ns]
        """

    @property
    def epoch(self) -> int:
        """Return the epoch of the observed run; -1 before the first."""
        return -1 if self._world.scenario is None else self._world.scenario.game.epoch

    def run(self, stop: StopFlag) -> None:
        """Observe until asked to stop."""
        poll(self, stop, PERIOD_S, self._work)

    def _work(self) -> None:
        try:
            self._world.look()
            if self._world.scenario is None:
                self._world.drop()
            for step in self._world.steps():
                self._observe(step)
        except CrgameError as error:
            # Unusable documents, or a map that breaks while it is read.
            self._observer = None
            self.get_logger().error(f'{error}; nothing is checked until the next game')

    def _begin(self) -> None:
        scenario = self._world.scenario
        assert scenario is not None
        game, self._observer = scenario.game, None
        self._observer = self.make(documented_run(
            game, scenario.loaded, scenario.objects,
            None if game.occupancy is None else TiledOccupancy(game.occupancy)))

    def _observe(self, step: WorldStep) -> None:
        if self._observer is None or self._world.scenario is None:
            return
        scheduler = self._world.scenario.game.scheduler
        stamp_ns = self.endpoints.diagnostics.now_ns = scheduler.stamp_ns(step.n)
        self._observer.observe(step.n, scheduler.since_tick_s(step.n), step.states,
                               step.objects if step.tick else None)
        self.publish(self._observer, stamp_ns)
