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
from crgame_ros.planner.registry import EXTERNAL
from crgame_ros.planner.road_limit import RoadLimit
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
from crgame_ros.vehicle.human_vehicle import HumanVehicle
from crgame_ros.vehicle.state import STATE_WIDTH, VehicleState
from crgame_ros.vehicle.traced_vehicle import TracedVehicle
import numpy as np
from numpy.typing import NDArray


class StepResult(NamedTuple):
    """
    What one step brought about.

    :param n: simulation step that the state now belongs to.
    :param k: scenario time step that n belongs to.
    :param tick: True where k has just advanced; only then are objects and requests given.
    :param requests: the plan requests to send, by AV id.
    :param objects: poses of everything that is no driven vehicle.
    :param fired: the events that took effect in this step.
    :param agents_k: tick whose agents the objects show, less than k if traffic is late; None
        without agents.
    :param tasks: what has happened in the game's tasks since the step before.
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
    Humans, AVs and objects on one integer time line.

    State n is the state at n dt. A step consumes plans and commands, moves the humans over the
    measured interval and the AVs along their plans to n + 1, and at each tick of the scenario
    takes the snapshot that the planners are asked with.

    :param setup: the run.
    :param clock_offset_ns: simulation time of step 0 [ns]
    :param feed: moves the agents of traffic; None moves them in process.
    :param traces: (N, 8) states by human, from step 0 on, who takes these instead of being driven.
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
        """States of everything that is no driven vehicle, at the present tick."""
        return self._world.objects

    @property
    def states(self) -> list[VehicleState]:
        """States of the driven vehicles at n: humans, then AVs; simulation coordinates."""
        return [driven.state for driven in self._driven]

    @property
    def lights(self) -> list[int]:
        """Bits of `Light` that each driven vehicle shows at n; an AV by itself as it plans."""
        planned = chain([0] * len(self.humans), self._indicators.shown)
        return [bits if command is None else command.lights
                for bits, command in zip(planned, self.commands, strict=True)]

    @property
    def command_rows(self) -> list[Sequence[float]]:
        """`COMMAND_COLUMNS` of each driven vehicle at n; lights alone where nobody drives."""
        return [lights_alone(bits) if command is None else command
                for bits, command in zip(self.lights, self.commands, strict=True)]

    def begin(self) -> StepResult:
        """Return the requests and objects of step 0, before anything has moved."""
        self._localise()
        self._add_to_hash()
        return self._result()

    def request_perceived(self, av_id: str, request: JointSeries) -> str | None:
        """
        Take what an AV's planner is told instead of the true request.

        :return: the reason for refusing a plan that has come before it, else None.
        """
        return self._av_by_id[av_id].request_perceived(
            request.stamp_ns, ego_of(request), self.n + 1)

    def offer_plan(self, av_id: str, plan: JointSeries) -> str | None:
        """
        Hand a planner's answer to its AV, to be followed from the next step on.

        :return: None if accepted, else the reason for refusing it.
        """
        return self._av_by_id[av_id].offer(plan, self.n + 1)

    def unasked_plan(self, av_id: str, stamp_ns: int) -> str | None:
        """
        Look at a planner's answer by its stamp alone, and count it if it is refused.

        :return: None if it answers a request, else the reason for refusing it.
        """
        return self._av_by_id[av_id].refuse_unasked(stamp_ns)

    def refuse_malformed_plan(self, av_id: str, reason: str) -> None:
        """Count a planner's answer that could not be read."""
        self._av_by_id[av_id].refuse_malformed(reason)

    def set_planner_running(self, av_id: str, running: bool) -> None:
        """Stop an AV's planner, which is then asked for no plan, or let it go on."""
        self._av_by_id[av_id].planner_running = running

    def trigger(self, name: str) -> str | None:
        """
        Let an event of the game take effect at the next tick, or a task begin or end.

        :return: None if it will, else the reason why not.
        """
        if self._tasks is not None and name in self._task_names:
            return self._tasks.trigger(name)
        if self._events is None:
            return f'there is no event "{name[:40]}"; the game has none'
        return self._events.trigger(name)

    def report_task(self, report: TaskReport) -> str | None:
        """
        Take what a page has shown of a task or its driver answered, at the next step.

        :return: None if it is taken, else the reason why not.
        """
        return 'the game has no tasks' if self._tasks is None else self._tasks.report(report)

    @property
    def tasks_running(self) -> tuple[str, ...]:
        """Names of the tasks that last now."""
        return () if self._tasks is None else self._tasks.running

    @property
    def prompts(self) -> tuple[OpenPrompt, ...]:
        """Stimuli and requests that are neither answered nor over."""
        return () if self._tasks is None else self._tasks.prompts

    @property
    def fired(self) -> tuple[FiredEvent, ...]:
        """All events that have taken effect so far."""
        of_game = () if self._events is None else self._events.fired
        own = () if self._stopped is None else self._stopped.events
        return tuple(sorted((*own, *of_game), key=lambda event: event.n))

    def step(self, dt_eff_s: float, commands: Sequence[DriverCommand | None]) -> StepResult:
        """
        Advance from n to n + 1.

        :param dt_eff_s: interval that the humans are integrated over (CRG 13) [s]
        :param commands: one for each human, in their order; then, if anybody has taken an AV over,
            one for each AV, None for one that follows its plan
        """
        self.move(dt_eff_s, commands)
        return self.conclude()

    def move(self, dt_eff_s: float, commands: Sequence[DriverCommand | None]) -> None:
        """
        Move the driven vehicles from n to n + 1, which is half of a step: `conclude` is to follow.

        Parameters are those of `step`. Whoever drives can be shown what became of it before
        planners' requests are made, which takes ten times as long.
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
        """Do what is due once the vehicles have moved: estimates, objects, events, requests."""
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
            for av in asking:
                request = self._requests.build(av.setup, stamp_ns, states, forecast, self.lights)
                av.request_sent(self.n, stamp_ns, ego_of(request))
                requests[av.setup.id] = request
        return StepResult(self.n, k, True, requests, objects, fired, self._world.agents_k,
                          self._task_entries())

    def _apply_events(self, events: RunEvents, k: int,
                      objects: ObjectStates) -> tuple[FiredEvent, ...]:
        """Let events change what is there and who plans, at a tick."""
        for name in () if self._tasks is None else self._tasks.due_events(self.n):
            # It may have taken effect before.
            events.trigger(name)
        fired = events.at_tick(self.n, k, self.states, objects)
        for action in events.actions(fired):
            if isinstance(action, PlannerRun):
                self.set_planner_running(action.av, action.run)
            elif isinstance(action, TrafficOrder):
                self._world.obey(action)
        return fired

    def _task_entries(self) -> tuple[TaskEntry, ...]:
        """Let the tasks go on, and tell what has happened in them."""
        return () if self._tasks is None else self._tasks.at_step(self.n, dict(zip(
            self.setup.vehicle_ids, (command is not None for command in self.commands),
            strict=True)))

    def _localise(self) -> None:
        """Let AVs estimate the pose that they steer by."""
        if self.n % self._localise_every == 0:
            for av, localisation in self._localisations:
                localisation.step(self.n, published(av.state))
                av.believed = localisation.estimate

    def _add_to_hash(self) -> None:
        # Of traffic alone there is nothing but where it is.
        states = self.states
        self._hash.update(self._packed(*chain.from_iterable(states)) if states else
                          np.array(self.objects.poses, dtype=np.float64).tobytes())

    def state_hash(self) -> str:
        """Return the SHA-256 over every driven vehicle's state at every step, or all objects'."""
        return self._hash.hexdigest()


def _road_limit(setup: Setup, av: AvSetup) -> RoadLimit | None:
    """Make what holds an external planner to the road; others' adapters do that themselves."""
    if av.spec.planner != EXTERNAL or not setup.game.drivability.road \
            or not setup.network.lanelet_ids:
        return None
    limit = RoadLimit(setup.road, av.vehicle)
    limit.rehearse(av.declared)
    return limit
