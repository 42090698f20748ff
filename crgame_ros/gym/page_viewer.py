# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Shows an environment on the cockpit's page (`render_mode='human'`).

The server listens on loopback, in a thread beside the environment's. The page shows the agent in
real time. Users cannot steer there: only the agent drives.
"""

import asyncio
from collections.abc import Callable
import sys
import threading
import time
from typing import Literal

from crgame_ros.cockpit import frames
from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.message_frames import state_rows
from crgame_ros.cockpit.page_messages import Command
from crgame_ros.cockpit.run_status import RunStatus
from crgame_ros.cockpit.scene import scene_document
from crgame_ros.cockpit.server import create_app, listen
from crgame_ros.errors import CrgameError
from crgame_ros.gym.av_pilot import stacked
from crgame_ros.gym.driving_game import DrivingGame
from crgame_ros.messages.status_values import Status
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import Setup
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS
from crgame_ros.vehicle.state import StateColumn
import numpy as np

# Where the page is; if the port is taken, at the next free one.
HOST, PORT = '127.0.0.1', 8080
# An environment that is late by more than this does not catch up [s].
_PATIENCE_S = 0.5
_WATCH_ONLY = 'This is an environment: its agent drives, and nothing in it can be changed here.'


class EnvironmentBackend:
    """The backend of the page, which shows what the environment's thread sends."""

    mode: Literal['live', 'replay'] = 'live'

    def __init__(self) -> None:
        self.hub: Hub | None = None

    async def start(self, hub: Hub) -> None:
        """Store the hub that serves the clients."""
        self.hub = hub

    async def stop(self) -> None:
        """Do nothing: the environment continues."""

    async def command(self, client: Client, message: Command) -> str:
        """
        Refuse the command, because the agent drives.

        :raises CrgameError: always.
        """
        raise CrgameError(_WATCH_ONLY)

    def joined(self, client: Client) -> None:
        """Do nothing: all clients see the same."""

    def left(self, client: Client) -> None:
        """Do nothing."""

    async def load_game(self, path: object, client: object = None, *,
                        takes_seat: bool = False) -> str:
        """
        Refuse to load a game, because the environment defines it.

        :raises CrgameError: always.
        """
        raise CrgameError(_WATCH_ONLY)


class PageViewer:
    """
    The server of the page, which shows a game in real time.

    :ivar url: address of the page.
    """

    def __init__(self) -> None:
        self._backend = EnvironmentBackend()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name='page', daemon=True)
        self._thread.start()
        access = Access(HOST, PORT)
        try:
            self._runner, port = asyncio.run_coroutine_threadsafe(listen(
                create_app(self._backend, access, None), HOST, PORT), self._loop).result()
        except BaseException:
            self._end_thread()
            raise
        self.url = access.at_port(port).url
        self._epoch = 0
        # Of the state shown last: when it was due, and its simulated time.
        self._due_s = self._shown_s = 0.0
        self._status = RunStatus()
        print(f'the environment is shown at {self.url}', file=sys.stderr, flush=True)

    def begin(self, game: DrivingGame) -> None:
        """Show another episode."""
        self._epoch += 1
        self._due_s, self._shown_s = time.monotonic(), 0.0
        setup = game.setup
        document = describe_game(setup, epoch=self._epoch)
        scene = scene_document(setup.loaded, setup.descriptions, document)
        self._status.begin(setup.vehicle_ids)
        self._status.add(Status('sim_node: run', 0, 'running', {}), 0.0)
        for seat in game.seats:
            # The agent replaces the game's driver or planner.
            scene['drivers' if seat.pilot is None else 'planners'][seat.id] = 'agent'
        self._run_on_page(lambda hub: hub.set_document('scene', scene))
        self._run_on_page(lambda hub: hub.set_document('events', {'fired': []}))
        self._run_on_page(lambda hub: hub.set_document('seats', {'seats': {}}))

    def show(self, game: DrivingGame) -> None:
        """Show the current state, after waiting for its time."""
        self._due_s += game.time_s - self._shown_s
        self._shown_s = game.time_s
        now_s = time.monotonic()
        if now_s - self._due_s > _PATIENCE_S:
            self._due_s = now_s
        time.sleep(max(0.0, self._due_s - now_s))
        scheduler, n = game.simulation.scheduler, game.simulation.n
        place = frames.Place(self._epoch, n, scheduler.k(n), n * scheduler.dt_s)
        objects = game.objects
        commands = np.array(game.simulation.command_rows, dtype=np.float64).reshape(
            -1, len(COMMAND_COLUMNS))
        made = {
            'state': frames.encode_state(place, state_rows(
                stacked(game.simulation.states), commands)),
            'objects': frames.encode_objects(place, np.concatenate(
                (objects.poses, objects.velocities), axis=1)),
            **_plans(game, place)}
        for seat in game.seats:
            self._status.add(Status(f'{seat.id}/drivability', 0, '', {
                'collision': str(bool(seat.hit)).lower(), 'hit': ','.join(seat.hit)}), place.t)
        status = {**self._status.document(), 't': place.t, 'n': n, 'k': place.k,
                  'epoch': self._epoch, 'measured_factor': None, 'frames_skipped': False,
                  'clients': 0}
        alarms = self._status.alarms_document()

        def send(hub: Hub) -> None:
            for slot, frame in made.items():
                hub.send_frame(slot, frame)
            hub.set_document('status', {**status, 'clients': len(hub.clients)})
            hub.set_document('alarms', alarms)

        self._run_on_page(send)

    def close(self) -> None:
        """Stop the server and its thread."""
        asyncio.run_coroutine_threadsafe(self._runner.cleanup(), self._loop).result()
        self._end_thread()

    def _run_on_page(self, what: Callable[[Hub], object]) -> None:
        hub = self._backend.hub
        assert hub is not None
        self._loop.call_soon_threadsafe(what, hub)

    def _end_thread(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()


def _plans(game: DrivingGame, place: frames.Place) -> dict[str, bytes]:
    """Return the frames of the plans that AVs follow."""
    setup: Setup = game.setup
    made = {}
    for index, av in enumerate(game.simulation.avs):
        if av.plan is None or av.driven:
            continue
        column = len(setup.humans) + index
        states = av.plan.states
        age_s = 1e-9 * (game.simulation.scheduler.stamp_ns(place.n) - av.plan.stamp_ns)
        rows = np.column_stack((
            states[:, :StateColumn.SPEED + 1],
            np.arange(len(states)) * setup.scheduler.time_step_s - age_s))
        rows[:, :3] = av.setup.transform.to_simulation(rows[:, :3])
        made[f'plan:{column}'] = frames.encode_plan(place, column, rows)
    return made
