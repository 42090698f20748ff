# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The seats of a live run: how people at this cockpit take, drive, offer and leave them."""

import time

from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.page_messages import (
    Answer,
    Ask,
    Claim,
    HandOver,
    Input,
    Ready,
    Release,
    SeatOrder,
)
from crgame_ros.cockpit.run_status import RunStatus
from crgame_ros.cockpit.seat_table import HeldSeat, SeatOrders, SeatTable
from crgame_ros.driver.seat_state import GAME_DRIVER
from crgame_ros.driver.source import COCKPIT
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.seat_documents import SeatDemand, SeatPerson, SEATS
from crgame_ros.nodes.cockpit.feed import CockpitFeed
from crgame_ros.nodes.cockpit.orders import CockpitOrders
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import to_joy
from crgame_ros.vehicle.driver_command import DriverCommand
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.publisher import Publisher

TELL_PERIOD_S = 1.0


class PeopleFeed:
    """The list of people at this cockpit and their delays, published once a second."""

    def __init__(self, endpoints: Endpoints, hub: Hub, table: SeatTable,
                 status: RunStatus) -> None:
        self._status = status
        self._endpoints = endpoints
        self._hub = hub
        self._table = table
        self._told_s = 0.0
        self._shown: frozenset[str] = frozenset()

    def publish(self, now_s: float) -> None:
        """
        Publish the people here if a second has passed or the list has changed.

        :param now_s: steady clock [s]
        """
        present = frozenset(self._hub.clients)
        due = now_s - self._told_s >= TELL_PERIOD_S
        if not due and present == self._shown:
            return
        self._shown = present
        self._hub.set_document('people', {
            'people': [self._entry(client) for client in self._hub.clients.values()],
            'devices': [
                device for seat, device in self._status.devices.items()
                if seat in self._table.seats and self._table.seats[seat].source == GAME_DRIVER]})
        if due:
            self._told_s = now_s
            self._record()

    def _entry(self, client: Client) -> dict[str, object]:
        seat = self._table.seat_of(client.id)
        return {'client': client.id, 'name': client.name, 'role': client.rights.role,
                'seat': None if seat is None else seat.id, 'away': seat is None or seat.away,
                'round_trip_ms': _rounded(client.round_trip_ms),
                'input_delay_ms': None if seat is None else _rounded(
                    seat.delay.total_ms(client.round_trip_ms))}

    def _record(self) -> None:
        """Publish the delays of the clients that drive, so that they are recorded."""
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


WAITS = ('waiting', 'paused')


class SeatDesk:
    """The desk that carries out the pages' orders about seats and publishes their inputs."""

    def __init__(self, node: Node, endpoints: Endpoints, orders: CockpitOrders, hub: Hub,
                 feed: CockpitFeed) -> None:
        self._node = node
        self._endpoints = endpoints
        self._orders = orders
        self._hub = hub
        self._feed = feed
        self._commands: dict[str, Publisher] = {}
        self.table = SeatTable()
        self._awaited = SeatOrders()
        self._told: dict[str, SeatPerson] = {}
        self._driven_n = 0

    def close(self) -> None:
        """Release every seat."""
        for seat in list(self.table.held.values()):
            self._publish_hands_off(seat)
            self._orders.order_seat(SeatDemand(seat.id, left=seat.person))

    def receive_seats(self, text: str) -> None:
        """
        Read a message of `/seats`.

        :raises InputError: if it does not follow the contract.
        """
        seats = SEATS.read(text)
        self._awaited.answered(seats)
        self.table.update(seats, self._awaited)
        # Made before the first claim, because discovery of a new publisher takes a while.
        for name in seats.keys() - self._commands.keys():
            self._commands[name] = self._endpoints.publisher('/<v>/driver_command', name)
        for name in self._commands.keys() - seats.keys():
            self._node.destroy_publisher(self._commands.pop(name))
        for client in self._hub.clients.values():
            self._return(client)
        self.show()

    def serve(self) -> None:
        """Repeat orders without an answer, and publish changes of the people in the seats."""
        for demand in self._awaited.due(time.monotonic()):
            self._orders.order_seat(demand)
        self.table.update(self.table.seats, self._awaited)
        for seat in self.table.held.values():
            client = self._hub.clients.get(seat.holder)
            if client is not None and seat.id not in self._awaited \
                    and self._told.get(seat.id) != _person(client):
                self._told[seat.id] = _person(client)
                self._orders.order_seat(SeatDemand(seat.id, person=_person(client)))
        self.show()

    def drive(self) -> None:
        """Send the command of each held seat for a new cycle; release silent ones."""
        now_s = time.monotonic()
        new_cycle, self._driven_n = self._feed.n != self._driven_n, self._feed.n
        for seat in self.table.held.values():
            seat.delay.stepped(now_s, self._feed.n)
            if seat.is_silent(now_s):
                self._publish_hands_off(seat)
            elif new_cycle and not seat.away:
                self._publish(seat)

    def show(self) -> None:
        """Show the pages the holder of each seat."""
        now_s, lost = time.monotonic(), self._feed.status.seats_lost
        self.table.note_absent(lost, now_s)
        self._hub.set_document('seats', self.table.document(self._drivers(), lost, now_s))
        for client in self._hub.clients.values():
            client.drives = self.table.seat_of(client.id) is not None
            self._feed.pace(client)

    def joined(self, client: Client) -> None:
        """Reassign its seat to a client that is back; free that of one that only watches."""
        held = self.table.seat_of(client.id)
        if held is not None and not client.rights.drives:
            self._release(client, held.id)
        self._return(client)
        self.show()

    def left(self, client: Client) -> None:
        """Release the controls of a page that is gone, at once."""
        seat = self.table.left(client.id)
        if seat is not None:
            self._publish_hands_off(seat)
            self._told.pop(seat.id, None)
            self._orders.order_seat(SeatDemand(seat.id, left=seat.person))
        self.show()

    def input(self, client: Client, message: Input) -> str:  # noqa: A003
        """
        Pass on a client's input.

        :raises InputError: if the client does not have the seat.
        """
        seat = self.table.holding(client.id, message.seat)
        now_s = time.monotonic()
        if seat.apply_input(message, now_s):
            # Read the newest step first: the step that executes this input is measured from it.
            self._feed.poll_states()
            seat.delay.changed(now_s, self._feed.n)
        self._publish(seat)
        return ''

    def order(self, client: Client, message: SeatOrder) -> str:
        """
        Carry out a page's order about a seat.

        :raises CrgameError: if it cannot be done.
        """
        text = self._ordered(client, message)
        self.show()
        return text

    def _ordered(self, client: Client, message: SeatOrder) -> str:
        match message:
            case Claim():
                client.device = message.device or client.device
                return self._claim(client, message.seat)
            case Release():
                self._release(client, message.seat)
                return f'{message.seat} is given back'
            case HandOver():
                return self._offer(client, message.seat, message.to)
            case Answer():
                return self._answer(client, message.seat, message.accept)
            case Ask():
                held = self.table.ask(client.id, message.seat)
                return f'{self._drivers().get(held.holder, "")} was asked for {held.id}'
            case Ready():
                return self._ready(client, message.seat, message.ready)

    def claim_for(self, client: Client) -> None:
        """Claim the first free seat that the game leaves to a cockpit for a client."""
        if self.table.seat_of(client.id) is not None or not client.rights.drives:
            return
        for name, entry in self.table.seats.items():
            if entry.driver == COCKPIT and name not in self.table.held:
                self._claim(client, name)
                self.show()
                return

    def gate_seat(self, client: Client) -> str | None:
        """Return the seat whose readiness a client can declare, None if no run waits for it."""
        held = self.table.seat_of(client.id)
        waits = self._feed.n == 0 and self._feed.status.run in WAITS
        return held.id if waits and held is not None and held.id in self.cockpit_seats else None

    @property
    def cockpit_seats(self) -> list[str]:
        """Return the seats that the game leaves to people at pages."""
        return [name for name, entry in self.table.seats.items()
                if entry.driver == entry.source == COCKPIT]

    def _drivers(self) -> dict[str, str]:
        return {item.id: item.name for item in self._hub.clients.values() if item.rights.drives}

    def _return(self, client: Client) -> None:
        """Reassign the seat to a client whose connection was broken."""
        seat = self.table.seat_kept_for(client.person)
        if seat is None or not client.key or client.dropped or not client.rights.drives:
            return
        held = self.table.held.get(seat)
        if held is not None and held.person == client.person and held.holder != client.id:
            # The server has not noticed yet that the old connection is gone.
            self._publish_hands_off(held)
            del self.table.held[seat]
            held = None
        if held is None and seat not in self._awaited:
            self._sit(client, self.table.claim(client.id, seat, {}, person=client.person))

    def _claim(self, client: Client, seat: str) -> str:
        if client.rights.seat not in ('', seat):
            raise CrgameError(f'your link is for {client.rights.seat}; the driver of {seat} can '
                              'offer it to you')
        before = self.table.seat_of(client.id)
        held = self.table.claim(client.id, seat, self._drivers(), person=client.person,
                                may_displace=client.rights.directs, now_s=time.monotonic())
        if before is not None and before.id != seat:
            self._release(client, before.id)
        self._sit(client, held)
        return f'you drive {seat}'

    def _sit(self, client: Client, held: HeldSeat) -> None:
        """Order a seat for a client, in place of its present holder."""
        tenant = self.table.tenants.get(held.id)
        person = self._told[held.id] = _person(client)
        displaced = None if tenant is None or tenant.person.id == person.id else tenant.person.id
        self._order(SeatDemand(held.id, COCKPIT, person, displaced))

    def _release(self, client: Client, seat: str) -> None:
        held = self.table.release(client.id, seat, person=client.person,
                                  may_displace=client.rights.directs, now_s=time.monotonic())
        if held is not None:
            self._publish_hands_off(held)
        self._told.pop(seat, None)
        self._order(SeatDemand(seat, GAME_DRIVER))

    def _offer(self, client: Client, seat: str, to: str) -> str:
        names = self._drivers()
        if to not in names:
            raise InputError('is not here any more, or only watches', to)
        held = self.table.offer(client.id, seat, to)
        return f'{seat} is offered to {names[to]}' if held.offered_to else f'you keep {seat}'

    def _answer(self, client: Client, seat: str, accept: bool) -> str:
        if not accept:
            self._send(self.table.decline(client.id, seat).holder,
                       f'{client.name} does not want {seat}')
            return f'you do not take {seat}'
        taken = self.table.seat_of(client.id)
        before = self.table.accept(client.id, seat, client.person)
        self._publish_hands_off(before)
        if taken is not None:
            self._publish_hands_off(taken)
            self.table.held.pop(taken.id, None)
            self._order(SeatDemand(taken.id, GAME_DRIVER))
        self._sit(client, self.table.held[seat])
        self._send(before.holder, f'{client.name} drives {seat} now')
        return f'you drive {seat}'

    def _ready(self, client: Client, seat: str, ready: bool) -> str:
        seat = self.table.holding(client.id, seat).id
        if self.gate_seat(client) is None:
            raise InputError('no run waits for its driver', seat)
        self._orders.order_seat(
            SeatDemand(seat, person=_person(client), ready=ready))
        return 'you are ready' if ready else 'you are not ready'

    def _send(self, client_id: str, text: str) -> None:
        client = self._hub.clients.get(client_id)
        if client is not None:
            self._hub.send_event('notice', {'level': 'info', 'text': text}, only=client)

    def _order(self, demand: SeatDemand) -> None:
        self._orders.order_seat(demand)
        self._awaited.note(demand, self.table.seats, time.monotonic())

    def _publish_hands_off(self, seat: HeldSeat) -> None:
        """Publish once that the hands are off; in the silence after, the watchdog brakes."""
        seat.release()
        self._publish(seat)

    def _publish(self, seat: HeldSeat) -> None:
        scenario = self._feed.scenario
        entry = self.table.seats.get(seat.id)
        if scenario is None or entry is None or entry.source != COCKPIT:
            return
        scheduler = scenario.game.scheduler
        command: DriverCommand = seat.command(self._feed.n, scheduler.dt_s)
        self._commands[seat.id].publish(
            to_joy(command, scheduler.stamp_ns(self._feed.n), COCKPIT))


def _person(client: Client) -> SeatPerson:
    """Build the description of a client from nothing but its own statements."""
    return SeatPerson(client.person, client.name, client.device, client.browser,
                      client.rights.role)
