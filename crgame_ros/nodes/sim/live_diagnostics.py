# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The statuses of planners and seats that sim_node publishes on /diagnostics."""

from collections import deque
from collections.abc import Callable, Mapping
from functools import partial

from crgame_ros.messages.status_values import OK, Status, WARN
from crgame_ros.nodes.sim.inputs import SimInputs
from crgame_ros.ros.diagnostics import Diagnostics
from crgame_ros.ros.seats import Seat
from crgame_ros.simulation.autonomous_vehicle import AutonomousVehicle
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.run_messages import plans_status, refusal_status

# Refusals published as they happen, between two reports: a flood must not cost the cycle.
MAX_REFUSALS_PER_REPORT = 5


class LiveDiagnostics:
    """The reports of sim_node: every second, one subject per step; refusals at once."""

    def __init__(self, diagnostics: Diagnostics, simulation: Simulation,
                 inputs: SimInputs) -> None:
        self._diagnostics = diagnostics
        self._simulation = simulation
        self._inputs = inputs
        self._refusals = 0
        # Reports on the past second that are still to be published.
        self._waiting: deque[Callable[[], None]] = deque()

    def tell(self, status: Status) -> None:
        """Publish a status of the present step."""
        self._diagnostics.publish_status(
            status, self._simulation.scheduler.stamp_ns(self._simulation.n))

    def refusal(self, av_id: str, reason: str) -> None:
        """Publish why a plan was refused."""
        self._refused(refusal_status(av_id, reason, self._simulation.n))

    def run_state(self, values: Mapping[str, object]) -> None:
        """Publish whether the run is waiting, running, paused or ended (`state_values`)."""
        n, more = self._simulation.n, dict(values)
        self.tell(Status.of('sim_node: run', OK, str(more.pop('state')),
                            {'n': n, 'k': self._simulation.scheduler.k(n), **more}))

    def late_traffic(self, k: int, agents_k: int) -> None:
        """Publish that the agents of an earlier tick were used."""
        self.tell(Status.of(
            'sim_node: traffic', WARN, f'agents are {k - agents_k} scenario steps late',
            {'n': self._simulation.n, 'k': k, 'agents_k': agents_k}))

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
            self.tell(status)

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
        self.tell(plans_status(av, self._simulation.n, self._simulation.scheduler.dt_s))

    def _publish_seat(self, seat: Seat) -> None:
        self.tell(Status.of(
            f'sim_node: {seat.id} seat', WARN if seat.lost else OK,
            'driver lost' if seat.lost else 'driven',
            {'source': seat.source, 'losses': seat.losses, 'malformed': seat.malformed,
             'outdated': seat.outdated, 'passed_over': seat.passed_over}))
