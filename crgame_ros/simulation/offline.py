# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The offline runner: the same engine on a virtual clock, planners in lockstep."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from crgame_ros.control.tracked_execution import TrackingErrors
from crgame_ros.drivability.monitor import VehicleDrivability
from crgame_ros.driver.source import DriverSource, IdleDriver, parse_source, ScriptedDriver
from crgame_ros.errors import InputError
from crgame_ros.game.events import FiredEvent
from crgame_ros.game.task_documents import TaskEntry
from crgame_ros.messages.joints import JointSeries, plan_to_joints
from crgame_ros.messages.status_values import Status
from crgame_ros.perception.perception import Perception
from crgame_ros.planner.adapter import PlannerStatistics
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.manager import FailureLines, planner_status, PlannerManager
from crgame_ros.planner.request_reader import RequestReader
from crgame_ros.simulation.autonomous_vehicle import AvCounters
from crgame_ros.simulation.av_models import published, published_states
from crgame_ros.simulation.engine import Simulation, StepResult
from crgame_ros.simulation.observer import drivability_monitor, ObservedRun, RunObserver
from crgame_ros.simulation.plan_requests import request_topic
from crgame_ros.simulation.run_messages import MessageLog, refusal_status, RunMessage
from crgame_ros.simulation.setup import Setup
from crgame_ros.timing.publishing import steps_between_messages
from crgame_ros.vehicle.driver_command import COMMAND_WIDTH
from crgame_ros.vehicle.state import STATE_WIDTH
import numpy as np
from numpy.typing import NDArray


def offline_driver(setup: Setup, index: int) -> DriverSource:
    """
    Build the driver that a game names for a human.

    :param index: of the human.
    :raises InputError: if it needs a person, a device or a recording that is not available.
    """
    human = setup.humans[index]
    source = parse_source(human.driver)
    if human.timeline:
        return ScriptedDriver.from_text(human.timeline, f'{human.id}: {human.driver}')
    if source.kind in ('idle', 'auto'):
        return IdleDriver()
    if source.kind == 'policy':
        # Few games have a policy driver; the others should not wait for its imports.
        from crgame_ros.policy.driver import DrivenSeat, PolicyDriver
        from crgame_ros.policy.policy_file import load_policy
        return PolicyDriver(load_policy(source.argument, human.id), DrivenSeat(
            index, setup.vehicle_descriptions, setup.obstacles.descriptions,
            setup.loaded.scenario, human.vehicle, human.state,
            setup.road_transforms[index], setup.scheduler.steps_per_tick))
    raise InputError(f'driver "{human.driver}" needs a person or a device', human.id,
                     'offline, use keys:FILE, joy:FILE, policy:FILE.py:load, replay:BAG or idle')


DEFAULT_DURATION_S = 20.0


@dataclass(frozen=True)
class PlannerRecord:
    """
    The results of an AV's planner.

    :param counters: requests and plans as the engine saw them.
    :param statistics: answers, braking plans and times of the planner itself.
    :param tracking: worst errors of a tracked AV against its plans; None if it follows them
        exactly.
    :param lane_error: largest distance of a tracked AV from its route's lane [m]
    """

    counters: AvCounters
    statistics: PlannerStatistics
    tracking: TrackingErrors | None = None
    lane_error: float | None = None

    @property
    def accepted_ratio(self) -> float:
        """Return the share of the planner's answers that were accepted and not a fallback."""
        good = self.counters.accepted - self.statistics.fallbacks
        return max(0, good) / max(1, self.statistics.plans)


@dataclass(frozen=True)
class OfflineResult:
    """
    A finished offline run.

    :param setup: the run.
    :param state_hash: SHA-256 over all states; equal for equal inputs.
    :param vehicle_states: (n + 1, V, 8) states of humans, then AVs, at every step.
    :param object_poses: (ticks, M, 3) centre poses at every tick.
    :param object_velocities: (ticks, M, 3) their derivatives.
    :param commands: (n + 1, V, 6) throttle, brake, steering, reverse, lights and put_back that the
        step to each state consumed; row 0 is NaN, and so are those of AVs, except for the lights,
        while no driver had taken them over.
    :param intervals_s: (n + 1, V) interval over which each vehicle was moved in that step: Delta
        t_eff if a driver has it, else the nominal step [s]
    :param planners: the results of each AV's planner.
    :param violations: changes of the vehicles' drivability, in order.
    :param fired: events that took effect, in order.
    :param stop: the human's violation that ended the run, if the game stops at violations; its n
        is that of the last state.
    :param tasks: the entries of the game's tasks, in order.
    :param taken_off: number of agents that were removed because they blocked each other.
    :param messages: what planners were asked and have answered, statuses and signals, in order;
        None unless the run was told to keep them.
    """

    setup: Setup
    state_hash: str
    vehicle_states: NDArray[np.float64]
    object_poses: NDArray[np.float64]
    object_velocities: NDArray[np.float64]
    commands: NDArray[np.float64]
    intervals_s: NDArray[np.float64]
    planners: Mapping[str, PlannerRecord]
    violations: tuple[VehicleDrivability, ...] = ()
    fired: tuple[FiredEvent, ...] = ()
    stop: VehicleDrivability | None = None
    tasks: tuple[TaskEntry, ...] = ()
    taken_off: int = 0
    messages: tuple[RunMessage, ...] | None = None

    def states_of(self, vehicle_id: str) -> NDArray[np.float64]:
        """Return the states (n + 1, 8) of one driven vehicle."""
        return self.vehicle_states[:, self.setup.vehicle_ids.index(vehicle_id)]


def perception_of(setup: Setup, index: int) -> Perception | None:
    """Return the perception of an AV as it begins in a run; None if the game gives it none."""
    av = setup.avs[index]
    if av.spec.perception is None:
        return None
    return Perception(
        av.id, av.spec.perception, setup.descriptions, av.vehicle, av.transform,
        published(av.state), setup.game.seed, setup.scheduler.dt_s, setup.open_occupancy())


class PlannerSeat:
    """One AV's planner in process, answering a stated number of steps late."""

    def __init__(self, setup: Setup, av_index: int, simulation: Simulation, latency_steps: int,
                 clock_s: Callable[[], float] | None,
                 say: Callable[[str], object] = lambda _: None,
                 log: MessageLog | None = None) -> None:
        av = setup.avs[av_index]
        self.id = av.id
        self._request_topic = request_topic(av).replace('<av>', av.id)
        self._log = log
        self._latency = latency_steps
        self._simulation = simulation
        # Plans with their steps, and with what their planner tells then.
        self._due: list[tuple[int, JointSeries, Status | None]] = []
        objects = {item.id: item for item in setup.descriptions}
        self._reader = RequestReader(av.id, objects, simulation.scheduler)
        context = PlannerContext(
            av.id, setup.loaded.scenario, av.planning_problem, av.vehicle, objects,
            setup.scheduler.time_step_s, setup.scheduler.k0, setup.game.seed,
            setup.game.drivability.road)
        self.manager = PlannerManager(
            context, av.spec.planner, av.spec.options, setup.game.events, clock_s)
        self._failures = FailureLines(av.id, say, setup.scheduler.time_step_s)
        self._failures.note(self.manager)
        self.perception = perception_of(setup, av_index)

    def proceed(self, result: StepResult) -> None:
        """Process the result of a step, and deliver the due answers."""
        self.manager.apply([event.name for event in result.fired])
        if self.id in result.requests:
            self.ask(result.requests[self.id])
        self.deliver()

    def ask(self, request: JointSeries) -> None:
        """Plan now; the answer is due after the latency (immediately for the first request)."""
        if self._log is not None:
            self._log.add(self._request_topic, request)
        if self.perception is not None:
            request = self.perception.perceive(request)
            self._simulation.request_perceived(self.id, request)
            if self._log is not None:
                self._log.add(f'/{self.id}/plan_request', request)
        read = self._reader.read(request)
        plan = self.manager.plan(read)
        self._failures.note(self.manager)
        series = plan_to_joints(plan, self.id, self._simulation.scheduler.time_step_ns)
        status = None if self._log is None else planner_status(
            self.id, read.k, plan, self.manager)
        n = self._simulation.n
        self._due.append((n + (self._latency if n else 0), series, status))

    def deliver(self) -> None:
        """Deliver the answers that are due before the next step."""
        while self._due and self._due[0][0] <= self._simulation.n:
            _, series, status = self._due.pop(0)
            reason = self._simulation.offer_plan(self.id, series)
            self._failures.refuse(reason)
            if self._log is not None:
                self._log.add(f'/{self.id}/plan', series)
                self._log.add_status(status)
                if reason is not None:
                    self._log.add_status(refusal_status(self.id, reason, self._simulation.n))

    def record(self) -> PlannerRecord:
        """Return the results of the planner."""
        av = next(av for av in self._simulation.avs if av.setup.id == self.id)
        return PlannerRecord(av.counters, self.manager.statistics,
                             None if av.execution is None else av.execution.worst,
                             None if av.route_lane is None else av.route_lane.worst)


def run_offline(
    setup: Setup, *, duration_s: float | None = None, latency_steps: int = 0,
    drivers: Mapping[str, DriverSource] | None = None,
    intervals_s: NDArray[np.float64] | None = None, check_drivability: bool = True,
    clock_s: Callable[[], float] | None = None, triggers: Sequence[tuple[int, str]] = (),
    observers: Sequence[RunObserver] = (),
    traces: Mapping[str, NDArray[np.float64]] | None = None,
    say: Callable[[str], object] = lambda _: None,
    progress: Callable[[float], object] = lambda _: None, keep_messages: bool = False,
) -> OfflineResult:
    """
    Run a game as fast as possible.

    :param duration_s: simulated time; None uses the game's own [s]
    :param latency_steps: simulation steps between a request and its plan.
    :param drivers: drivers by vehicle id; a human's replaces the game's own, an AV's takes over.
    :param intervals_s: Delta t_eff of each step, as recorded; the nominal step if None and beyond
        their end [s]
    :param check_drivability: run the monitor in lockstep; a game that stops at violations always
        runs it.
    :param clock_s: clock that times the planners; the result does not depend on it.
    :param triggers: simulation step n and name of each event triggered by hand; it takes effect at
        the first tick from n on.
    :param observers: receive every state that a live run publishes.
    :param traces: (N, 8) states by human, from step 0 on, that replace driving.
    :param say: called with each text about a planner or a policy that fails.
    :param progress: called with the share of the run that is done, 0 to 1, at each step.
    :param keep_messages: keep `OfflineResult.messages`, which a recording of the run needs.
    :raises InputError: if a human's driver needs a person or a device, or a trigger is refused.
    """
    simulation = Simulation(setup, traces=traces)
    steps = simulation.scheduler.steps_for(_duration(setup, duration_s))
    drivers = drivers or {}
    hands = [drivers.get(human.id) or offline_driver(setup, index)
             for index, human in enumerate(setup.humans)]
    well = list(hands)
    takers = [drivers.get(av.id) for av in setup.avs]
    log = MessageLog(simulation) if keep_messages else None
    seats = [PlannerSeat(setup, index, simulation, latency_steps, clock_s, say, log)
             for index in range(len(setup.avs))]
    trace = _Trace(setup, steps, check_drivability, observers)
    dt_s = simulation.scheduler.dt_s
    effective_s, intervals = dt_s, [] if intervals_s is None else intervals_s.tolist()
    _trigger(simulation, triggers, 0)
    result = simulation.begin()
    perceiving = [seat.perception for seat in seats if seat.perception is not None]
    perceive_every = steps_between_messages(setup.game.timing.rate)
    for _ in range(steps):
        if perceiving and simulation.n % perceive_every == 0:
            perceive(simulation, perceiving)
        for seat in seats:
            seat.proceed(result)
        if log is not None:
            log.add_step(result)
        trace.add(simulation, result, effective_s)
        if trace.stop is not None:
            break
        n = simulation.n
        show(simulation, result, hands)
        for hand in [each for each in well if each.problem is not None]:
            say(str(hand.problem))
            well.remove(hand)
        commands = [
            *(hand.command(n, dt_s) for hand in hands),
            *(taker.command(n, dt_s) if taker is not None and taker.drives(n) else None
              for taker in takers)]
        effective_s = intervals[simulation.n] if simulation.n < len(intervals) else dt_s
        _trigger(simulation, triggers, simulation.n + 1)
        result = simulation.step(effective_s, commands)
        progress(simulation.n / steps)
    else:
        if log is not None:
            log.add_step(result)
        trace.add(simulation, result, effective_s)
    return trace.result(simulation, {seat.id: seat.record() for seat in seats}, log)


def observed_run(setup: Setup) -> ObservedRun:
    """Return the observers' facts about a run before it begins."""
    return ObservedRun(
        setup.vehicle_descriptions, setup.obstacles.descriptions, setup.loaded, setup.scheduler,
        setup.game.drivability, setup.open_occupancy(), tuple(av.transform for av in setup.avs),
        np.reshape([vehicle.state for vehicle in setup.vehicles], (-1, STATE_WIDTH)),
        (*[None] * len(setup.humans), *(av.planning_problem for av in setup.avs)))


def perceive(simulation: Simulation, perceiving: Sequence[Perception]) -> None:
    """Update every perception with the published part of the present state."""
    states, objects = published_states(simulation.states), simulation.objects
    since_tick_s = simulation.scheduler.since_tick_s(simulation.n)
    for perception in perceiving:
        perception.observe(simulation.n, states, objects.poses, objects.velocities, since_tick_s)


def show(simulation: Simulation, result: StepResult, hands: Sequence[DriverSource]) -> None:
    """Show drivers the present vehicle states, and at a tick all objects too."""
    looking = [hand for hand in hands if type(hand).see is not DriverSource.see]
    if looking:
        states = np.reshape(simulation.states, (-1, STATE_WIDTH))
        for hand in looking:
            hand.see(simulation.n, states, result.objects)


def _trigger(simulation: Simulation, triggers: Sequence[tuple[int, str]], n: int) -> None:
    """Trigger the events that are due before state n is computed."""
    for due, name in triggers:
        if due == n and (reason := simulation.trigger(name)) is not None:
            raise InputError(reason, f'trigger at step {n}', 'see "events" of the game')


def _duration(setup: Setup, duration_s: float | None) -> float:
    chosen = setup.game.duration if duration_s is None else duration_s
    if chosen == float('inf'):
        return DEFAULT_DURATION_S
    if not chosen > 0.0:
        raise InputError(f'is {chosen} s', 'duration', 'give a positive number of seconds')
    return chosen


class _Trace:
    """Collects a run's states and violations."""

    def __init__(self, setup: Setup, steps: int, check: bool,
                 observers: Sequence[RunObserver]) -> None:
        self.vehicles = np.empty((steps + 1, len(setup.vehicle_ids), STATE_WIDTH))
        # By step; one conversion at the end takes less time than one for each step.
        self._commands: list[list[Sequence[float]]] = []
        self.intervals_s = np.full((steps + 1, len(setup.vehicle_ids)), setup.scheduler.dt_s)
        self.objects: list[NDArray[np.float64]] = []
        self.tasks: list[TaskEntry] = []
        self.object_velocities: list[NDArray[np.float64]] = []
        # A live run publishes the states of these steps, so its observers see them.
        self._observe_every = steps_between_messages(setup.game.timing.rate)
        self._drivability = drivability_monitor(observed_run(setup)) \
            if check or setup.game.drivability.stop else None
        self._observers = [*([] if self._drivability is None else [self._drivability]), *observers]

    @property
    def stop(self) -> VehicleDrivability | None:
        """Return the violation that ends the run, once there is one."""
        return None if self._drivability is None else self._drivability.stop

    def result(self, simulation: Simulation, planners: Mapping[str, PlannerRecord],
               log: MessageLog | None) -> OfflineResult:
        count = simulation.n + 1
        if log is not None:
            log.add_plans()
        commands = np.array(self._commands, dtype=np.float64).reshape(
            count, -1, COMMAND_WIDTH)
        commands[0] = np.nan
        return OfflineResult(
            simulation.setup, simulation.state_hash(), self.vehicles[:count],
            np.array(self.objects), np.array(self.object_velocities), commands,
            self.intervals_s[:count], planners,
            () if self._drivability is None else self._drivability.report(), simulation.fired,
            self.stop, tuple(self.tasks), simulation.taken_off,
            None if log is None else tuple(log.messages))

    def add(self, simulation: Simulation, result: StepResult, effective_s: float) -> None:
        """Add a state, and the interval of the step that led to it [s]."""
        n = simulation.n
        self.tasks += result.tasks
        for index, command in enumerate(simulation.commands):
            if command is not None:
                self.intervals_s[n, index] = effective_s
        if states := simulation.states:
            self.vehicles[n] = states
        self._commands.append(simulation.command_rows)
        if result.objects is not None:
            self.objects.append(result.objects.poses)
            self.object_velocities.append(result.objects.velocities)
        if result.tick or n % self._observe_every == 0:
            since_tick_s = simulation.scheduler.since_tick_s(n)
            for observer in self._observers:
                observer.observe(n, since_tick_s, self.vehicles[n], result.objects)
