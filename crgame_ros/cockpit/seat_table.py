# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The seats that clients of this server hold, their orders and inputs, and the document of it."""

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field
import math
from pathlib import PurePath

from crgame_ros.cockpit.page_messages import Input
from crgame_ros.driver.input_delay import InputDelay
from crgame_ros.driver.keyboard import KeyboardCycles, KeyState
from crgame_ros.driver.seat_state import after, home_of
from crgame_ros.driver.source import COCKPIT
from crgame_ros.driver.wheel import IndicatorLever, LightButtons
from crgame_ros.errors import InputError
from crgame_ros.game.seat_documents import SeatDemand, SeatEntry, SeatOccupant
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED

# How long a seat is kept for a driver whose connection has broken [s].
KEEP_S = 60.0
# A page repeats its input every 50 ms; after this silence it counts as gone [s].
SILENCE_S = 0.2
# The lever and the horn as the page reports them: which of left, right, hazard, horn are held.
_LIGHTS = LightButtons(*(frozenset({i}) for i in range(4)))
# Interval of repetition [s]: an order sent while the simulation loads another game is lost.
AGAIN_S = 0.5
GIVE_UP_S = 10.0

Seats = Mapping[str, SeatEntry]


class HeldSeat:
    """
    A seat that a driver in the browser holds.

    Keys pass the keyboard filter (CRG 18-19) in simulation time. Axes are used as the page
    calibrated them (CRG 17).

    :param holder: id of the client, which has a person with an id of its own.
    """

    def __init__(self, seat_id: str, holder: str, person: str = '') -> None:
        self.id = seat_id
        self.holder = holder
        self.person = person
        self.requests: list[str] = []
        # The client to which the holder offers the seat, until it has answered.
        self.offered_to: str | None = None
        self.delay = InputDelay()
        self._cycles = KeyboardCycles()
        self._lever = IndicatorLever(_LIGHTS)
        self._keys: KeyState | None = None
        self._axes: DriverCommand | None = None
        self._put_back = False
        self._heard_s = 0.0
        self.away = True

    def apply_input(self, message: Input, now_s: float) -> bool:
        """Apply an input of the holder; return whether it differs from the one before."""
        self._heard_s = now_s
        before = (self._keys, self._axes)
        self._put_back = message.put_back
        self.away = bool(message.away)
        self._lever.hold(i for i, held in enumerate(message.lights or ()) if held)
        if message.axes is not None:
            self._keys, self._axes = None, DriverCommand(*message.axes, message.reverse)
        elif message.keys is not None:
            self._keys, self._axes = KeyState(*message.keys, message.reverse), None
        else:
            self.release()
        return (self._keys, self._axes) != before

    def release(self) -> None:
        """Release all controls at once."""
        self.away = True
        self._keys = self._axes = None
        self._put_back = False
        self._cycles.reset()
        self._lever.hold(())

    def is_silent(self, now_s: float) -> bool:
        """Return whether the page has been silent for too long."""
        return not self.away and now_s - self._heard_s > SILENCE_S

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """
        Return the command of cycle n; an empty seat releases all but the indicators.

        :param dt_s: length of a cycle in simulation time [s]
        """
        command = RELEASED
        if self._axes is not None:
            command = self._axes
        elif self._keys is not None:
            if n < self._cycles.cycle:
                # A new run has begun.
                self._cycles.reset()
            command = self._cycles.command(n, self._keys, dt_s)
        self._lever.turn(command.steering)
        return command._replace(lights=self._lever.lights, put_back=self._put_back)


def _people(clients: Iterable[str], names: Mapping[str, str]) -> list[dict[str, str]]:
    return [{'client': item, 'name': names.get(item, '')} for item in clients]


def short_source(driver: str) -> str:
    """Return a driver source with its file's name only: pages must not see folders."""
    kind, colon, argument = driver.partition(':')
    return f'{kind}{colon}{PurePath(argument).name}' if colon else driver


@dataclass
class SeatTable:
    """
    The seats of a run as the browser sees them; clients and their persons are told by their ids.

    :param seats: content of `/seats`.
    :param held: the seats that clients of this server hold.
    :param absent_s: since when absent drivers are absent, by seat; steady clock [s].
    """

    seats: dict[str, SeatEntry] = field(default_factory=dict)
    held: dict[str, HeldSeat] = field(default_factory=dict)
    absent_s: dict[str, float] = field(default_factory=dict)

    @property
    def tenants(self) -> dict[str, SeatOccupant]:
        """Return the people in the seats, here and at other cockpits."""
        return {name: occupant for name, entry in self.seats.items()
                if (occupant := entry.occupant) is not None}

    def update(self, seats: Mapping[str, SeatEntry],
               awaited: Container[str] = ()) -> list[HeldSeat]:
        """
        Update the table with the content of `/seats`.

        :param awaited: seats with a pending order, whose content is out of date.
        :return: the seats that were taken away from outside, which are no longer held.
        """
        self.seats = dict(seats)
        gone = [item for name, item in self.held.items()
                if name not in self.seats or (name not in awaited and self._is_taken(item))]
        for item in gone:
            del self.held[item.id]
        return gone

    def _is_taken(self, item: HeldSeat) -> bool:
        entry = self.seats[item.id]
        return entry.source != COCKPIT or (
            entry.here and entry.person is not None and entry.person.id != item.person)

    def note_absent(self, lost: Mapping[str, bool], now_s: float) -> None:
        """Record the absent drivers: their connection has ended, or their seat is lost."""
        gone = {name for name, tenant in self.tenants.items() if name not in self.held
                and (not tenant.here or lost.get(name, False))}
        self.absent_s = {name: self.absent_s.get(name, now_s) for name in gone}

    def kept_for(self, seat: str, now_s: float) -> float:
        """Return how long a seat is still kept for its absent driver [s]; 0 if it is not."""
        if seat in self.held or seat not in self.absent_s:
            return 0.0
        return max(0.0, self.absent_s[seat] + KEEP_S - now_s)

    def seat_of(self, client: str) -> HeldSeat | None:
        """Return the seat that a client holds; None if it holds none."""
        return next((item for item in self.held.values() if item.holder == client), None)

    def seat_kept_for(self, person: str) -> str | None:
        """Return the seat that a person had and may take again; None if there is none."""
        return next((name for name, tenant in self.tenants.items()
                     if tenant.person.id == person and self.seats[name].source == COCKPIT), None)

    def claim(self, client: str, seat: str, names: Mapping[str, str], *, person: str = '',
              may_displace: bool = True, now_s: float = 0.0) -> HeldSeat:
        """
        Assign a free seat to a client, which must have left its former seat.

        :param names: names of the clients by id, for messages.
        :param may_displace: whether it may take a seat that is kept for an absent driver.
        :param now_s: steady clock [s]
        :raises InputError: if there is no such seat or another client holds it.
        """
        self._known(seat)
        holder = self.held.get(seat)
        if holder is not None and holder.holder != client:
            raise InputError(f'{names.get(holder.holder, "another person")} has the seat', seat,
                             'ask for it')
        if holder is None:
            self._check_tenant(seat, person, may_displace, now_s)
            holder = self.held[seat] = HeldSeat(seat, client, person)
        return holder

    def _check_tenant(self, seat: str, person: str, may_displace: bool, now_s: float) -> None:
        entry = self.seats[seat]
        if entry.person is None or entry.person.id == person or entry.source != COCKPIT:
            return
        name = entry.person.name or 'another person'
        if seat not in self.absent_s:
            raise InputError(f'{name} drives in another cockpit', seat, 'ask them')
        left_s = self.kept_for(seat, now_s)
        if left_s > 0.0 and not may_displace:
            raise InputError(f'the seat is kept for {name}', seat,
                             f'it is free in {math.ceil(left_s)} s, or when a director takes it')

    def release(self, client: str, seat: str, *, person: str = '', may_displace: bool = True,
                now_s: float = 0.0) -> HeldSeat | None:
        """
        Return a seat to the driver or planner of the game.

        Any client that may claim a seat that has been left may do that with it.

        :return: the seat as it was held, None if no client held it.
        :raises InputError: if another client holds it, it is kept for another person, or no client
            ever took it.
        """
        entry = self._known(seat)
        holder = self.held.get(seat)
        if holder is not None and holder.holder != client:
            raise InputError('another person has the seat', seat, 'ask for it')
        if holder is None:
            if entry.source != COCKPIT:
                raise InputError('no person at this cockpit has the seat', seat)
            self._check_tenant(seat, person, may_displace, now_s)
        return self.held.pop(seat, None)

    def offer(self, client: str, seat: str, to: str) -> HeldSeat:
        """
        Offer a seat to another client, or withdraw the offer if `to` is the client itself.

        :raises InputError: if the client does not hold it.
        """
        holder = self.holding(client, seat)
        holder.offered_to = None if to == client else to
        return holder

    def accept(self, client: str, seat: str, person: str = '') -> HeldSeat:
        """
        Accept an offered seat.

        :return: the seat as it was held.
        :raises InputError: if it is not, or no longer, offered to this client.
        """
        before = self._offered(client, seat)
        after = self.held[seat] = HeldSeat(seat, client, person)
        after.requests = [item for item in before.requests if item != client]
        return before

    def decline(self, client: str, seat: str) -> HeldSeat:
        """
        Decline an offered seat, which its holder keeps.

        :raises InputError: if it is not, or no longer, offered to this client.
        """
        holder = self._offered(client, seat)
        holder.offered_to = None
        holder.requests = [item for item in holder.requests if item != client]
        return holder

    def ask(self, client: str, seat: str) -> HeldSeat:
        """
        Record that a client requests a seat that another holds.

        :raises InputError: if no client holds it.
        """
        self._known(seat)
        holder = self.held.get(seat)
        if holder is None or holder.holder == client:
            raise InputError('the seat is free', seat, 'claim it')
        if client not in holder.requests:
            holder.requests.append(client)
        return holder

    def left(self, client: str) -> HeldSeat | None:
        """Remove a client that has gone; return the seat that it held, whose car is stopped."""
        for item in self.held.values():
            item.requests = [other for other in item.requests if other != client]
            if item.offered_to == client:
                item.offered_to = None
        seat = self.seat_of(client)
        if seat is not None:
            del self.held[seat.id]
        return seat

    def document(self, names: Mapping[str, str], lost: Mapping[str, bool],
                 now_s: float = 0.0) -> dict[str, object]:
        """
        Return the seats for the page.

        :param names: names of the clients that may drive, by id.
        :param lost: seats whose driver is silent.
        :param now_s: steady clock [s]
        """
        return {'seats': {name: self._entry(name, names, lost, now_s) for name in self.seats}}

    def _entry(self, name: str, names: Mapping[str, str], lost: Mapping[str, bool],
               now_s: float) -> dict[str, object]:
        entry, held = self.seats[name], self.held.get(name)
        content: dict[str, object] = {
            'source': entry.source, 'driver': short_source(entry.driver),
            'holder': None, 'holder_name': None, 'requests': [], 'others': [], 'kept': None,
            'offer': None, 'ready': entry.here and entry.ready,
            'device': '', 'lost': lost.get(name, False)}
        if held is not None:
            content |= {
                'holder': held.holder, 'holder_name': names.get(held.holder, ''),
                'requests': _people(held.requests, names),
                'others': _people((item for item in names if item != held.holder
                                   and item not in held.requests), names)}
            if held.offered_to is not None:
                content['offer'], = _people([held.offered_to], names)
        elif entry.person is not None and entry.source == COCKPIT:
            left_s = math.ceil(self.kept_for(name, now_s))
            if name not in self.absent_s:
                content |= {'holder': entry.person.id, 'holder_name': entry.person.name}
            elif left_s:
                content['kept'] = {'name': entry.person.name, 'for_s': left_s}
        if entry.person is not None and content['holder'] is not None:
            content['device'] = entry.person.device
        return content

    def _known(self, seat: str) -> SeatEntry:
        if seat not in self.seats:
            raise InputError('there is no such seat', str(seat)[:40],
                             'it has ' + ', '.join(self.seats))
        return self.seats[seat]

    def _offered(self, client: str, seat: str) -> HeldSeat:
        self._known(seat)
        holder = self.held.get(seat)
        if holder is None or holder.offered_to != client:
            raise InputError('the seat is not offered to you any more', seat)
        return holder

    def holding(self, client: str, seat: str) -> HeldSeat:
        """
        Return the seat that a client holds.

        :raises InputError: if it does not.
        """
        self._known(seat)
        holder = self.held.get(seat)
        if holder is None or holder.holder != client:
            raise InputError('you do not have the seat', seat, 'claim it first')
        return holder


@dataclass
class _Order:
    demand: SeatDemand
    ordered_s: float
    sent_s: float


class SeatOrders:
    """
    The seat orders that are not fulfilled yet, to be repeated until they are.

    Until then, `/seats` may still report the earlier state, which does not refute the order.
    """

    def __init__(self) -> None:
        self._orders: dict[str, _Order] = {}

    def __contains__(self, seat: object) -> bool:
        """Return whether an order about a seat is pending."""
        return seat in self._orders

    def note(self, demand: SeatDemand, seats: Seats, now_s: float) -> None:
        """
        Record an order that is sent now: a person takes a seat or gives it back.

        :param seats: content of `/seats`; an order that is already fulfilled needs no answer.
        :param now_s: steady clock [s].
        """
        seat = demand.seat
        if seat in self._orders or not _is_so(demand, seats.get(seat)):
            self._orders[seat] = _Order(demand, now_s, now_s)

    def answered(self, seats: Seats) -> None:
        """Remove the orders that the new content of `/seats` fulfils or makes void."""
        self._orders = {
            seat: order for seat, order in self._orders.items()
            if seat in seats and _after(order.demand, seats[seat]) is not None
            and not _is_so(order.demand, seats[seat])}

    def due(self, now_s: float) -> list[SeatDemand]:
        """Return the orders to send again, and forget those without an answer."""
        self._orders = {seat: order for seat, order in self._orders.items()
                        if now_s - order.ordered_s < GIVE_UP_S}
        due = []
        for order in self._orders.values():
            if now_s - order.sent_s >= AGAIN_S:
                order.sent_s = now_s
                due.append(order.demand)
        return due


def _is_so(demand: SeatDemand, entry: SeatEntry | None) -> bool:
    """Return whether an order is fulfilled."""
    if entry is None:
        return False
    then = _after(demand, entry)
    return then is not None and _driver(then) == _driver(entry)


def _after(demand: SeatDemand, entry: SeatEntry) -> SeatEntry | None:
    """Return the seat after an order; None if a person at another cockpit was first."""
    try:
        # Whether an AV is its planner's or the game's makes no difference here.
        return after(entry, demand, home_of(entry.driver))
    except InputError:
        return None


def _driver(entry: SeatEntry) -> tuple[bool, bool, str | None]:
    """Return what an order about a seat decides: people may change their names meanwhile."""
    return (entry.source == COCKPIT, entry.here,
            None if entry.person is None else entry.person.id)
