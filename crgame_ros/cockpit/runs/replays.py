# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Replays of past runs: a process for each, to which the cockpit forwards requests of pages."""

import asyncio
from collections import OrderedDict
from dataclasses import dataclass
import json
import os
from pathlib import Path
import sys

from aiohttp import ClientError, ClientSession, hdrs, web, WSMsgType
from crgame_ros.cockpit.access import new_token
from crgame_ros.cockpit.runs.archive import PastRun
from crgame_ros.errors import CrgameError, InputError

PROCESS = 'crgame_ros.cockpit.runs.replay_process'
MOST_REPLAYS = 3
BEGIN_S = 60.0
# The headers of an answer that the page needs; the server sets the others.
_PASSED = (hdrs.CONTENT_TYPE, hdrs.CONTENT_ENCODING)
_PACKAGES = Path(__file__).resolve().parents[3]


@dataclass(frozen=True)
class _Replay:
    process: asyncio.subprocess.Process
    port: int
    token: str

    @property
    def address(self) -> str:
        return f'http://127.0.0.1:{self.port}'

    @property
    def headers(self) -> dict[str, str]:
        return {hdrs.COOKIE: f'crgame-{self.port}={self.token}'}


class RunReplays:
    """The processes of replays; the least recently used ends first."""

    def __init__(self) -> None:
        self._replays: OrderedDict[str, _Replay] = OrderedDict()
        self._starting = asyncio.Lock()
        self._http: ClientSession | None = None

    async def close(self) -> None:
        """End them all."""
        for key in list(self._replays):
            await self.end(key)
        if self._http is not None:
            await self._http.close()

    async def end(self, key: str) -> None:
        """End the replay of a run, if there is one."""
        replay = self._replays.pop(key, None)
        if replay is not None:
            await _end(replay.process)

    async def forward(self, run: PastRun, rest: str, request: web.Request) -> web.StreamResponse:
        """
        Return the answer of the process that shows the run.

        :param rest: path below its address.
        :raises CrgameError: if the run cannot be shown.
        """
        replay = await self._replay(run)
        if self._http is None:
            self._http = ClientSession(auto_decompress=False)
        try:
            if rest == 'ws':
                return await _forward_socket(self._http, replay, request)
            async with self._http.get(f'{replay.address}/{rest}', params=request.query,
                                      headers=replay.headers) as answer:
                kept = {name: answer.headers[name] for name in _PASSED if name in answer.headers}
                return web.Response(status=answer.status, body=await answer.read(), headers=kept)
        except ClientError as error:
            await self.end(run.id)
            raise CrgameError('the replay has ended; load the page again') from error

    async def _replay(self, run: PastRun) -> _Replay:
        async with self._starting:
            found = self._replays.get(run.id)
            if found is None or found.process.returncode is not None:
                while len(self._replays) >= MOST_REPLAYS:
                    await self.end(next(iter(self._replays)))
                found = self._replays[run.id] = await _start(run)
            self._replays.move_to_end(run.id)
            return found


async def _start(run: PastRun) -> _Replay:
    paths = [str(_PACKAGES), *filter(None, [os.environ.get('PYTHONPATH')])]
    process = await asyncio.create_subprocess_exec(
        sys.executable, '-P', '-m', PROCESS, str(run.bag), stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE, env={**os.environ, 'PYTHONPATH': os.pathsep.join(paths)},
        start_new_session=True)
    token = new_token()
    assert process.stdin is not None and process.stdout is not None
    try:
        process.stdin.write(f'{token}\n'.encode())
        async with asyncio.timeout(BEGIN_S):
            told = json.loads(await process.stdout.readline() or b'{}')
    except (TimeoutError, ConnectionError, ValueError) as error:
        await _end(process)
        raise InputError('cannot be shown', run.name, 'the log of the server says why') from error
    if 'port' not in told:
        await _end(process)
        raise InputError(str(told.get('error', 'cannot be shown')), run.name)
    return _Replay(process, int(told['port']), token)


async def _end(process: asyncio.subprocess.Process) -> None:
    if process.returncode is None:
        process.kill()
    await process.wait()
    if process.stdin is not None:
        process.stdin.close()


async def _forward_socket(http: ClientSession, replay: _Replay,
                          request: web.Request) -> web.WebSocketResponse:
    page = web.WebSocketResponse(max_msg_size=64 * 1024)
    await page.prepare(request)
    async with http.ws_connect(f'{replay.address}/ws', headers=replay.headers,
                               max_msg_size=0) as shown:
        async def back() -> None:
            async for message in shown:
                if message.type is WSMsgType.TEXT:
                    await page.send_str(message.data)
                elif message.type is WSMsgType.BINARY:
                    await page.send_bytes(message.data)
            await page.close()

        answering = asyncio.create_task(back())
        try:
            async for message in page:
                if message.type is WSMsgType.TEXT:
                    await shown.send_str(message.data)
        finally:
            await shown.close()
            answering.cancel()
            await asyncio.gather(answering, return_exceptions=True)
    return page
