# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Holding a run at step 0 until all of its participants are ready."""

from collections.abc import Callable, Iterable, Sequence
import math

from crgame_ros.driver.seat_state import GAME_DRIVER
from crgame_ros.nodes.sim.control import SimControl
from crgame_ros.nodes.sim.inputs import SimInputs
from crgame_ros.nodes.sim.outputs import SimOutputs
from crgame_ros.ros.heard_topics import HeardTopics
from crgame_ros.ros.seats import Seats
from crgame_ros.simulation.engine import Simulation, StepResult

NS_PER_S = 1_000_000_000
# A planner may still be working on the first request, so it is not repeated at once [ns].
ASK_AGAIN_NS = NS_PER_S // 2
# A driver's node answers the clock within milliseconds of receiving it [ns].
CLOCK_AGAIN_NS = NS_PER_S // 10
# The run waits this long for drivers without a device [ns].
DRIVER_PATIENCE_NS = 3 * NS_PER_S
# Latched topics of nodes that answer nothing: once the recorder has received one, it and the node
# have discovered each other.
LATCHED = {'timesync_node': '/timing/frame_skip', 'instruments_node': '/instruments/streams'}


class StartGate:
    """
    The gate that publishes step 0 once all companions are connected, then awaits their answers.

    The recorder must have opened the bag of the run, too.

    Answers are plans and commands.

    Discovery is not the same on both sides: a subscription that the publisher knows may itself
    not know the publisher yet, for up to a second. Answers prove that both do. The recorder itself
    reports which companions it has heard.

    :param simulation: at step 0.
    :param companions: nodes that must be connected, as `SimOutputs.missing` takes them.
    :param take_plan: passes an AV its new plan; returns whether it was accepted.
    :param traffic_answers: returns whether the agents of the next tick have come; None without
        any.
    :param heard: the topics that the recorder has received; None without a recorder to wait for.
    """

    def __init__(self, outputs: SimOutputs, inputs: SimInputs, simulation: Simulation,
                 result: StepResult, companions: Sequence[str],
                 take_plan: Callable[[str], bool], say: Callable[[str], object],
                 traffic_answers: Callable[[], bool] | None = None,
                 heard: HeardTopics | None = None) -> None:
        self._outputs = outputs
        self._simulation = simulation
        self._result = result
        self._companions = companions
        self._take_plan = take_plan
        self._say = say
        self._connected = False
        self._planners = set(result.requests)
        self._traffic_answers = traffic_answers
        self._seats = {seat.id: seat for seat in inputs.seats.humans
                       if seat.recording is None
                       and {'driver_node', f'driver_node_{seat.id}'} & set(companions)}
        self._heard = heard
        # Topics of other nodes that must be recorded from the start, by vehicle or node.
        self._unrecorded: dict[str, str] = {} if heard is None else {
            **{av_id: f'/{av_id}/plan' for av_id in self._planners},
            **{seat_id: f'/{seat_id}/driver_command' for seat_id in self._seats},
            **{node: topic for node, topic in LATCHED.items() if node in companions}}
        self._began_ns = 0
        self._asked_ns = 0
        self._told_ns = 0
        self._connected_ns = 0

    def is_open(self, now_ns: int, timeout_s: float) -> bool:
        """
        Check which participants have come since the last call; return whether the run can start.

        :param now_ns: steady clock [ns]
        :param timeout_s: after this long the run starts without those that are missing [s]
        """
        self._began_ns = self._began_ns or now_ns
        if not self._connected and not self._missing():
            self._publish(now_ns)
        if self._connected:
            self._listen(now_ns)
        if now_ns - self._began_ns > timeout_s * NS_PER_S:
            self._time_out(now_ns, timeout_s)
        return self._connected and not self._planners and not self._seats \
            and self._traffic_answers is None and not self._unrecorded

    def _missing(self) -> list[str]:
        """Return who must be there before the first message of the run."""
        companions = sorted(self._outputs.missing(self._companions))
        return companions if companions or self._heard is None or self._heard.has_begun() \
            else ['the bag of recorder_node']

    def _publish(self, now_ns: int) -> None:
        self._connected = True
        self._connected_ns = self._asked_ns = self._told_ns = now_ns
        self._outputs.publish_step(self._simulation, self._result)

    def _listen(self, now_ns: int) -> None:
        self._planners -= {av_id for av_id in self._planners if self._take_plan(av_id)}
        for seat in list(self._seats.values()):
            if seat.source != GAME_DRIVER:
                self._forget([seat.id])
            if seat.source != GAME_DRIVER or seat.listen(now_ns):
                del self._seats[seat.id]
        if self._traffic_answers is not None and self._traffic_answers():
            self._traffic_answers = None
        if self._heard is not None and self._unrecorded:
            missing = self._heard.missing(set(self._unrecorded.values()))
            self._unrecorded = {sender: topic for sender, topic
                                in self._unrecorded.items() if topic in missing}
        if now_ns - self._asked_ns > ASK_AGAIN_NS:
            self._asked_ns = now_ns
            if self._traffic_answers is not None or self._seats:
                # Agents and policies answer the world, once they have received it.
                self._outputs.resend_world(self._simulation)
            for av_id in self._planners | (self._result.requests.keys() & self._unrecorded):
                self._outputs.resend(av_id, self._result)
        if (self._seats or self._unrecorded) and now_ns - self._told_ns > CLOCK_AGAIN_NS:
            self._told_ns = now_ns
            self._outputs.publish_clock(self._simulation.scheduler.stamp_ns(self._result.n))
        if self._seats and now_ns - self._connected_ns > DRIVER_PATIENCE_NS:
            self._say('starting without a command for ' + ', '.join(sorted(self._seats))
                      + ': these vehicles are not driven until one arrives')
            self._forget(self._seats)
            self._seats.clear()

    def _forget(self, seat_ids: Iterable[str]) -> None:
        """Stop waiting for the recording of commands that may never come."""
        for seat_id in seat_ids:
            self._unrecorded.pop(seat_id, None)

    def _time_out(self, now_ns: int, timeout_s: float) -> None:
        missing = [] if self._connected else self._missing()
        for av in self._simulation.avs:
            if av.setup.id in self._planners and av.counters.refused:
                self._say(f'starting without a plan of {av.setup.id}: its planner answered, but '
                          f'was refused {av.counters.refused} times: {av.counters.last_refusal}')
            elif av.setup.id in self._planners:
                missing.append(f'the planner of {av.setup.id}')
        missing += ['the traffic'] if self._traffic_answers is not None else []
        missing += [f'a record of {topic}' for topic in self._unrecorded.values()
                    if self._connected and not missing]
        if missing:
            self._say(f'starting without {" and ".join(missing)}: no answer in {timeout_s:g} s')
        if not self._connected:
            self._publish(now_ns)
        self._planners.clear()
        self._seats.clear()
        self._unrecorded.clear()
        self._traffic_answers = None


class ReadyGate:
    """
    The gate that holds a run at its first step for the drivers at pages.

    The run begins when all of them are ready, or when one client starts it for all. In either case
    all must have their hands on the controls, and a countdown follows. A driver that lets go
    during the countdown stops it. A game without such drivers does not wait here.

    :param control: orders from outside; gets the awaited seats and the countdown.
    """

    def __init__(self, seats: Seats, control: SimControl) -> None:
        self._seats = seats
        self._control = control
        self._began_ns: int | None = None
        self._by_all = False

    def opens(self, now_ns: int, others_ready: bool) -> bool:
        """
        Return whether the run begins now.

        :param now_ns: steady clock [ns]
        :param others_ready: whether planners, traffic and devices are ready.
        """
        control = self._control
        control.awaited = self._seats.awaited(now_ns)
        self._check_readiness()
        begins = others_ready and not control.awaited and not control.stands_still
        # A step ordered during a pause begins at once.
        if not begins or control.paused or not self._seats.cockpit_seats:
            self._began_ns, control.countdown_s = None, 0
            return begins
        if self._began_ns is None:
            self._began_ns = now_ns
        left_s = control.countdown_from_s - (now_ns - self._began_ns) / NS_PER_S
        control.countdown_s = max(0, math.ceil(left_s))
        return left_s <= 0.0

    def _check_readiness(self) -> None:
        """Order the start when all are ready; withdraw it when one of them is no longer ready."""
        control, seats = self._control, self._seats.cockpit_seats
        ready = bool(seats) and all(seat.ready for seat in seats)
        if ready and not control.started:
            control.paused, control.started, self._by_all = False, True, True
        elif self._by_all and not ready:
            control.paused, control.started, self._by_all = True, False, False
