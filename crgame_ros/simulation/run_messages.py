# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The messages of an offline run besides its states, and the statuses of both runners."""

from typing import NamedTuple

from crgame_ros.game.task_documents import TASK_STATE, TaskState
from crgame_ros.messages.joints import JointSeries
from crgame_ros.messages.status_values import ERROR, OK, Status, WARN
from crgame_ros.simulation.autonomous_vehicle import AutonomousVehicle, PLAN_COUNTS
from crgame_ros.simulation.engine import Simulation, StepResult
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


def plans_status(av: AutonomousVehicle, n: int, dt_s: float) -> Status:
    """
    Return the status `sim_node: <av> plans`: its counts, and how well a tracked AV follows.

    :param n: the present step.
    :param dt_s: nominal step [s]
    """
    counters, age, stale = av.counters, av.plan_age_steps(n), av.uses_no_plan
    return Status.of(
        f'sim_node: {av.setup.id} plans', ERROR if stale else OK,
        'no plan: braking' if stale else 'following its plan',
        {'planner': av.setup.spec.planner, 'running': av.planner_running,
         **{name: getattr(counters, name) for name in PLAN_COUNTS},
         'latency_ms': round(counters.last_latency_steps * dt_s * 1e3, 3),
         'age_ms': '' if age is None else round(age * dt_s * 1e3, 3),
         'last_refusal': counters.last_refusal, **_tracking(av)})


def refusal_status(av: str, reason: str, n: int) -> Status:
    """Return the status that tells why a plan of an AV was refused at step n."""
    return Status.of(f'sim_node: {av} plan refused', WARN, reason, {'n': n})


def stop_status(vehicle: str, violation_n: int | str, stop_n: int) -> Status:
    """Return the status of the end of a run by a vehicle's violation, at their steps."""
    return Status.of('sim_node: stop', ERROR, f'{vehicle} violates drivability',
                     {'violation_n': violation_n, 'stop_n': stop_n})


def stop_reason(vehicle: str) -> str:
    """Return the reason of such an end, as on `/sim/state`."""
    return f'drivability of {vehicle}'


def _tracking(av: AutonomousVehicle) -> dict[str, object]:
    """Return the present and largest deviations of a tracked AV from its route's lane and plan."""
    execution = av.execution
    if execution is None:
        return {}
    values: dict[str, object] = {}
    lane = av.route_lane
    if lane is not None:
        values['lane_error'] = '' if lane.error is None else round(lane.error, 4)
        values['worst_lane_error'] = round(lane.worst, 4)
    for when, errors in (('', execution.errors), ('worst_', execution.worst)):
        for name in ('lateral', 'along', 'heading', 'speed'):
            value = '' if errors is None else round(getattr(errors, name), 4)
            values[f'{when}{name}_error'] = value
    return values
