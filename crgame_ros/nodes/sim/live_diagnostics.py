# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The statuses of planners and seats that sim_node publishes on /diagnostics."""

from collections import deque
from collections.abc import Callable, Mapping
from functools import partial

from crgame_ros.messages.status_values import Status, WARN
from crgame_ros.nodes.sim.inputs import SimInputs
from crgame_ros.nodes.sim.outputs import SimOutputs
from crgame_ros.ros.seats import Seat
from crgame_ros.simulation.autonomous_vehicle import AutonomousVehicle
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.run_messages import plans_status, refusal_status
from diagnostic_msgs.msg import DiagnosticStatus

# Refusals published as they happen, between two reports: a flood must not cost the cycle.
MAX_REFUSALS_PER_REPORT = 5


class LiveDiagnostics:
    """The reports of sim_node: every second, one subject per step; refusals at once."""

    def __init__(self, outputs: SimOutputs, simulation: Simulation, inputs: SimInputs) -> None:
        self._outputs = outputs
        self._simulation = simulation
        self._inputs = inputs
        self._refusals = 0
        # Reports on the past second that are still to be published.
        self._waiting: deque[Callable[[], None]] = deque()

    def refusal(self, av_id: str, reason: str) -> None:
        """Publish why a plan was refused."""
        self._refused(refusal_status(av_id, reason, self._simulation.n))

    def run_state(self, values: Mapping[str, object]) -> None:
        """Publish whether the run is waiting, running, paused or ended (`state_values`)."""
        simulation, more = self._simulation, dict(values)
        state = str(more.pop('state'))
        self._outputs.publish_diagnostics(
            'run', DiagnosticStatus.OK, state,
            {'n': simulation.n, 'k': simulation.scheduler.k(simulation.n), **more},
            simulation.scheduler.stamp_ns(simulation.n))

    def late_traffic(self, n: int, k: int, agents_k: int) -> None:
        """Publish that the agents of an earlier tick were used."""
        self._outputs.publish_diagnostics(
            'traffic', DiagnosticStatus.WARN, f'agents are {k - agents_k} scenario steps late',
            {'n': n, 'k': k, 'agents_k': agents_k}, self._simulation.scheduler.stamp_ns(n))

    def event_refused(self, name: str, reason: str) -> None:
        """Publish why a trigger had no effect."""
        self._refused(Status.of('sim_node: event refused', WARN, reason,
                                {'event': name[:40], 'n': self._simulation.n}))

    def order_refused(self, reason: str) -> None:
        """Publish why an order about a seat was refused."""
        self._refused(Status.of('sim_node: seat order refused', WARN, reason,
                                {'n': self._simulation.n}))

    def _refused(self, status: Status) -> None:
        self._refusals += 1
        if self._refusals <= MAX_REFUSALS_PER_REPORT:
            self._outputs.publish_status(status, self._stamp_ns)

    @property
    def _stamp_ns(self) -> int:
        return self._simulation.scheduler.stamp_ns(self._simulation.n)

    def publish(self) -> None:
        """Report on every AV and seat."""
        self.begin()
        while self.publish_next():
            pass

    def begin(self) -> None:
        """Begin a report on every AV and seat, which `publish_next` publishes part by part."""
        self._refusals = 0
        self._waiting = deque((
            *(partial(self._publish_plans, av) for av in self._simulation.avs),
            *(partial(self._publish_seat, seat) for seat in self._inputs.seats.all)))

    def publish_next(self) -> bool:
        """Publish the next part of the report; return whether one was left."""
        if not self._waiting:
            return False
        self._waiting.popleft()()
        return True

    def _publish_plans(self, av: AutonomousVehicle) -> None:
        self._outputs.publish_status(plans_status(
            av, self._simulation.n, self._simulation.scheduler.dt_s), self._stamp_ns)

    def _publish_seat(self, seat: Seat) -> None:
        self._outputs.publish_diagnostics(
            f'{seat.id} seat', DiagnosticStatus.WARN if seat.lost else DiagnosticStatus.OK,
            'driver lost' if seat.lost else 'driven',
            {'source': seat.source, 'losses': seat.losses, 'malformed': seat.malformed,
             'outdated': seat.outdated, 'passed_over': seat.passed_over},
            self._simulation.scheduler.stamp_ns(self._simulation.n))
