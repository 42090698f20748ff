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
"""Who in the browser holds which seat, and what their hands make of it."""

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from crgame_ros.driver.indicator_lever import IndicatorLever, LightButtons
from crgame_ros.driver.keyboard import KeyboardCycles, KeyState
from crgame_ros.driver.source import COCKPIT
from crgame_ros.errors import InputError
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED

# A page repeats its input every 50 ms; silent for longer, it counts as gone [s].
SILENCE_S = 0.2
# What the page says of the lever and the horn: which of left, right, hazard and horn are held.
_LIGHTS = LightButtons(*(frozenset({i}) for i in range(4)))


class HeldSeat:
    """
    A seat that somebody in the browser holds.

    Keys go through the keyboard filter (CRG 18-19) in simulation time, axes are taken as the
    page calibrated them (CRG 17).

    :param seat_id: the vehicle.
    :param holder: id of the client.
    """

    def __init__(self, seat_id: str, holder: str) -> None:
        self.id = seat_id
        self.holder = holder
        self.requests: list[str] = []
        self._cycles = KeyboardCycles()
        self._lever = IndicatorLever(_LIGHTS)
        self._keys: KeyState | None = None
        self._axes: DriverCommand | None = None
        self._heard_s = 0.0
        self.away = True

    def take(self, message: Mapping[str, Any], now_s: float) -> None:
        """
        Take an input message of the holder, already checked.

        :param now_s: steady clock [s]
        """
        self._heard_s = now_s
        reverse = bool(message.get('reverse'))
        keys, axes = message.get('keys'), message.get('axes')
        self.away = keys is None and axes is None
        self._lever.hold(i for i, held in enumerate(message.get('lights', ())) if held)
        if self.away:
            self.let_go()
        elif axes is not None:
            throttle, brake, steering = axes
            self._keys, self._axes = None, DriverCommand(throttle, brake, steering, reverse)
        elif keys is not None:
            throttle, brake, left, right = map(bool, keys)
            self._keys, self._axes = KeyState(throttle, brake, left, right, reverse), None

    def let_go(self) -> None:
        """Take the hands off everything at once."""
        self.away = True
        self._keys = self._axes = None
        self._cycles.reset()
        self._lever.hold(())

    def is_silent(self, now_s: float) -> bool:
        """Tell whether the page has not been heard for too long."""
        return not self.away and now_s - self._heard_s > SILENCE_S

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """
        Give the command of cycle n; while nobody is there it is released, but for the indicators.

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
        return command._replace(lights=self._lever.lights)


def _people(clients: Iterable[str], names: Mapping[str, str]) -> list[dict[str, str]]:
    return [{'client': item, 'name': names.get(item, '')} for item in clients]


def short_source(driver: str) -> str:
    """Name a driver source by its file's name alone: pages need not know the folders here."""
    kind, colon, argument = driver.partition(':')
    return f'{kind}{colon}{PurePath(argument).name}' if colon else driver


@dataclass
class SeatTable:
    """
    The seats of a run as the browser sees them.

    :param seats: what `/seats` says: source and driver by vehicle.
    :param held: the seats that somebody here holds.
    """

    seats: dict[str, dict[str, str]] = field(default_factory=dict)
    held: dict[str, HeldSeat] = field(default_factory=dict)

    def update(self, seats: Mapping[str, Mapping[str, str]],
               awaited: Container[str] = ()) -> list[HeldSeat]:
        """
        Take what `/seats` says.

        :param awaited: seats about which an order is on its way: what is said of them is old.
        :return: the seats that somebody outside has taken away, which are no longer held.
        """
        self.seats = {name: dict(entry) for name, entry in seats.items()}
        gone = [item for name, item in self.held.items()
                if name not in self.seats or (
                    name not in awaited and self.seats[name]['source'] != COCKPIT)]
        for item in gone:
            del self.held[item.id]
        return gone

    def seat_of(self, client: str) -> HeldSeat | None:
        """Find the seat that a client holds."""
        return next((item for item in self.held.values() if item.holder == client), None)

    def claim(self, client: str, seat: str, names: Mapping[str, str]) -> HeldSeat:
        """
        Give a free seat to a client; one that it held before has to be left first.

        :param names: of the clients by id, for messages.
        :raises InputError: if there is no such seat or somebody holds it.
        """
        self._known(seat)
        holder = self.held.get(seat)
        if holder is not None and holder.holder != client:
            raise InputError(f'{names.get(holder.holder, "somebody")} has the seat', seat,
                             'ask for it')
        if holder is None:
            holder = self.held[seat] = HeldSeat(seat, client)
        return holder

    def release(self, client: str, seat: str) -> HeldSeat | None:
        """
        Give a seat back to the driver or planner of the game.

        Anybody may do that with a seat that has been left.

        :return: the seat as it was held, None if nobody held it.
        :raises InputError: if somebody else holds it or nobody ever took it.
        """
        entry = self._known(seat)
        holder = self.held.get(seat)
        if holder is not None and holder.holder != client:
            raise InputError('somebody else has the seat', seat, 'ask for it')
        if holder is None and entry.get('source') != COCKPIT:
            raise InputError('nobody here has the seat', seat)
        return self.held.pop(seat, None)

    def hand_over(self, client: str, seat: str, to: str) -> HeldSeat:
        """
        Hand a seat to another client.

        :raises InputError: if the client does not hold it.
        """
        holder = self._of(client, seat)
        other = self.held[seat] = HeldSeat(seat, to)
        other.requests = [item for item in holder.requests if item != to]
        return other

    def ask(self, client: str, seat: str) -> HeldSeat:
        """
        Note that a client wants a seat that somebody holds.

        :raises InputError: if nobody holds it.
        """
        self._known(seat)
        holder = self.held.get(seat)
        if holder is None or holder.holder == client:
            raise InputError('the seat is free', seat, 'claim it')
        if client not in holder.requests:
            holder.requests.append(client)
        return holder

    def left(self, client: str) -> HeldSeat | None:
        """
        Forget a client that is gone: its car is stopped, and anybody may claim the seat.

        :return: the seat that it held.
        """
        for item in self.held.values():
            item.requests = [other for other in item.requests if other != client]
        seat = self.seat_of(client)
        if seat is not None:
            del self.held[seat.id]
        return seat

    def document(self, names: Mapping[str, str], lost: Mapping[str, bool]) -> dict[str, Any]:
        """
        Give the seats for the page.

        :param names: of the clients by id.
        :param lost: seats whose driver is silent.
        """
        seats: dict[str, Any] = {}
        for name, entry in self.seats.items():
            held = self.held.get(name)
            seats[name] = {
                'source': entry.get('source', ''), 'driver': short_source(entry.get('driver', '')),
                'holder': None if held is None else held.holder,
                'holder_name': None if held is None else names.get(held.holder, ''),
                'requests': [] if held is None else _people(held.requests, names),
                'others': [] if held is None else _people(
                    (item for item in names if item != held.holder
                     and item not in held.requests), names),
                'lost': lost.get(name, False)}
        return {'seats': seats}

    def _known(self, seat: str) -> dict[str, str]:
        if seat not in self.seats:
            raise InputError('there is no such seat', str(seat)[:40],
                             'it has ' + ', '.join(self.seats))
        return self.seats[seat]

    def _of(self, client: str, seat: str) -> HeldSeat:
        self._known(seat)
        holder = self.held.get(seat)
        if holder is None or holder.holder != client:
            raise InputError('you do not have the seat', seat, 'claim it first')
        return holder
