# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What sim_node tells of its planners and seats on /diagnostics."""

from diagnostic_msgs.msg import DiagnosticStatus

from crgame_ros.ros.sim_inputs import SimInputs
from crgame_ros.ros.sim_outputs import SimOutputs
from crgame_ros.simulation.engine import Simulation

# Refusals published as they happen, between two reports: a flood must not cost the cycle.
MAX_REFUSALS_PER_REPORT = 5


class LiveDiagnostics:
    """Reports once a second, and refusals as they happen."""

    def __init__(self, outputs: SimOutputs, simulation: Simulation, inputs: SimInputs) -> None:
        self._outputs = outputs
        self._simulation = simulation
        self._inputs = inputs
        self._refusals = 0

    def refusal(self, av_id: str, reason: str) -> None:
        """Tell why a plan was refused."""
        self._refusals += 1
        if self._refusals <= MAX_REFUSALS_PER_REPORT:
            simulation = self._simulation
            self._outputs.publish_diagnostics(
                f'{av_id} plan refused', DiagnosticStatus.WARN, reason, {'n': simulation.n},
                simulation.scheduler.stamp_ns(simulation.n))

    def publish(self, n: int) -> None:
        """Report on every AV and seat."""
        self._refusals = 0
        simulation = self._simulation
        stamp_ns, dt_s = simulation.scheduler.stamp_ns(n), simulation.scheduler.dt_s
        for av in simulation.avs:
            counters, age = av.counters, av.plan_age_steps(n)
            stale = av.uses_no_plan
            self._outputs.publish_diagnostics(
                f'{av.setup.id} plans',
                DiagnosticStatus.ERROR if stale else DiagnosticStatus.OK,
                'no plan: braking' if stale else 'following its plan',
                {'requests': counters.requests, 'accepted': counters.accepted,
                 'refused': counters.refused, 'skipped': counters.skipped,
                 'timed_out': counters.timed_out, 'realigned': counters.realigned,
                 'steps_without_plan': counters.steps_without_plan,
                 'latency_ms': round(counters.last_latency_steps * dt_s * 1e3, 3),
                 'age_ms': '' if age is None else round(age * dt_s * 1e3, 3),
                 'last_refusal': counters.last_refusal}, stamp_ns)
        for human, seat in zip(simulation.setup.humans, self._inputs.seats, strict=True):
            self._outputs.publish_diagnostics(
                f'{human.id} seat', DiagnosticStatus.WARN if seat.lost else DiagnosticStatus.OK,
                'driver lost' if seat.lost else 'driven',
                {'losses': seat.losses, 'malformed': seat.malformed,
                 'outdated': seat.outdated}, stamp_ns)
