# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Orders about seats that `/seats` has not answered yet."""

from collections.abc import Mapping
from dataclasses import dataclass

from crgame_ros.driver.source import COCKPIT

# An order that is published while the simulation loads another game reaches nobody [s].
AGAIN_S = 0.5
GIVE_UP_S = 10.0

Seats = Mapping[str, Mapping[str, str]]


@dataclass
class _Order:
    source: str
    ordered_s: float
    sent_s: float


class SeatOrders:
    """
    Remembers what was ordered until it is so, and what has to be ordered again.

    Until then `/seats` may still tell of the time before, which says nothing against the order.
    """

    def __init__(self) -> None:
        self._orders: dict[str, _Order] = {}

    def __contains__(self, seat: object) -> bool:
        """Tell whether an order about a seat is on its way."""
        return seat in self._orders

    def note(self, seat: str, source: str, seats: Seats, now_s: float) -> None:
        """
        Remember an order that is sent now.

        :param source: cockpit, or game: back to the driver or planner of the game.
        :param seats: what `/seats` says; what is already so needs no answer.
        :param now_s: steady clock [s].
        """
        if seat in self._orders or not _is_so(source, seats.get(seat)):
            self._orders[seat] = _Order(source, now_s, now_s)

    def answered(self, seats: Seats) -> None:
        """Take what `/seats` says anew."""
        self._orders = {seat: order for seat, order in self._orders.items()
                        if seat in seats and not _is_so(order.source, seats[seat])}

    def due(self, now_s: float) -> list[tuple[str, str]]:
        """
        Give the orders (seat, source) to send again, and forget those without an answer.

        :param now_s: steady clock [s].
        """
        self._orders = {seat: order for seat, order in self._orders.items()
                        if now_s - order.ordered_s < GIVE_UP_S}
        due = []
        for seat, order in self._orders.items():
            if now_s - order.sent_s >= AGAIN_S:
                order.sent_s = now_s
                due.append((seat, order.source))
        return due


def _is_so(source: str, entry: Mapping[str, str] | None) -> bool:
    """Tell whether a seat is as ordered."""
    if entry is None:
        return False
    drives = entry['source'] == COCKPIT
    # Given back in a game whose driver is the cockpit, the seat stays the cockpit's.
    return drives if source == COCKPIT else not drives or entry['driver'] == COCKPIT
