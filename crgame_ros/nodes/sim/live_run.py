# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One epoch of a live run: from the request of k0 to the end, a reset or a stop."""

from collections.abc import Callable
from dataclasses import replace
import gc
import time
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError
from crgame_ros.nodes.sim.control import SimControl
from crgame_ros.nodes.sim.inputs import SimInputs
from crgame_ros.nodes.sim.live_diagnostics import LiveDiagnostics
from crgame_ros.nodes.sim.outputs import SimOutputs
from crgame_ros.nodes.sim.remote_traffic import RemoteTraffic
from crgame_ros.nodes.sim.run_state import Outcome, RunState
from crgame_ros.nodes.sim.start_gate import ReadyGate, StartGate
from crgame_ros.nodes.sim.step_watch import StepWatch
from crgame_ros.planner.manager import FailureLines
from crgame_ros.ros.diagnostics import complain
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.heard_topics import HeardTopics
from crgame_ros.ros.node_main import StopFlag
from crgame_ros.ros.seats import SeatSpells
from crgame_ros.ros.spinning import serve
from crgame_ros.simulation.autonomous_vehicle import BUSY_TIMEOUT_S
from crgame_ros.simulation.engine import Simulation, StepResult
from crgame_ros.simulation.run_messages import stop_reason, stop_status
from crgame_ros.simulation.setup import Setup
from crgame_ros.timing.late_step import Phase
from crgame_ros.timing.time_controller import TimeController
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

if TYPE_CHECKING:  # Recordings are read in few runs, by code that takes time to load.
    from crgame_ros.recording.recorded_game import RecordedInputs

NS_PER_S = 1_000_000_000
# How often the executor looks for service calls [Hz], and the least time left for it [ns].
SERVICE_RATE = 20.0
SERVICE_SLACK_NS = 1_500_000
# The scheduler wakes a sleeping thread at least this late [ns]; the rest of the wait is busy.
WAKE_UP_NS = 120_000
# Time to read a driver's command [ns]; where steps are long, it is read before they are due.
READ_NS, LONG_STEP_S = 100_000, 5e-3


class Pacer:
    """
    The pacer of the loop: it waits for each cycle on the steady clock and serves orders meanwhile.

    :param serve: runs a waiting service.
    :param dt_s: nominal step [s]
    :param longest: cycles after which orders are served even if no time is left for them.
    """

    def __init__(self, serve: Callable[[], object], controller: TimeController,
                 dt_s: float, longest: int) -> None:
        self._serve = serve
        self._controller = controller
        # At high rates half a step must be enough, or no service could stop the run.
        self._slack_ns = min(SERVICE_SLACK_NS, 0.5 * dt_s * NS_PER_S)
        self._every = max(1, round(1.0 / dt_s / SERVICE_RATE))
        self._longest = longest
        self._unserved = 0
        self._awake_ns = WAKE_UP_NS + (READ_NS if dt_s >= LONG_STEP_S else 0)
        # Due time of the present cycle, and the start of the wait for it, steady clock [ns].
        self.due_ns = 0
        self.idle_from_ns = 0

    def wait(self, n: int, watch: StepWatch, read: Callable[[int], None]) -> None:
        """
        Serve orders now and then, and wait until the cycle after step n is due (CRG 11).

        :param watch: gets the phases of the cycle.
        :param read: called with the time [ns] shortly before, to read the messages that have come.
        """
        self.due_ns = self._controller.deadline_ns()
        self.idle_from_ns = time.monotonic_ns()
        left_ns = self.due_ns - self.idle_from_ns
        self._unserved += 1
        # A loop that is always late, or has hardly any time left, must be stoppable too.
        if (left_ns > self._slack_ns and n % self._every == 0) or self._unserved >= self._longest:
            self._unserved = 0
            watch.mark(Phase.SERVICES)
            self._serve()
        watch.mark(Phase.WAIT)
        left_ns = self.due_ns - time.monotonic_ns()
        if left_ns > self._awake_ns:
            time.sleep((left_ns - self._awake_ns) / NS_PER_S)
        watch.mark(Phase.INPUTS)
        now_ns = time.monotonic_ns()
        if self.due_ns - now_ns > READ_NS:
            read(now_ns)
        while time.monotonic_ns() < self.due_ns:
            pass


SETTLE_NS = 200_000_000


class LiveRun:
    """
    One simulation, paced against the steady clock.

    :param epoch: counts resets.
    :param clock_offset_ns: simulation time of step 0 [ns]
    """

    def __init__(self, node: Node, executor: SingleThreadedExecutor, control: SimControl,
                 setup: Setup, epoch: int, clock_offset_ns: int,
                 recorded: 'RecordedInputs | None' = None) -> None:
        self._node = node
        self._executor = executor
        self._control = control
        self._epoch = epoch
        endpoints = self._endpoints = Endpoints(node)
        self._outputs = SimOutputs(node, endpoints, setup)
        self._inputs = SimInputs(node, endpoints, setup, clock_offset_ns, control.seat_sources,
                                 recorded, control.seat_tenants)
        scheduler = replace(setup.scheduler, clock_offset_ns=clock_offset_ns)
        feed = None if setup.traffic is None else RemoteTraffic(
            self._inputs.pop_agents, setup.traffic, scheduler)
        self.simulation = Simulation(setup, clock_offset_ns, feed)
        self._inputs.choose(self._answers, None if feed is None else feed.wants)
        self._dt_s = scheduler.dt_s
        self._controller = TimeController(setup.game.timing, self._dt_s)
        self._pacer = Pacer(lambda: self._serve(0.0), self._controller, self._dt_s,
                            setup.game.timing.max_catch_up_steps)
        self._watch = StepWatch()
        self._diagnostics = LiveDiagnostics(endpoints.diagnostics, self.simulation, self._inputs)
        self._failures = {av.id: FailureLines(av.id, node.get_logger().warning)
                          for av in setup.avs}
        self._state = RunState(self._outputs, self.simulation, self._diagnostics, control)
        duration_s = control.duration_s or setup.game.duration
        self._last_n = None if duration_s == float('inf') else scheduler.steps_for(duration_s)
        self._feed = feed
        self._second = max(1, round(1.0 / self._dt_s))
        # The step from which on all AVs and seats are reported on again.
        self._report_n = self._second
        self._setup = setup
        self._stop = StopFlag()
        self._reason = ''
        self._spells = SeatSpells(epoch)

    def run(self, stop: StopFlag) -> Outcome:
        """Run until the game's end, a reset or a stop."""
        self._stop = stop
        # Before the documents, upon which the recorder opens its bag and reports it.
        heard = HeardTopics(self._endpoints, self.simulation.scheduler.clock_offset_ns) \
            if 'recorder_node' in self._control.companions else None
        self._outputs.publish_documents(
            self._epoch, self.simulation.scheduler.clock_offset_ns,
            self._control.real_time_factor, self._control.simulation)
        self._publish_seats()
        result = self.simulation.begin()
        if self._epoch:
            self._settle()
        outcome = self._wait_for_companions(result, heard)
        if outcome is not None:
            self._control.end_steps()
            self._reason = self._reason or outcome.reason(self._stop.requested)
            self._state.publish('ended', self._reason)
            return outcome
        if not self._watch.tells_waiting:
            self._node.get_logger().info('this kernel does not report how long the loop waits for '
                                         'a processor: late steps stay partly unexplained')
        gc.collect()
        gc.freeze()
        gc.disable()
        try:
            now_ns = time.monotonic_ns()
            self._controller.start(now_ns)
            self._controller.resume(now_ns, self._control.real_time_factor)
            self._inputs.restart_timeout(now_ns)
            self._control.begun = True
            with self._watch:
                outcome = self._loop()
            self._reason = self._reason or outcome.reason(self._stop.requested)
            return outcome
        finally:
            self._control.begun = False
            self._control.end_steps()
            gc.enable()
            gc.unfreeze()
            self._outputs.publish_rows()
            self._diagnostics.publish()
            self._state.publish('ended', self._reason)
            self._outputs.wait_until_received()

    def hold_after_end(self) -> Outcome:
        """Show the end of the run until a reset or a stop."""
        control = self._control
        control.over, control.stop_wanted = True, False
        self._state.stand()
        while not (self._stop.requested or control.reset_wanted or control.quit_wanted):
            self._state.publish('ended', self._reason)
            self._serve(0.02)
            self._state.show_newcomers()
            self._apply_orders(time.monotonic_ns())
        control.over = False
        return Outcome.STOPPED if self._stop.requested or control.quit_wanted else Outcome.RESET

    def destroy(self) -> None:
        """Release the endpoints."""
        self._endpoints.destroy()
        self._watch.close()

    def _serve(self, timeout_s: float) -> None:
        """Serve an order, if there is one or one comes in time [s]."""
        serve(self._node, self._executor, timeout_s)

    def _settle(self) -> None:
        """Wait until subscribers have the new documents, before messages that need them."""
        until_ns = time.monotonic_ns() + SETTLE_NS
        while time.monotonic_ns() < until_ns:
            self._serve(0.02)

    def _wait_for_companions(self, result: StepResult,
                             heard: HeardTopics | None) -> Outcome | None:
        """Stay at step 0 until all companions are connected, or an order ends the run."""
        control = self._control
        self._state.publish('waiting')
        gate = StartGate(self._outputs, self._inputs, self.simulation, result,
                         control.companions, self._accept_plan, self._node.get_logger().warning,
                         None if self._feed is None else self._feed.is_ahead, heard)
        try:
            return self._wait_at(gate)
        finally:
            if heard is not None:
                heard.close()

    def _wait_at(self, gate: StartGate) -> Outcome | None:
        control, people = self._control, ReadyGate(self._inputs.seats, self._control)
        while True:
            now_ns = time.monotonic_ns()
            is_open = gate.is_open(now_ns, control.planner_timeout_s)
            if people.opens(now_ns, is_open):
                return None
            self._state.publish('paused' if is_open and control.stands_still else 'waiting')
            self._serve(0.005)
            if is_open:
                self._state.show_newcomers()
            self._apply_orders(time.monotonic_ns())
            outcome = self._ordered_end()
            if outcome is not None:
                return outcome

    def _ordered_end(self) -> Outcome | None:
        control = self._control
        self._end_on_violation()
        if control.stop_wanted or self._stop.requested:
            return Outcome.STOPPED
        if control.reset_wanted:
            return Outcome.RESET
        return None

    def _end_on_violation(self) -> None:
        """End the run if a human's violation requires it, and record where."""
        stop = self._inputs.stop_request()
        if stop is None:
            return
        vehicle_id, violation_n = stop
        n = self.simulation.n
        self._diagnostics.tell(stop_status(vehicle_id, violation_n, n))
        self._node.get_logger().warning(
            f'{vehicle_id} violates drivability (n = {violation_n}): stopping at n = {n}')
        self._control.stop_wanted = True
        self._reason = stop_reason(vehicle_id)

    def _answers(self, av_id: str, stamp_ns: int) -> bool:
        """
        Return whether a plan answers a request, and is of the AV's planner.

        Any number of others is refused.
        """
        reason = self.simulation.unasked_plan(av_id, stamp_ns)
        if reason is not None:
            self._refuse(av_id, reason)
            return False
        other = self._inputs.other_planner(av_id, stamp_ns)
        if other is not None:
            self.simulation.count_other_planner(av_id)
            self._diagnostics.refusal(av_id, other)
            complain(self._node, 'plan', f'/{av_id}/plan: {other}')
        return other is None

    def _refuse(self, av_id: str, reason: str) -> None:
        """Report a refused answer of an AV's planner."""
        self._diagnostics.refusal(av_id, reason)
        self._failures[av_id].refuse(reason)

    def _accept_plan(self, av_id: str) -> bool:
        """Pass an AV its new plan; return whether it was accepted."""
        try:
            perceived = self._inputs.pop_perceived(av_id)
            reason = None if perceived is None else self.simulation.request_perceived(
                av_id, perceived)
            plan = self._inputs.pop_plan(av_id)
            if plan is not None:
                reason = self.simulation.offer_plan(av_id, plan)
            elif reason is None:
                return False
        except InputError as error:
            reason = str(error)
            self.simulation.refuse_malformed_plan(av_id, reason)
        if reason is not None:
            self._refuse(av_id, reason)
        return reason is None

    def _apply_orders(self, now_ns: int) -> None:
        """Apply the orders about seats, and those that start or stop planners."""
        changed, refusals = self._inputs.seats.apply_orders(now_ns)
        if changed:
            self._publish_seats()
        for refusal in refusals:
            complain(self._node, 'order', refusal)
            self._diagnostics.order_refused(refusal)
        for av_id, running in self._inputs.planner_orders.items():
            self.simulation.set_planner_running(av_id, running)
        self._inputs.planner_orders.clear()

    def _publish_seats(self) -> None:
        self._spells.note(self.simulation.n, self._inputs.seats.driven())
        self._outputs.tell('/seats', self._inputs.seats.document())
        self._outputs.tell('/seats/drivers', self._spells.document())

    def _queue_triggers(self) -> None:
        """Pass on the events triggered since the last tick."""
        for name in self._inputs.triggers():
            if (reason := self.simulation.trigger(name)) is not None:
                self._diagnostics.event_refused(name, reason)

    def _loop(self) -> Outcome:
        while self.simulation.n != self._last_n:
            if self._control.stands_still:
                self._stay_paused()
            if self._control.real_time_factor != self._controller.real_time_factor:
                self._controller.resume(time.monotonic_ns(), self._control.real_time_factor)
                self._watch.begin()
            self._pacer.wait(self.simulation.n, self._watch, self._inputs.seats.listen)
            # Checked last, so that a verdict on state n ends the run at n.
            outcome = self._ordered_end()
            if outcome is not None:
                return outcome
            # A pause ordered while waiting holds from this very step on.
            if not self._control.stands_still:
                self._cycle()
        return Outcome.FINISHED

    def _stay_paused(self) -> None:
        """Serve orders while everything else stands still."""
        self._state.stand()
        self._outputs.publish_rows()
        self._state.publish('paused')
        while self._control.stands_still and self._ordered_end() is None:
            self._serve(0.02)
            self._state.publish('paused')
            self._state.show_newcomers()
            self._apply_orders(time.monotonic_ns())
        now_ns = time.monotonic_ns()
        self._controller.resume(now_ns)
        self._watch.begin()
        self._inputs.restart_timeout(now_ns)

    def _cycle(self) -> None:
        """Do the work of one cycle, from reading the inputs to publishing the state."""
        start_ns = time.monotonic_ns()
        simulation, outputs, inputs, watch = \
            self.simulation, self._outputs, self._inputs, self._watch
        watch.mark(Phase.INPUTS)
        for av in simulation.avs:
            self._accept_plan(av.setup.id)
        self._apply_orders(start_ns)
        # A recorded human moves over the recorded intervals, however busy this machine is.
        cycle = self._controller.begin_cycle(start_ns, inputs.seats.interval_s(simulation.n))
        factor = self._controller.real_time_factor
        causes, late_in = watch.explain(self._pacer.due_ns, cycle.step_error_s, factor)
        commands = inputs.seats.commands(start_ns, cycle.dt_eff_s, simulation)
        if inputs.seats.repetition_changed():
            self._publish_seats()
        if simulation.scheduler.is_tick(simulation.n + 1):
            self._queue_triggers()
        inputs.pass_task_reports(simulation.report_task)
        watch.mark(Phase.STEP)
        simulation.move(cycle.dt_eff_s, commands)
        if outputs.shows_vehicles(simulation):
            watch.mark(Phase.PUBLISH)
            outputs.publish_vehicles(simulation)
            watch.mark(Phase.STEP)
        result = simulation.conclude()
        watch.mark(Phase.PUBLISH)
        outputs.publish_step(simulation, result)
        if result.tick:
            self._at_tick(result)
        if not result.tick or simulation.scheduler.steps_per_tick == 1:
            self._report(result.n)
        self._control.count_step(simulation.scheduler.steps_per_tick, result.n)
        if outputs.rows.full:
            outputs.publish_rows()
        busy_s = (time.monotonic_ns() - start_ns) / NS_PER_S
        slept_s = (start_ns - self._pacer.idle_from_ns) / NS_PER_S
        outputs.rows.add(self._epoch, result.k, cycle, busy_s * factor, slept_s * factor,
                         simulation.command_rows, causes, late_in, start_ns / NS_PER_S)

    def _at_tick(self, result: StepResult) -> None:
        """Do the work of a scenario tick."""
        if result.agents_k is not None and result.agents_k < result.k:
            self._diagnostics.late_traffic(result.k, result.agents_k)
        order = self._inputs.frame_skip_order()
        if order is not None:
            self._outputs.frames_skipped = order and self._setup.game.timing.frame_skipping

    def _report(self, n: int) -> None:
        """Publish the state of the run, part by part, in steps without a tick's work."""
        self._state.publish('running')
        if not self._diagnostics.publish_next() and n >= self._report_n:
            self._report_n = n + self._second
            self._diagnostics.begin()
            for av in self.simulation.avs:
                self._failures[av.setup.id].wait(av.counters.timed_out, BUSY_TIMEOUT_S)
