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
"""The cockpit of a live run: what pages ask for becomes messages to the graph."""

import asyncio
from collections.abc import Mapping
from pathlib import Path
import time
from typing import Any, Literal

from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.seat_orders import SeatOrders
from crgame_ros.cockpit.seat_table import HeldSeat, SeatTable
from crgame_ros.driver.source import COCKPIT
from crgame_ros.errors import InputError
from crgame_ros.game.documents import parse_seats_document
from crgame_ros.nodes.cockpit.cockpit_feed import CockpitFeed
from crgame_ros.nodes.cockpit.cockpit_orders import CockpitOrders
from crgame_ros.nodes.cockpit.sound_report import SoundReport
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.ros_messages import to_joy
from crgame_ros.ros.seats import GAME
from crgame_ros.ros.spinning import attempt
from crgame_ros.vehicle.driver_command import DriverCommand
from rclpy.node import Node
from rclpy.publisher import Publisher

# Half a cycle at 100 Hz: a state is passed on, and answered with a command, well within it [s].
PERIOD_S = 0.004
# While people only watch, and while nobody does [s].
WATCH_PERIOD_S = 0.01
IDLE_PERIOD_S = 0.05
# Between two looks at what may wait: services, names of people, orders without an answer [s].
SERVE_PERIOD_S = 0.1
# Of one line about messages that cannot be read: peers repeat them [s].
COMPLAIN_S = 1.0


class LiveBackend:
    """
    Stands behind the page of a live run.

    :param node: owner of the endpoints.
    :param runs: folder of the session's files; None where nobody keeps any.
    """

    mode: Literal['live', 'replay'] = 'live'

    def __init__(self, node: Node, runs: Path | None = None) -> None:
        self._node = node
        self._runs = runs
        self._endpoints = Endpoints(node)
        self._orders = CockpitOrders(node, self._endpoints)
        self._sound_report = SoundReport(self._endpoints.diagnostics)
        self._seat_slot = self._endpoints.polled('/seats')
        self._commands: dict[str, Publisher] = {}
        self._table = SeatTable()
        self._awaited = SeatOrders()
        self._driven_n = 0
        self._served_s = 0.0
        self._lost: dict[str, bool] = {}
        self._pump: asyncio.Task[None] | None = None

    async def start(self, hub: Hub) -> None:
        """Begin to pass the run on."""
        self._hub = hub
        self._feed = CockpitFeed(self._endpoints, hub, self._runs)
        self._pump = asyncio.create_task(self._run())

    async def stop(self) -> None:
        """Let go of every seat and end."""
        for seat in list(self._table.held.values()):
            self._let_go(seat)
        if self._pump is not None:
            self._pump.cancel()
            await asyncio.gather(self._pump, return_exceptions=True)
        self._orders.close()

    async def _run(self) -> None:
        """Pass the run on until stopped; no part ends it or keeps the others from their work."""
        while True:
            attempt(self._node, self._pass_on)
            attempt(self._node, self._drive)
            if time.monotonic() - self._served_s >= SERVE_PERIOD_S:
                self._served_s = time.monotonic()
                attempt(self._node, self._serve)
            await asyncio.sleep(self._period_s())

    def _period_s(self) -> float:
        if self._table.held:
            return PERIOD_S
        return WATCH_PERIOD_S if self._hub.clients else IDLE_PERIOD_S

    def _pass_on(self) -> None:
        for problem in self._feed.poll():
            self._node.get_logger().error(problem[:500], throttle_duration_sec=COMPLAIN_S)
        message = self._seat_slot.latest()
        if message is not None:
            self._take_seats(message.data)
        if self._lost != self._feed.status.seats_lost:
            self._lost = dict(self._feed.status.seats_lost)
            self._show_seats()

    def _serve(self) -> None:
        self._orders.serve()
        for seat, source in self._awaited.due(time.monotonic()):
            self._orders.order_seat(seat, source)
        self._table.update(self._table.seats, self._awaited)
        # People come and change their names.
        self._show_seats()
        if self._feed.scenario is not None:
            self._sound_report.tell(
                self._table.held.values(), self._hub.clients,
                self._feed.scenario.game.scheduler.stamp_ns(self._feed.n))

    def _drive(self) -> None:
        """Send the command of each held seat for a new cycle; let go of silent ones."""
        now_s = time.monotonic()
        new_cycle, self._driven_n = self._feed.n != self._driven_n, self._feed.n
        for seat in self._table.held.values():
            if seat.is_silent(now_s):
                self._let_go(seat)
            elif new_cycle and not seat.away:
                self._publish(seat)

    def _let_go(self, seat: HeldSeat) -> None:
        """Say once that the hands are off; then silence, on which the seat's watchdog brakes."""
        seat.let_go()
        self._publish(seat)

    def _publish(self, seat: HeldSeat) -> None:
        scenario = self._feed.scenario
        if scenario is None or self._table.seats.get(seat.id, {}).get('source') != COCKPIT:
            return
        scheduler = scenario.game.scheduler
        command: DriverCommand = seat.command(self._feed.n, scheduler.dt_s)
        self._commands[seat.id].publish(
            to_joy(command, scheduler.stamp_ns(self._feed.n), COCKPIT))

    def _take_seats(self, text: str) -> None:
        try:
            seats = parse_seats_document(text)
        except InputError as error:
            self._node.get_logger().warning(str(error), throttle_duration_sec=COMPLAIN_S)
            return
        self._awaited.answered(seats)
        self._table.update(seats, self._awaited)
        # Ahead of the first claim: a new publisher takes a while to be discovered.
        for name in seats.keys() - self._commands.keys():
            self._commands[name] = self._endpoints.publisher('/<v>/driver_command', name)
        for name in self._commands.keys() - seats.keys():
            self._node.destroy_publisher(self._commands.pop(name))
        self._show_seats()

    def _show_seats(self) -> None:
        names = {client.id: client.name for client in self._hub.clients.values()}
        self._hub.set_document(
            'seats', self._table.document(names, self._feed.status.seats_lost))
        for client in self._hub.clients.values():
            client.drives = self._table.seat_of(client.id) is not None
            self._feed.pace(client)

    def joined(self, client: Client) -> None:
        """Set the pace of a new page."""
        self._feed.pace(client)

    def left(self, client: Client) -> None:
        """Take the hands of a page that is gone off the controls, at once."""
        seat = self._table.left(client.id)
        if seat is not None:
            self._let_go(seat)
        self._show_seats()

    async def command(self, client: Client, message: Mapping[str, Any]) -> str:
        """
        Do what a page asks.

        :raises CrgameError: if it cannot be done.
        """
        kind = message['type']
        if kind == 'input':
            return self._input(client, message)
        if kind == 'control':
            return await self._orders.control(message['action'])
        if kind == 'rate':
            await self._orders.set_parameter('real_time_factor', float(message['factor']))
            return f'real-time factor {message["factor"]:g}'
        if kind == 'planner':
            self._known_av(message['av'])
            return await self._orders.run_planner(message['av'], message['run'])
        if kind == 'trigger':
            return self._trigger(message['event'])
        return self._seat_order(kind, client, message)

    def _input(self, client: Client, message: Mapping[str, Any]) -> str:
        seat = self._table.held.get(message['seat'])
        if seat is None or seat.holder != client.id:
            raise InputError('you do not have the seat', message['seat'], 'claim it first')
        seat.take(message, time.monotonic())
        self._publish(seat)
        return ''

    def _trigger(self, event: str) -> str:
        scenario = self._feed.scenario
        events = () if scenario is None else scenario.game.events
        if event not in {item.name for item in events}:
            raise InputError('is no event of this game', event[:40])
        self._orders.trigger(event)
        return f'{event}: triggered'

    def _known_av(self, av: str) -> None:
        scenario = self._feed.scenario
        if scenario is None or scenario.game.av(av) is None:
            raise InputError('takes no part in this game', av)

    def _seat_order(self, kind: str, client: Client, message: Mapping[str, Any]) -> str:
        seat, names = message['seat'], {
            other.id: other.name for other in self._hub.clients.values()}
        if kind == 'claim':
            before = self._table.seat_of(client.id)
            self._table.claim(client.id, seat, names)
            if before is not None and before.id != seat:
                self._release(client, before.id)
            self._order(seat, COCKPIT)
            text = f'you drive {seat}'
        elif kind == 'release':
            self._release(client, seat)
            text = f'{seat} is given back'
        elif kind == 'hand_over':
            text = self._hand_over(client, seat, message['to'], names)
        elif kind == 'ask':
            self._table.ask(client.id, seat)
            text = f'{names.get(self._table.held[seat].holder, "")} was asked for {seat}'
        else:
            raise InputError('cannot be done in a live run', str(kind))
        self._show_seats()
        return text

    def _hand_over(self, client: Client, seat: str, to: str, names: Mapping[str, str]) -> str:
        if to not in names:
            raise InputError('is not here any more', to)
        held = self._table.held.get(seat)
        taken = self._table.seat_of(to)
        self._table.hand_over(client.id, seat, to)
        if held is not None:
            self._let_go(held)
        if taken is not None and taken.id != seat:
            self._let_go(taken)
            self._table.held.pop(taken.id, None)
            self._order(taken.id, GAME)
        return f'{names[to]} drives {seat}'

    def _release(self, client: Client, seat: str) -> None:
        held = self._table.release(client.id, seat)
        if held is not None:
            self._let_go(held)
        self._order(seat, GAME)

    def _order(self, seat: str, source: str) -> None:
        self._orders.order_seat(seat, source)
        self._awaited.note(seat, source, self._table.seats, time.monotonic())

    async def load_game(self, path: Path) -> str:
        """
        Begin a game: it is taken at a reset.

        :raises CrgameError: if the simulation refuses it.
        """
        await self._orders.set_parameter('game', str(path))
        return await self._orders.control('reset')
