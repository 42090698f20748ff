# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live run behind the page: everything the page shows and orders, in one asyncio task."""

import asyncio
from collections.abc import Mapping
import math
from pathlib import Path
import time
from typing import Literal, NamedTuple

from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.page_messages import (
    Command,
    Control,
    Input,
    PlannerSwitch,
    Rate,
    Ready,
    SeenView,
    Sound,
    TaskDone,
    Trigger,
    ViewTold,
)
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.task_documents import TaskReport
from crgame_ros.game.view_documents import ViewPicture
from crgame_ros.nodes.cockpit.feed import CockpitFeed
from crgame_ros.nodes.cockpit.orders import CockpitOrders
from crgame_ros.nodes.cockpit.seat_desk import PeopleFeed, SeatDesk
from crgame_ros.ros.diagnostics import complain, Diagnostics
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.spinning import attempt
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

REPORT_PERIOD_S = 1.0


class _Told(NamedTuple):
    state: Sound | SeenView
    device: str
    at_s: float


class PageReport:
    """Reports of the sound and view of each seat's page: every second and at each change."""

    def __init__(self, diagnostics: Diagnostics) -> None:
        self._diagnostics = diagnostics
        self._told: dict[str, _Told] = {}

    def publish(self, pages: Mapping[str, Client], stamp_ns: int) -> None:
        """
        Publish the states that have changed, and those not published for a second.

        :param pages: by seat.
        :param stamp_ns: simulation time [ns]
        """
        now_s = time.monotonic()
        told = {}
        for seat, client in pages.items():
            for subject, state in ((f'{seat} sound', client.sound), (f'{seat} view', client.view)):
                before = self._told.get(subject)
                if before is not None and (state, client.device) == before[:2] \
                        and now_s - before.at_s < REPORT_PERIOD_S:
                    told[subject] = before
                    continue
                told[subject] = _Told(state, client.device, now_s)
                text, values = _words(state)
                if state is client.view:
                    values['device'] = client.device
                self._diagnostics.publish(f'cockpit_node: {subject}', DiagnosticStatus.OK, text,
                                          values, stamp_ns)
        self._told = told


def _words(state: Sound | SeenView) -> tuple[str, dict[str, object]]:
    if isinstance(state, Sound):
        return 'sounds' if state.on else 'is silent', {
            'on': state.on, 'volume': f'{state.volume:.2f}', 'rumble': f'{state.rumble:.2f}'}
    return f'shows {state.shown or "nothing yet"}', {
        'shown': state.shown, 'inset': state.inset, 'plans': state.plans,
        'mirrors': state.mirrors, 'bare': state.bare, 'across_deg': _number(state.across_deg, 1),
        'screen_width_m': _number(state.screen_width_m, 3),
        'eye_distance_m': _number(state.eye_distance_m, 3),
        'width_px': _number(state.width_px, 0), 'height_px': _number(state.height_px, 0),
        'ratio': _number(state.ratio, 3), 'rate_hz': _number(state.rate_hz, 1),
        'renderer': state.renderer, 'software': state.software, 'away': state.away,
        'full_screen': state.full_screen}


def _number(value: float | None, digits: int) -> str:
    return '' if value is None else f'{value:.{digits}f}'


# Half a cycle at 100 Hz: a state is passed on, and answered with a command, well within it [s].
PERIOD_S = 0.004
# While clients only watch, and while there are none [s].
WATCH_PERIOD_S = 0.01
IDLE_PERIOD_S = 0.05
# Period of the work that may wait: services, names of people, orders without an answer [s].
SERVE_PERIOD_S = 0.1
# Pages tell ten pictures a second [s].
LEAST_PICTURE_S = 0.04
# A client that uploads a game gets its seat if the game begins within this time [s].
BEGINS_WITHIN_S = 60.0
_DEEDS = {'start': 'started the run', 'pause': 'paused the run', 'step': 'stepped through the run',
          'reset': 'reset the run', 'stop': 'stopped the run'}


class LiveBackend:
    """
    The backend of the page of a live run.

    :param runs: folder of the session's files; None where none are kept.
    """

    mode: Literal['live', 'replay'] = 'live'

    def __init__(self, node: Node, runs: Path | None = None) -> None:
        self._node = node
        self._runs = runs
        self._endpoints = Endpoints(node)
        self._orders = CockpitOrders(node, self._endpoints)
        self._page_report = PageReport(self._endpoints.diagnostics)
        self._seat_slot = self._endpoints.polled('/seats')
        self._served_s = 0.0
        self._lost: dict[str, bool] = {}
        # When the last picture of a seat's view was passed on.
        self._pictures_s: dict[str, float] = {}
        self._pump: asyncio.Task[None] | None = None
        # The client that gets a seat in the next game, after which epoch, and until when.
        self._expected: tuple[Client, int, float] | None = None

    async def start(self, hub: Hub) -> None:
        """Start passing the run on to the pages."""
        self._hub = hub
        self._feed = CockpitFeed(self._endpoints, hub, self._runs)
        self._desk = SeatDesk(self._node, self._endpoints, self._orders, hub, self._feed)
        self._people = PeopleFeed(
            self._endpoints, hub, self._desk.table, self._feed.status)
        self._pump = asyncio.create_task(self._run())

    async def stop(self) -> None:
        """Release every seat and end."""
        self._desk.close()
        if self._pump is not None:
            self._pump.cancel()
            await asyncio.gather(self._pump, return_exceptions=True)
        self._orders.close()

    async def _run(self) -> None:
        """Pass the run on until stopped; a failure in one part stops neither it nor the others."""
        while True:
            attempt(self._node, self._pass_on)
            attempt(self._node, self._desk.drive)
            if time.monotonic() - self._served_s >= SERVE_PERIOD_S:
                self._served_s = time.monotonic()
                attempt(self._node, self._serve)
            await asyncio.sleep(self._period_s())

    def _period_s(self) -> float:
        if self._desk.table.held:
            return PERIOD_S
        return WATCH_PERIOD_S if self._hub.clients else IDLE_PERIOD_S

    def _pass_on(self) -> None:
        for problem in self._feed.poll():
            complain(self._node, 'feed', problem[:500], failed=True)
        message = self._seat_slot.latest()
        if message is not None:
            try:
                self._desk.receive_seats(message.data)
            except InputError as error:
                complain(self._node, 'seats', str(error))
        if self._lost != self._feed.status.seats_lost:
            self._lost = dict(self._feed.status.seats_lost)
            self._desk.show()

    def _serve(self) -> None:
        self._orders.serve()
        self._seat_who_chose()
        # People join and change their names.
        self._desk.serve()
        self._people.publish(time.monotonic())
        if self._feed.scenario is not None:
            self._page_report.publish(
                self._pages(), self._feed.scenario.game.scheduler.stamp_ns(self._feed.n))

    def _pages(self) -> dict[str, Client]:
        """Return the page of each seat: its holder's, or that of who first rides in an AV."""
        held, clients = self._desk.table.held, self._hub.clients
        riders: dict[str, Client] = {}
        for client in clients.values():
            stage, rights = client.view.stage, client.rights
            if stage and rights.drives and rights.seat in ('', stage):
                riders.setdefault(stage, client)
        return riders | {
            seat: clients[each.holder] for seat, each in held.items() if each.holder in clients}

    def _seat_who_chose(self) -> None:
        """Seat the client that uploaded the game, now that it has begun."""
        scenario = self._feed.scenario
        if self._expected is None or scenario is None:
            return
        client, epoch, until_s = self._expected
        if scenario.game.epoch > epoch:
            self._expected = None
            if client.id in self._hub.clients:
                self._desk.claim_for(client)
        elif time.monotonic() > until_s:
            self._expected = None

    def joined(self, client: Client) -> None:
        """Set the rate of a new page, and reassign its seat to a client that has come back."""
        self._feed.pace(client)
        self._desk.joined(client)

    def left(self, client: Client) -> None:
        """Release the controls of a page that is gone, at once."""
        self._desk.left(client)

    async def command(self, client: Client, message: Command) -> str:
        """
        Carry out a page's command.

        :raises CrgameError: if it cannot be done.
        """
        match message:
            case Input():
                return self._desk.input(client, message)
            case TaskDone():
                return self._report_task(client, message)
            case ViewTold():
                return self._tell_picture(client, message.picture)
            case Control():
                return await self._control(client, message.action, message.all)
            case Rate():
                await self._orders.set_parameter('real_time_factor', message.factor)
                self._announce(client, f'set the speed of time to × {message.factor:g}')
                return f'real-time factor {message.factor:g}'
            case PlannerSwitch():
                self._known_av(message.av)
                text = await self._orders.run_planner(message.av, message.run)
                self._announce(client, f'let the planner of {message.av} go on' if message.run
                               else f'stopped the planner of {message.av}')
                return text
            case Trigger():
                return self._trigger(client, message.event)
            case _:
                return self._desk.order(client, message)

    async def _control(self, client: Client, action: str, for_all: bool) -> str:
        """Control the run; a start by one of several drivers in seats declares them ready."""
        seat = self._desk.gate_seat(client)
        if action == 'start' and seat is not None and not (for_all and client.rights.directs) \
                and (len(self._desk.cockpit_seats) > 1 or not client.rights.directs):
            return self._desk.order(client, Ready(id=0, seat=seat, ready=True))
        if not client.rights.directs:
            raise CrgameError('only a director can start this run; a driver in its seat says '
                              'that they are ready')
        text = await self._orders.control(action)
        self._announce(client, _DEEDS[action])
        return text

    def _trigger(self, client: Client, event: str) -> str:
        scenario = self._feed.scenario
        game = None if scenario is None else scenario.game
        if game is None or event not in {*(item.name for item in game.events),
                                         *(task.name for task in game.tasks)}:
            raise InputError('is no event or task of this game', event[:40])
        self._orders.trigger(event)
        self._announce(client, f'triggered {event}')
        return f'{event}: triggered'

    def _report_task(self, client: Client, message: TaskDone) -> str:
        """Pass on what the page of a seat has shown, or what its driver has answered."""
        seat, what, scenario = message.seat, message.what, self._feed.scenario
        free = seat not in self._desk.table.held and client.rights.drives
        # Who rides in an AV answers its lights; a request is shown before anybody has the seat.
        rides = scenario is not None and scenario.game.av(seat) is not None \
            and client.rights.seat in ('', seat)
        if not free or not (rides or what == 'shown'):
            self._desk.table.holding(client.id, seat)
        self._orders.report_task(TaskReport(
            seat, message.task, message.number, what, message.times))
        return ''

    def _tell_picture(self, client: Client, picture: ViewPicture) -> str:
        """Pass on what the page of a seat showed where, if the game asks for it."""
        seat, scenario = picture.seat, self._feed.scenario
        game = None if scenario is None else scenario.game
        if game is None or seat not in game.gaze_seats or picture.epoch != game.epoch:
            raise InputError('nobody asks for the pictures of this view', seat)
        if self._pages().get(seat) is not client or client.rights.seat not in ('', seat):
            raise InputError('this is not the page of the driver in this seat', seat)
        now_s = time.monotonic()
        # A page that sends more than it should must not fill the disk.
        if now_s - self._pictures_s.get(seat, -math.inf) >= LEAST_PICTURE_S:
            self._pictures_s[seat] = now_s
            self._orders.tell_picture(picture)
        return ''

    def _known_av(self, av: str) -> None:
        scenario = self._feed.scenario
        if scenario is None or scenario.game.av(av) is None:
            raise InputError('takes no part in this game', av)

    def _announce(self, actor: Client | None, deed: str) -> None:
        """Report an action and its actor to the other clients and to the recording."""
        name = 'a client without a page' if actor is None else actor.name
        self._endpoints.diagnostics.publish(
            'cockpit_node: order', DiagnosticStatus.OK, f'{name} {deed}',
            {'person': '' if actor is None else actor.person})
        for client in tuple(self._hub.clients.values()):
            if client is not actor:
                self._hub.send_event('notice', {'level': 'info', 'text': f'{name} {deed}'},
                                     only=client)

    async def load_game(self, path: Path, client: Client | None = None, *,
                        takes_seat: bool = False) -> str:
        """
        Load a game, and reset the run so that the game begins.

        :raises CrgameError: if the simulation refuses it.
        """
        await self._orders.set_parameter('game', str(path))
        if client is not None and takes_seat:
            epoch = -1 if self._feed.scenario is None else self._feed.scenario.game.epoch
            self._expected = (client, epoch, time.monotonic() + BEGINS_WITHIN_S)
        text = await self._orders.control('reset')
        self._announce(client, 'chose what is run')
        return text
