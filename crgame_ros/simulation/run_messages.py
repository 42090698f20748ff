# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The messages of an offline run besides its states: what a live run's nodes would have sent."""

from typing import NamedTuple

from crgame_ros.game.task_documents import TASK_STATE, TaskState
from crgame_ros.messages.joints import JointSeries
from crgame_ros.messages.status_values import Status
from crgame_ros.simulation.engine import Simulation, StepResult
from crgame_ros.simulation.plan_status import plans_status
from crgame_ros.simulation.run_texts import SignalTexts
from crgame_ros.timing.publishing import steps_between_messages


class RunMessage(NamedTuple):
    """
    A message of a run.

    :param n: simulation step at which it was sent.
    :param topic: its topic in the run.
    :param content: of a trajectory, a status or a text.
    """

    n: int
    topic: str
    content: JointSeries | Status | str


class MessageLog:
    """
    Keeps requests, plans, statuses, signals and the state of tasks, in the order of the run.

    Requests with predictions are most of it: 0.1 MB for 50 objects over 3 s.

    :param simulation: the run.
    :ivar messages: so far.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._signals = SignalTexts(simulation.setup)
        self._every = steps_between_messages(simulation.setup.game.timing.rate)
        self._second = max(1, round(1.0 / simulation.scheduler.dt_s))
        self.messages: list[RunMessage] = []

    def add(self, topic: str, content: JointSeries | Status | str) -> None:
        """Keep a message that is sent at the present step."""
        self.messages.append(RunMessage(self._simulation.n, topic, content))

    def add_status(self, status: Status | None) -> None:
        """Keep a status, if there is one."""
        if status is not None:
            self.add('/diagnostics', status)

    def add_step(self, result: StepResult) -> None:
        """Keep what the simulation itself tells at a step, once its plans have been offered."""
        simulation = self._simulation
        if result.tasks:
            self.add(TASK_STATE.topic, TASK_STATE.write(TaskState(
                0, simulation.tasks_running, simulation.prompts)))
        if result.tick:
            self._add_text('/scenario/signals', self._signals.of_scenario(
                result.k, simulation.object_lights))
        if result.tick or result.n % self._every == 0:
            self._add_text('/vehicles/signals', self._signals.of_vehicles(
                result.n, simulation.lights))
        if result.n and result.n % self._second == 0:
            self.add_plans()

    def add_plans(self) -> None:
        """Keep the counts of all AVs, as a live run tells them every second and at its end."""
        for av in self._simulation.avs:
            self.add_status(plans_status(av, self._simulation.n, self._simulation.scheduler.dt_s))

    def _add_text(self, topic: str, text: str | None) -> None:
        if text is not None:
            self.add(topic, text)
