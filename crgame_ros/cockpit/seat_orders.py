# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Seat orders that the simulation has not confirmed yet."""

from collections.abc import Mapping
from dataclasses import dataclass

from crgame_ros.driver.seat_state import after, home_of
from crgame_ros.driver.source import COCKPIT
from crgame_ros.errors import InputError
from crgame_ros.game.seat_documents import SeatDemand, SeatEntry

# Interval of repetition [s]: an order sent while the simulation loads another game is lost.
AGAIN_S = 0.5
GIVE_UP_S = 10.0

Seats = Mapping[str, SeatEntry]


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
            if seat in seats and not _is_so(order.demand, seats[seat])
            and not _is_in_vain(order.demand, seats[seat])}

    def due(self, now_s: float) -> list[SeatDemand]:
        """
        Return the orders to send again, and forget those without an answer.

        :param now_s: steady clock [s].
        """
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


def _is_in_vain(demand: SeatDemand, entry: SeatEntry) -> bool:
    """Return whether an order is refused, because a person at another cockpit was first."""
    return _after(demand, entry) is None


def _after(demand: SeatDemand, entry: SeatEntry) -> SeatEntry | None:
    try:
        # Whether an AV is its planner's or the game's makes no difference here.
        return after(entry, demand, home_of(entry.driver))
    except InputError:
        return None


def _driver(entry: SeatEntry) -> tuple[bool, bool, str | None]:
    """Return what an order about a seat decides: people may change their names meanwhile."""
    return (entry.source == COCKPIT, entry.here,
            None if entry.person is None else entry.person.id)
