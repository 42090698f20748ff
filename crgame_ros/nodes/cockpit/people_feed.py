# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is at this cockpit, and how long their input takes: told to the pages and recorded."""

from typing import Any

from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.run_status import RunStatus
from crgame_ros.cockpit.seat_table import SeatTable
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.seat import GAME
from diagnostic_msgs.msg import DiagnosticStatus

TELL_PERIOD_S = 1.0


class PeopleFeed:
    """
    Tells once a second.

    :param endpoints: of the node.
    :param hub: all pages.
    :param table: who holds which seat.
    :param status: knows of devices at this machine.
    """

    def __init__(self, endpoints: Endpoints, hub: Hub, table: SeatTable,
                 status: RunStatus) -> None:
        self._status = status
        self._endpoints = endpoints
        self._hub = hub
        self._table = table
        self._told_s = 0.0
        self._shown: frozenset[str] = frozenset()

    def tell(self, now_s: float) -> None:
        """
        Tell who is here if a second has passed, or somebody has come or gone.

        :param now_s: steady clock [s]
        """
        present = frozenset(self._hub.clients)
        due = now_s - self._told_s >= TELL_PERIOD_S
        if not due and present == self._shown:
            return
        self._shown = present
        self._hub.set_document('people', {
            'people': [self._entry(client) for client in self._hub.clients.values()],
            'devices': [device for seat, device in self._status.devices.items()
                        if self._table.seats.get(seat, {}).get('source') == GAME]})
        if due:
            self._told_s = now_s
            self._record()

    def _entry(self, client: Client) -> dict[str, Any]:
        seat = self._table.seat_of(client.id)
        return {'client': client.id, 'name': client.name, 'role': client.rights.role,
                'seat': None if seat is None else seat.id, 'away': seat is None or seat.away,
                'round_trip_ms': _rounded(client.round_trip_ms),
                'input_delay_ms': None if seat is None else _rounded(
                    seat.delay.total_ms(client.round_trip_ms))}

    def _record(self) -> None:
        """Publish the delays of those who drive, which makes them part of the recording."""
        for seat in self._table.held.values():
            client = self._hub.clients.get(seat.holder)
            if client is None or seat.away:
                continue
            values = {'person': client.person, 'round_trip_ms': _rounded(client.round_trip_ms),
                      'turn_ms': _rounded(seat.delay.turn_ms),
                      'input_delay_ms': _rounded(seat.delay.total_ms(client.round_trip_ms))}
            self._endpoints.diagnostics.publish(
                f'cockpit_node: {seat.id} driver', DiagnosticStatus.OK, client.name,
                {key: '' if value is None else value for key, value in values.items()})


def _rounded(value_ms: float | None) -> float | None:
    return None if value_ms is None else round(value_ms, 1)
