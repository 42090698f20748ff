# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shared helpers of the cockpit server's tests: a sending backend, a listening server."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
import functools
import json
import logging
from pathlib import Path
from typing import Any, Literal

from aiohttp import ClientSession, ClientWebSocketResponse, CookieJar, WSMsgType
from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.frames import encode_state, Place
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.library import Library
from crgame_ros.cockpit.page_messages import Command, Trigger
from crgame_ros.cockpit.server import create_app, HUB, listen
from crgame_ros.errors import CrgameError, InputError
import numpy as np
import pytest

# Long, because other work may share the machine; only a failing test waits so long.
PATIENCE_S = 60.0
HOST = '127.0.0.1'


class PumpBackend:
    """
    Sends a state frame every 10 ms, notes what it is told, and refuses what is 'forbidden'.

    :param frame: sent instead of a state of two vehicles.
    :param period_s: another period [s].
    """

    mode: Literal['live', 'replay'] = 'live'

    def __init__(self, frame: bytes | None = None, period_s: float = 0.01) -> None:
        self.commands: list[tuple[str, Mapping[str, Any]]] = []
        self.present: list[str] = []
        self.gone: list[str] = []
        self.games: list[Path] = []
        # Why it loads no game; empty if it does.
        self.load_refusal = ''
        self.pumped = 0
        self.stopped = False
        self.held = asyncio.Event()
        self.held.set()
        self._frame = frame
        self._period_s = period_s
        self._task: asyncio.Task[None] | None = None

    async def start(self, hub: Hub) -> None:
        hub.set_document('seats', {'seats': {}})
        hub.set_document('scene', {'id': 'a'})
        self._task = asyncio.create_task(self._pump(hub))

    async def stop(self) -> None:
        assert self._task is not None
        self._task.cancel()
        await asyncio.wait([self._task])
        self.stopped = True

    async def command(self, client: Client, message: Command) -> str:
        self.commands.append((client.id, message.model_dump(mode='json', exclude_unset=True)))
        if isinstance(message, Trigger):
            await self.held.wait()
            if message.event == 'broken':
                raise RuntimeError('a mistake in the backend')
            if message.event == 'forbidden':
                raise InputError('is not to be', 'event')
        return f'did {message.type}'

    def joined(self, client: Client) -> None:
        self.present.append(client.id)

    def left(self, client: Client) -> None:
        self.gone.append(client.id)

    async def load_game(self, path: Path, client: Client | None = None, *,
                        takes_seat: bool = False) -> str:
        self.games.append(path)
        if self.load_refusal:
            raise CrgameError(self.load_refusal)
        return 'loaded'

    async def _pump(self, hub: Hub) -> None:
        while True:
            self.pumped += 1
            hub.send_frame('state', self._frame or encode_state(
                Place(0, self.pumped, 0, 0.01 * self.pumped), np.zeros((2, 13))))
            await asyncio.sleep(self._period_s)


@dataclass(frozen=True)
class Cockpit:
    """A listening server and a browser's worth of client."""

    backend: PumpBackend
    hub: Hub
    port: int
    http: ClientSession

    @property
    def address(self) -> str:
        return f'http://{HOST}:{self.port}'

    async def join(self, **headers: str) -> ClientWebSocketResponse:
        return await self.http.ws_connect(f'{self.address}/ws', headers=headers)


@asynccontextmanager
async def cockpit(*, backend: PumpBackend | None = None, token: str | None = None,
                  library: Library | None = None, **more: Any) -> AsyncIterator[Cockpit]:
    backend = backend or PumpBackend()
    app = create_app(backend, Access(HOST, 0, token), library, **more)
    runner, port = await listen(app, HOST, 0)
    async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as http:
        try:
            yield Cockpit(backend, app[HUB], port, http)
        finally:
            await asyncio.wait_for(runner.cleanup(), PATIENCE_S)
    assert backend.stopped


def in_loop(test: Callable[..., Awaitable[None]]) -> Callable[..., None]:
    """Run a test in asyncio's debug mode; it must leave no task and log no error of asyncio."""
    @functools.wraps(test)
    def run(*args: Any, **kwargs: Any) -> None:
        with pytest.MonkeyPatch.context() as patch:
            errors: list[str] = []
            patch.setattr(logging.getLogger('asyncio'), 'error',
                          lambda message, *rest, **_: errors.append(message % rest))

            async def body() -> None:
                await asyncio.wait_for(test(*args, **kwargs), 6 * PATIENCE_S)
                left = asyncio.all_tasks() - {asyncio.current_task()}
                if left:
                    pytest.fail(f'tasks are left: {left}')

            asyncio.run(body(), debug=True)
            if errors:
                pytest.fail(f'asyncio complains: {errors}')
    return run


async def wait_until(condition: Callable[[], bool], what: str) -> None:
    """Wait for a condition of this process to become true."""
    try:
        async with asyncio.timeout(PATIENCE_S):
            while not condition():
                await asyncio.sleep(0.005)
    except TimeoutError:
        pytest.fail(f'waited in vain for {what}')


async def next_text(socket: ClientWebSocketResponse, kind: str) -> dict[str, Any]:
    """Wait for a text message of a kind."""
    async with asyncio.timeout(PATIENCE_S):
        async for message in socket:
            if message.type is WSMsgType.TEXT:
                content: dict[str, Any] = json.loads(message.data)
                if content['type'] == kind:
                    return content
    pytest.fail(f'the connection ended ({socket.close_code}) before {kind}')


async def close_code(socket: ClientWebSocketResponse) -> int | None:
    """Read until the server closes."""
    async with asyncio.timeout(PATIENCE_S):
        async for _ in socket:
            pass
    return socket.close_code


async def raw_request(port: int, request: bytes) -> bytes:
    """Send raw bytes, which no library would send, and read the answer to its end."""
    reader, writer = await asyncio.open_connection(HOST, port)
    writer.write(request)
    try:
        async with asyncio.timeout(PATIENCE_S):
            return await reader.read()
    finally:
        writer.close()
        await writer.wait_closed()


async def get(port: int, target: str, *headers: str, method: str = 'GET',
              host: str | None = None) -> tuple[int, bytes]:
    """Request a target that is sent unchanged; return the status and the whole answer."""
    lines = [f'{method} {target} HTTP/1.1', f'Host: {host or f"{HOST}:{port}"}',
             'Connection: close', *headers]
    answer = await raw_request(port, '\r\n'.join([*lines, '', '']).encode())
    return int(answer.split(b' ', 2)[1]), answer
