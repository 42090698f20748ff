# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The real server of the cockpit, serving a precomputed run."""

import asyncio
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
import json
from pathlib import Path
import threading
import time
from typing import Any, Literal

from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.frames import (
    encode_objects,
    encode_plan,
    encode_state,
    Place,
    STATE_COLUMNS,
)
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.page_messages import Command, Control, Rate
from crgame_ros.cockpit.scene import scene_document
from crgame_ros.cockpit.server import create_app, listen
from crgame_ros.game.game import load_game
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup
import numpy as np
from numpy.typing import NDArray

HOST = '127.0.0.1'
FloatArray = NDArray[np.float64]


class RecordedRun:
    """
    A game's run, computed offline: (n, V, 13) states at all steps, (ticks, M, 6) objects.

    :param path: game file.
    :param duration_s: simulated.
    """

    def __init__(self, path: Path, duration_s: float) -> None:
        setup = build_setup(load_game(path))
        result = run_offline(setup, duration_s=duration_s)
        self.dt_s = setup.scheduler.dt_s
        self.steps_per_tick = setup.scheduler.steps_per_tick
        game = describe_game(setup)
        self.scene = scene_document(setup.loaded, setup.descriptions, game)
        count, vehicles, columns = result.vehicle_states.shape
        self.states: FloatArray = np.full((count, vehicles, STATE_COLUMNS), np.nan)
        self.states[:, :, :columns] = result.vehicle_states
        self.states[:, :, 8:] = result.commands[:, :, :STATE_COLUMNS - 8]
        self.objects: FloatArray = np.concatenate(
            (result.object_poses, result.object_velocities), axis=2)


def large_scene(run: RecordedRun) -> dict[str, object]:
    """Make 100 curved roads of four lanes with 60 cars."""
    lanelets = []
    for index in range(400):
        road, lane = divmod(index, 4)
        x0, y0 = 60.0 * (road % 10), 60.0 * (road // 10) + 3.5 * lane
        s = np.linspace(0.0, 55.0, 30)

        def flat(offset: float, x0: float = x0, y0: float = y0,
                 s: np.ndarray = s) -> list[float]:
            return np.column_stack((x0 + s, y0 + offset + 3.0 * np.sin(s / 10.0))).ravel().tolist()

        lanelets.append({
            'id': index, 'left': flat(3.5), 'right': flat(0.0), 'center': flat(1.75),
            'types': ['urban'], 'left_line': 'solid' if lane == 3 else 'dashed',
            'right_line': 'solid' if lane == 0 else 'dashed', 'one_way': True,
            'speed_limit': None, 'intersection': False,
            'adj_left': index + 1 if lane < 3 else None, 'adj_left_same': lane < 3,
            'adj_right': index - 1 if lane else None, 'adj_right_same': lane > 0,
            'successors': []})
    cars = [{'id': f'o{i}', 'type': 'car', 'role': 'recorded',
             'shape': {'kind': 'rectangle', 'length': 4.5, 'width': 1.8, 'vertices': []}}
            for i in range(60)]
    return run.scene | {'id': 'large', 'lanelets': lanelets, 'objects': cars, 'goals': [],
                        'stop_lines': [], 'bounds': [0.0, -5.0, 600.0, 560.0]}


class RunBackend:
    """
    Sends the run's frames, as a live backend does, and obeys pause, start, step and reset.

    :param run: the sent run.
    :param every: simulation steps between two STATE frames.
    :param jitter_s: each STATE frame is late by up to this.
    """

    mode: Literal['live', 'replay'] = 'live'

    def __init__(self, run: RecordedRun, every: int = 1, jitter_s: float = 0.0) -> None:
        self.run = run
        self.every, self.jitter_s = every, jitter_s
        self.state = 'paused'
        self.stalled = False
        self.factor = 1.0
        # The words of the status.
        self.drivability: dict[str, dict[str, Any]] = {}
        self.n = self.epoch = 0
        self.messages: list[Mapping[str, Any]] = []
        self._random = np.random.default_rng(1)
        self._tasks: set[asyncio.Task[None]] = set()

    async def start(self, hub: Hub) -> None:
        self.hub = hub
        hub.set_document('scene', self.run.scene)
        hub.set_document('seats', {'seats': {}})
        self._status()
        self.send_now()
        self._tasks.add(asyncio.create_task(self._pump()))

    async def stop(self) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def command(self, client: Client, message: Command) -> str:
        self.messages.append(message.model_dump(mode='json', exclude_unset=True))
        if isinstance(message, Rate):
            self.factor = message.factor
        match getattr(message, 'action', ''):
            case 'start':
                self.state = 'running'
            case 'pause':
                self.state = 'paused'
            case 'step':
                self._advance()
            case 'reset':
                self.n, self.epoch = 0, self.epoch + 1
                time_entry = self.run.scene['time'] | {'epoch': self.epoch}
                self.hub.set_document('scene', self.run.scene | {'time': time_entry})
                self.send_now()
        self._status()
        return 'done'

    def joined(self, client: Client) -> None:
        client.drives = True
        self.send_now()

    def left(self, client: Client) -> None:
        pass

    async def load_game(self, path: Path, client: Client | None = None, *,
                        takes_seat: bool = False) -> str:
        raise NotImplementedError

    def send_plan(self, vehicle: int, points: FloatArray) -> None:
        """Send a plan that begins now."""
        self.hub.send_frame(f'plan:{vehicle}', encode_plan(
            Place(self.epoch, self.n, 0, self.n * self.run.dt_s), vehicle, points))

    async def _pump(self) -> None:
        due = time.perf_counter()
        while True:
            due = max(due + self.run.dt_s / self.factor, time.perf_counter() - 0.1)
            await asyncio.sleep(max(due - time.perf_counter(), 0.0))
            if self.state == 'running' and not self.stalled \
                    and self.n + 1 < len(self.run.states):
                self._advance()

    def _advance(self) -> None:
        self.n += 1
        if self.n % 20 == 0:
            self._status()
        due = self.n % self.every == 0 or self.n % self.run.steps_per_tick == 0
        if due or self.state == 'paused':
            late_s = self._random.uniform(0.0, self.jitter_s)
            frames = self._frames()
            asyncio.get_running_loop().call_later(late_s, self._deliver, frames)

    def send_now(self) -> None:
        """Send the state and the objects of this moment."""
        self._deliver(self._frames(everything=True))

    def _deliver(self, frames: dict[str, bytes]) -> None:
        for slot, frame in frames.items():
            self.hub.send_frame(slot, frame)

    def _frames(self, everything: bool = False) -> dict[str, bytes]:
        tick, rest = divmod(self.n, self.run.steps_per_tick)
        t = self.n * self.run.dt_s
        frames = {'state': encode_state(
            Place(self.epoch, self.n, tick, t), self.run.states[self.n])}
        if rest == 0 or everything:
            n = tick * self.run.steps_per_tick
            frames['objects'] = encode_objects(
                Place(self.epoch, n, tick, n * self.run.dt_s), self.run.objects[tick])
        return frames

    def _status(self) -> None:
        self.hub.set_document('status', {
            'run': self.state, 't': self.n * self.run.dt_s, 'n': self.n,
            'k': self.n // self.run.steps_per_tick, 'epoch': self.epoch,
            'real_time_factor': self.factor, 'measured_factor': self.factor,
            'frames_skipped': False, 'timing': None, 'planners': {},
            'drivability': self.drivability,
            'recording': {'state': 'none', 'messages': 0, 'megabytes': 0, 'text': ''},
            'seats_lost': {}, 'clients': 1})


class Served:
    """A backend behind a listening server, in a thread of its own."""

    def __init__(self, backend: RunBackend, loop: asyncio.AbstractEventLoop, port: int) -> None:
        self.backend, self._loop = backend, loop
        self.address = f'http://{HOST}:{port}/'

    def call(self, function: Any, *arguments: Any) -> None:
        """Call a function of the backend in its thread."""
        self._loop.call_soon_threadsafe(function, *arguments)

    def control(self, action: Literal['start', 'pause', 'step', 'reset', 'stop']) -> None:
        """Start, pause, step or reset, as a client would."""
        message = Control(id=0, action=action)
        asyncio.run_coroutine_threadsafe(
            self.backend.command(next(iter(self.backend.hub.clients.values())), message),
            self._loop).result(10.0)

    def publish(self, kind: str, content: Mapping[str, Any]) -> None:
        """Set a document."""
        self.call(self.backend.hub.set_document, kind, json.loads(json.dumps(content)))


@contextmanager
def served(backend: RunBackend, framed_by: str = '') -> Iterator[Served]:
    """Serve the page and a backend as the cockpit does; one origin may frame the page."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()

    def wait(coroutine: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(coroutine, loop).result(30.0)

    app = create_app(backend, Access(HOST, 0, None), None, framed_by=framed_by)
    runner, port = wait(listen(app, HOST, 0))
    try:
        yield Served(backend, loop, port)
    finally:
        wait(runner.cleanup())
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
