# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The published state of a run, and its world while that stands still."""

from enum import auto, Enum
import time

from crgame_ros.nodes.sim.control import SimControl
from crgame_ros.nodes.sim.live_diagnostics import LiveDiagnostics
from crgame_ros.nodes.sim.outputs import SimOutputs
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.run_texts import state_values

# The whole program was asked to end.
SIGNAL = 'signal'


class Outcome(Enum):
    """Why an epoch ended."""

    FINISHED = auto()
    RESET = auto()
    STOPPED = auto()

    def reason(self, by_signal: bool) -> str:
        """Return the reason as a word: duration, reset, stop or signal."""
        if self is Outcome.STOPPED:
            return SIGNAL if by_signal else 'stop'
        return 'duration' if self is Outcome.FINISHED else 'reset'


NS_PER_S = 1_000_000_000
# The two sides may discover each other up to two seconds apart.
NEWCOMERS_NS = 3 * NS_PER_S


class RunState:
    """The state of a run: waiting, running, paused or ended; on /sim/state and /diagnostics."""

    def __init__(self, outputs: SimOutputs, simulation: Simulation, diagnostics: LiveDiagnostics,
                 control: SimControl) -> None:
        self._outputs = outputs
        self._simulation = simulation
        self._diagnostics = diagnostics
        self._control = control
        self._told: tuple[object, ...] = ()
        self._told_ns = 0
        self._listeners = 0
        self._shown_ns = self._show_until_ns = 0

    def publish(self, state: str, reason: str = '') -> None:
        """Publish a new state at once, and the present one every second."""
        control, now_ns = self._control, time.monotonic_ns()
        news = (state, reason, control.awaited, control.countdown_s)
        if news == self._told and now_ns - self._told_ns <= NS_PER_S:
            return
        values = state_values(
            state, reason, real_time_factor=control.real_time_factor,
            stays=control.stays and reason != SIGNAL, awaited=control.awaited,
            countdown_s=control.countdown_s)
        self._diagnostics.run_state(values)
        if news != self._told:
            self._outputs.publish_state(values)
        self._told, self._told_ns = news, now_ns

    def stand(self) -> None:
        """Note that the run stands still and that the present subscribers have seen its world."""
        self._listeners = self._outputs.listeners

    def show_newcomers(self) -> None:
        """
        Publish the world that stands still again for new subscribers.

        A new subscriber may miss the first message, so it is repeated for a while.
        """
        now_ns = time.monotonic_ns()
        listeners = self._outputs.listeners
        if listeners > self._listeners:
            self._show_until_ns = now_ns + NEWCOMERS_NS
        self._listeners = listeners
        if self._shown_ns + NS_PER_S < now_ns < self._show_until_ns:
            self._shown_ns = now_ns
            self._outputs.resend_world(self._simulation)
