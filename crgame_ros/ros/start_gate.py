# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Holding a run at step 0 until everybody who takes part in it is there."""

from collections.abc import Callable, Sequence

from crgame_ros.ros.seats import GAME
from crgame_ros.ros.sim_inputs import SimInputs
from crgame_ros.ros.sim_outputs import SimOutputs
from crgame_ros.simulation.engine import Simulation, StepResult

NS_PER_S = 1_000_000_000
# A planner may be at work on the first request: it is not asked again at once [ns].
ASK_AGAIN_NS = NS_PER_S // 2
# A driver's node answers the clock within milliseconds, once it has heard it [ns].
CLOCK_AGAIN_NS = NS_PER_S // 10
# For drivers that have no device (yet) the run doesn't wait any longer [ns].
DRIVER_PATIENCE_NS = 3 * NS_PER_S


class StartGate:
    """
    Publishes step 0 once all companions are connected, then waits for plans and commands.

    Discovery is not the same on both sides: a subscription that the publisher knows may itself
    not know the publisher yet, for up to a second. Answers prove that both do.

    :param outputs: of the run.
    :param inputs: of the run.
    :param simulation: at step 0.
    :param result: its first result.
    :param companions: nodes that must be connected, as `SimOutputs.missing` takes them.
    :param take_plan: offers an AV the plan that has come; tells whether it was accepted.
    :param say: tells people something in one line.
    :param traffic_answers: tells whether the agents of the next tick have come; None without any.
    """

    def __init__(self, outputs: SimOutputs, inputs: SimInputs, simulation: Simulation,
                 result: StepResult, companions: Sequence[str],
                 take_plan: Callable[[str], bool], say: Callable[[str], object],
                 traffic_answers: Callable[[], bool] | None = None) -> None:
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
        self._began_ns = 0
        self._asked_ns = 0
        self._told_ns = 0
        self._connected_ns = 0

    def is_open(self, now_ns: int, timeout_s: float) -> bool:
        """
        Look who has come since the last call, and tell whether the run can start.

        :param now_ns: steady clock [ns]
        :param timeout_s: after this long it starts without those who are missing [s]
        """
        self._began_ns = self._began_ns or now_ns
        if not self._connected and not self._outputs.missing(self._companions):
            self._publish(now_ns)
        if self._connected:
            self._listen(now_ns)
        if now_ns - self._began_ns > timeout_s * NS_PER_S:
            self._give_up(now_ns, timeout_s)
        return self._connected and not self._planners and not self._seats \
            and self._traffic_answers is None

    def _publish(self, now_ns: int) -> None:
        self._connected = True
        self._connected_ns = self._asked_ns = self._told_ns = now_ns
        self._outputs.publish_step(self._simulation, self._result)

    def _listen(self, now_ns: int) -> None:
        self._planners -= {av_id for av_id in self._planners if self._take_plan(av_id)}
        for seat in list(self._seats.values()):
            if seat.source != GAME or seat.listen(now_ns):
                del self._seats[seat.id]
        if self._traffic_answers is not None and self._traffic_answers():
            self._traffic_answers = None
        if now_ns - self._asked_ns > ASK_AGAIN_NS:
            self._asked_ns = now_ns
            if self._traffic_answers is not None:
                self._outputs.resend_world(self._simulation)
            for av_id in self._planners:
                self._outputs.resend(av_id, self._result)
        if self._seats and now_ns - self._told_ns > CLOCK_AGAIN_NS:
            self._told_ns = now_ns
            self._outputs.publish_clock(self._simulation.scheduler.stamp_ns(self._result.n))
        if self._seats and now_ns - self._connected_ns > DRIVER_PATIENCE_NS:
            self._say('starting without a command for ' + ', '.join(sorted(self._seats))
                      + ': nobody drives until one comes')
            self._seats.clear()

    def _give_up(self, now_ns: int, timeout_s: float) -> None:
        missing = [] if self._connected else sorted(self._outputs.missing(self._companions))
        missing += [f'the planner of {av_id}' for av_id in sorted(self._planners)]
        missing += ['the traffic'] if self._traffic_answers is not None else []
        if missing:
            self._say(f'starting without {" and ".join(missing)}: no answer in {timeout_s:g} s')
        if not self._connected:
            self._publish(now_ns)
        self._planners.clear()
        self._seats.clear()
        self._traffic_answers = None
