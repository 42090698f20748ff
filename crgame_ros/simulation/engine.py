# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulation engine that both runners drive (CRG algorithms 1 and 2)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
import hashlib
from itertools import chain
from struct import Struct
from typing import NamedTuple

from crgame_ros.game.events import FiredEvent, PlannerRun, TrafficOrder
from crgame_ros.game.objects import ObjectStates
from crgame_ros.game.task_documents import OpenPrompt, TaskEntry, TaskReport
from crgame_ros.messages.joints import JointSeries
from crgame_ros.planner.plan_check import RoadLimit
from crgame_ros.planner.registry import EXTERNAL
from crgame_ros.simulation.autonomous_vehicle import AutonomousVehicle, RouteLane
from crgame_ros.simulation.av_models import (
    ego_of,
    make_execution,
    make_localisation,
    make_vehicle_model,
    published,
)
from crgame_ros.simulation.plan_indicator import PlanIndicators
from crgame_ros.simulation.plan_requests import PlanRequests
from crgame_ros.simulation.run_events import RunEvents
from crgame_ros.simulation.run_tasks import RunTasks
from crgame_ros.simulation.setup import AvSetup, Setup
from crgame_ros.simulation.stopped_drivers import StoppedDrivers
from crgame_ros.simulation.world import TrafficFeed, World
from crgame_ros.timing.cycle_rows import lights_alone
from crgame_ros.timing.publishing import steps_between_messages
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
from crgame_ros.vehicle.human_vehicle import HumanVehicle, TracedVehicle
from crgame_ros.vehicle.state import STATE_WIDTH, VehicleState
import numpy as np
from numpy.typing import NDArray


class StepResult(NamedTuple):
    """
    The result of one step.

    :param n: simulation step that the state now belongs to.
    :param k: scenario time step that n belongs to.
    :param tick: True if k has just advanced; only then objects and requests are filled in.
    :param requests: the plan requests to send, by AV id.
    :param objects: poses of all objects other than the driven vehicles.
    :param fired: the events that took effect in this step.
    :param agents_k: tick of the agents' states in the objects, less than k if traffic is late;
        None without agents.
    :param tasks: the entries of the game's tasks since the step before.
    """

    n: int
    k: int
    tick: bool
    requests: Mapping[str, JointSeries]
    objects: ObjectStates | None
    fired: tuple[FiredEvent, ...] = ()
    agents_k: int | None = None
    tasks: tuple[TaskEntry, ...] = ()


class Simulation:
    """
    A simulation of humans, AVs and objects on one integer time line.

    State n is the state at n dt. A step consumes plans and commands, moves the humans over the
    measured interval and the AVs along their plans to n + 1, and at each tick of the scenario
    builds the snapshot for the planners' requests.

    :param setup: the run.
    :param clock_offset_ns: simulation time of step 0 [ns]
    :param feed: moves the agents of traffic; None moves them in process.
    :param traces: (N, 8) states by human, from step 0 on, that replace driving.
    """

    def __init__(self, setup: Setup, clock_offset_ns: int = 0, feed: TrafficFeed | None = None,
                 traces: Mapping[str, NDArray[np.float64]] | None = None) -> None:
        self.setup = setup
        self.scheduler = replace(setup.scheduler, clock_offset_ns=clock_offset_ns)
        self.n = 0
        dt_s = self.scheduler.dt_s
        traces = traces or {}
        self.humans = [
            TracedVehicle(traces[human.id]) if human.id in traces else
            HumanVehicle(human.vehicle, human.state, make_vehicle_model(
                human.dynamics, human.vehicle, f'{human.id}: dynamics'))
            for human in setup.humans]
        self.avs = [
            AutonomousVehicle(av, self.scheduler, setup.game.timing,
                              make_execution(av.spec, av.vehicle, dt_s), _road_limit(setup, av))
            for av in setup.avs]
        for av in self.avs:
            if av.execution is not None and setup.network.lanelet_ids:
                av.route_lane = RouteLane(setup.network, av.setup.planning_problem,
                                          av.setup.state, av.setup.transform)
        self._localisations = [
            (av, localisation) for av in self.avs if (localisation := make_localisation(
                av.setup.spec, av.state, setup.game.seed, dt_s)) is not None]
        self._localise_every = steps_between_messages(setup.game.timing.rate)
        self.commands: list[DriverCommand | None] = [
            *[DriverCommand()] * len(self.humans), *[None] * len(self.avs)]
        self._events = RunEvents(setup) if setup.game.events else None
        self._tasks = RunTasks(setup) if setup.game.tasks else None
        self._task_names = {task.name for task in setup.game.tasks}
        self._indicators = PlanIndicators(setup)
        self._world = World(setup, self._events, feed)
        self._requests = PlanRequests(
            setup, None if self._events is None else self._events.obstacles)
        self._driven = (*self.humans, *self.avs)
        self._stopped = StoppedDrivers(setup, self._driven) \
            if setup.game.drivability.contact == 'stop' else None
        self._av_by_id = {av.setup.id: av for av in self.avs}
        self._hash = hashlib.sha256()
        self._packed = Struct(f'{STATE_WIDTH * len(self.commands)}d').pack

    @property
    def objects(self) -> ObjectStates:
        """Return the states of all objects other than the driven vehicles, at the present tick."""
        return self._world.objects

    @property
    def states(self) -> list[VehicleState]:
        """Return the driven vehicles' states at n: humans, then AVs; simulation coordinates."""
        return [driven.state for driven in self._driven]

    @property
    def lights(self) -> list[int]:
        """Return the bits of `Light` of each driven vehicle at n; an AV's follow its plan."""
        planned = chain([0] * len(self.humans), self._indicators.shown)
        return [bits if command is None else command.lights
                for bits, command in zip(planned, self.commands, strict=True)]

    @property
    def taken_off(self) -> int:
        """Return how many agents were removed in process because they blocked each other."""
        return self._world.taken_off

    @property
    def object_lights(self) -> dict[str, int]:
        """Return the bits of `Light` of the present objects with signals, by id."""
        return self._world.lights

    @property
    def command_rows(self) -> list[Sequence[float]]:
        """Return `COMMAND_COLUMNS` of each driven vehicle at n; without driver only lights."""
        return [lights_alone(bits) if command is None else command
                for bits, command in zip(self.lights, self.commands, strict=True)]

    def begin(self) -> StepResult:
        """Return the requests and objects of step 0, before any motion."""
        self._localise()
        self._add_to_hash()
        return self._result()

    def request_perceived(self, av_id: str, request: JointSeries) -> str | None:
        """
        Store the perceived request that an AV's planner receives instead of the true one.

        :return: the reason for refusing a plan that arrived before it, else None.
        """
        return self._av_by_id[av_id].request_perceived(
            request.stamp_ns, ego_of(request), self.n + 1)

    def offer_plan(self, av_id: str, plan: JointSeries) -> str | None:
        """
        Pass a planner's answer to its AV, to be followed from the next step on.

        :return: None if accepted, else the reason for refusing it.
        """
        return self._av_by_id[av_id].offer(plan, self.n + 1)

    def unasked_plan(self, av_id: str, stamp_ns: int) -> str | None:
        """
        Check a planner's answer by its stamp alone, and count it if it is refused.

        :return: None if it answers a request, else the reason for refusing it.
        """
        return self._av_by_id[av_id].refuse_unasked(stamp_ns)

    def count_other_planner(self, av_id: str) -> None:
        """Count an answer of a program that is not the AV's planner."""
        self._av_by_id[av_id].counters.of_others += 1

    def refuse_malformed_plan(self, av_id: str, reason: str) -> None:
        """Count a planner's answer that could not be read."""
        self._av_by_id[av_id].refuse_malformed(reason)

    def set_planner_running(self, av_id: str, running: bool) -> None:
        """Stop or restart an AV's planner; a stopped planner gets no requests."""
        self._av_by_id[av_id].planner_running = running

    def trigger(self, name: str) -> str | None:
        """
        Trigger an event of the game at the next tick, or begin or end a task.

        :return: None if it will, else the reason why not.
        """
        if self._tasks is not None and name in self._task_names:
            return self._tasks.trigger(name)
        if self._events is None:
            return f'there is no event "{name[:40]}"; the game has none'
        return self._events.trigger(name)

    def report_task(self, report: TaskReport) -> str | None:
        """
        Accept a page's report about a task, or its driver's answer, for the next step.

        :return: None if it is accepted, else the reason why not.
        """
        return 'the game has no tasks' if self._tasks is None else self._tasks.report(report)

    @property
    def tasks_running(self) -> tuple[str, ...]:
        """Return the names of the tasks that are running."""
        return () if self._tasks is None else self._tasks.running

    @property
    def prompts(self) -> tuple[OpenPrompt, ...]:
        """Return the stimuli and requests that are neither answered nor over."""
        return () if self._tasks is None else self._tasks.prompts

    @property
    def fired(self) -> tuple[FiredEvent, ...]:
        """Return all events that have taken effect so far."""
        of_game = () if self._events is None else self._events.fired
        own = () if self._stopped is None else self._stopped.events
        return tuple(sorted((*own, *of_game), key=lambda event: event.n))

    def step(self, dt_eff_s: float, commands: Sequence[DriverCommand | None]) -> StepResult:
        """
        Advance from n to n + 1.

        :param dt_eff_s: interval that the humans are integrated over (CRG 13) [s]
        :param commands: one for each human, in their order; then, if a driver has taken over an
            AV, one for each AV, None for one that follows its plan
        """
        self.move(dt_eff_s, commands)
        return self.conclude()

    def move(self, dt_eff_s: float, commands: Sequence[DriverCommand | None]) -> None:
        """
        Move the driven vehicles from n to n + 1, the first half of a step: call `conclude` next.

        Parameters are those of `step`. The new states can be shown to drivers before the planners'
        requests are built, which takes ten times as long.
        """
        before = self.states if self._stopped is not None else []
        self.n += 1
        seats = len(self.humans) + len(self.avs)
        self.commands = [command and command.rounded() for command in commands]
        self.commands += [None] * (seats - len(commands))
        for human, command in zip(self.humans, self.commands, strict=False):
            human.step(command or RELEASED, dt_eff_s)
        for av, command in zip(self.avs, self.commands[len(self.humans):], strict=True):
            if command is None:
                av.advance(self.n)
            else:
                av.drive(command, dt_eff_s)
        if self._stopped is not None:
            self._stopped.act(self.n, before, self.commands, self._world.objects)

    def conclude(self) -> StepResult:
        """Finish the step once the vehicles have moved: estimates, objects, events, requests."""
        self._localise()
        self._indicators.update(self.n, self.avs)
        result = self._result()
        self._add_to_hash()
        own = () if self._stopped is None else self._stopped.events_at(self.n)
        return result._replace(fired=(*own, *result.fired)) if own else result

    def _result(self) -> StepResult:
        k = self.scheduler.k(self.n)
        if not self.scheduler.is_tick(self.n):
            return StepResult(self.n, k, False, {}, None, tasks=self._task_entries())
        for av in self.avs:
            if av.route_lane is not None and not av.driven:
                av.route_lane.measure(av.state)
        objects = self._world.advance(k)
        fired = () if self._events is None else self._apply_events(self._events, k, objects)
        if self._tasks is not None:
            self._tasks.at_tick(self.n, k, self.states, objects, fired)
        objects = self._world.settle(self.states)
        asking = [av for av in self.avs if av.wants_request(self.n)]
        requests: dict[str, JointSeries] = {}
        if asking:
            states = self.states
            forecast = self._requests.forecast(
                k, self.n, states, self.avs, objects, self._world.changed)
            stamp_ns = self.scheduler.stamp_ns(self.n)
            lights, object_lights = self.lights, self.object_lights
            for av in asking:
                request = self._requests.build(av.setup, stamp_ns, states, forecast, lights,
                                               object_lights)
                av.request_sent(self.n, stamp_ns, ego_of(request))
                requests[av.setup.id] = request
        return StepResult(self.n, k, True, requests, objects, fired, self._world.agents_k,
                          self._task_entries())

    def _apply_events(self, events: RunEvents, k: int,
                      objects: ObjectStates) -> tuple[FiredEvent, ...]:
        """Apply events to objects, agents and planners at a tick."""
        for name in () if self._tasks is None else self._tasks.due_events(self.n):
            events.announce(name)
        fired = events.at_tick(self.n, k, self.states, objects)
        for action in events.actions(fired):
            if isinstance(action, PlannerRun):
                self.set_planner_running(action.av, action.run)
            elif isinstance(action, TrafficOrder):
                self._world.obey(action)
        return fired

    def _task_entries(self) -> tuple[TaskEntry, ...]:
        """Advance the tasks, and return their new entries."""
        return () if self._tasks is None else self._tasks.at_step(self.n, dict(zip(
            self.setup.vehicle_ids, (command is not None for command in self.commands),
            strict=True)))

    def _localise(self) -> None:
        """Update the pose estimates of AVs that steer by them."""
        if self.n % self._localise_every == 0:
            for av, localisation in self._localisations:
                localisation.step(self.n, published(av.state))
                av.believed = localisation.estimate

    def _add_to_hash(self) -> None:
        # Traffic alone has only the states of its objects.
        states = self.states
        self._hash.update(self._packed(*chain.from_iterable(states)) if states else
                          np.array(self.objects.poses, dtype=np.float64).tobytes())

    def state_hash(self) -> str:
        """Return the SHA-256 over every driven vehicle's state at every step, or all objects'."""
        return self._hash.hexdigest()


def _road_limit(setup: Setup, av: AvSetup) -> RoadLimit | None:
    """Build the road limit of an external planner; other planners' adapters have their own."""
    if av.spec.planner != EXTERNAL or not setup.game.drivability.road \
            or not setup.network.lanelet_ids:
        return None
    limit = RoadLimit(setup.road, av.vehicle)
    limit.rehearse(av.declared)
    return limit
