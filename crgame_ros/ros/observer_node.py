# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A base class of nodes that observe a run and publish their findings."""

from abc import ABC, abstractmethod
from typing import Generic, TypeVar

from crgame_ros.errors import CrgameError
from crgame_ros.occupancy.tiles import TiledOccupancy
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.node_main import StopFlag
from crgame_ros.ros.scenario_documents import ScenarioDocuments, ScenarioSet
from crgame_ros.ros.spinning import poll
from crgame_ros.ros.world_follower import WorldFollower, WorldStep
from crgame_ros.simulation.observer import documented_run, ObservedRun, RunObserver
from rclpy.node import Node

PERIOD_S = 0.005

Observer = TypeVar('Observer', bound=RunObserver)


class ObserverNode(Node, ABC, Generic[Observer]):
    """
    A node that passes each published state to an observer, a new one for each run.

    :param name: of the node.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.endpoints = Endpoints(self)
        self._documents = ScenarioDocuments(self.endpoints)
        self._world = WorldFollower(self.endpoints, '/vehicles/state', self._begin_anew)
        self._scenario: ScenarioSet | None = None
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
        return -1 if self._scenario is None else self._scenario.game.epoch

    def run(self, stop: StopFlag) -> None:
        """Observe until asked to stop."""
        poll(self, stop, PERIOD_S, self._work)

    def _work(self) -> None:
        try:
            scenario = self._documents.poll()
            if scenario is not None:
                self._begin(scenario)
            if self._scenario is None:
                self._world.drop()
            for step in self._world.steps():
                self._observe(step)
        except CrgameError as error:
            # Unusable documents, or a map that breaks while it is read.
            self._observer = None
            self.get_logger().error(f'{error}; nothing is checked until the next game')

    def _begin(self, scenario: ScenarioSet) -> None:
        self._scenario, self._observer = scenario, None
        self._world.begin(scenario)
        game = scenario.game
        self._observer = self.make(documented_run(
            game, scenario.loaded, scenario.objects,
            None if game.occupancy is None else TiledOccupancy(game.occupancy)))

    def _begin_anew(self) -> None:
        """Observe the same run from its start, because a recording is played again."""
        if self._scenario is not None:
            self._begin(self._scenario)

    def _observe(self, step: WorldStep) -> None:
        if self._observer is None or self._scenario is None:
            return
        scheduler = self._scenario.game.scheduler
        stamp_ns = self.endpoints.diagnostics.now_ns = scheduler.stamp_ns(step.n)
        self._observer.observe(step.n, scheduler.since_tick_s(step.n), step.states,
                               step.objects if step.tick else None)
        self.publish(self._observer, stamp_ns)
