# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A desk that listens in this process, and its pages, whose messages a test sends."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
import functools
import json
from pathlib import Path
import re
import sys
from typing import Any

from aiohttp import ClientSession, ClientWebSocketResponse, CookieJar, WSMsgType
from crgame_ros.cockpit.access import Access
from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.participant_document import participant_document
from crgame_ros.study.desk.server import serve_desk
from crgame_ros.study.participant_session import ParticipantSession
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from desk_support import DrivesWithoutGraph, write_study  # noqa: E402, I100

PATIENCE_S = 60.0
TIMES = {'shown_at': 10.0, 'answered_at': 12.0, 'taken_s': 2.0}
KEY = 'a' * 32


@dataclass
class Served:
    """A desk that listens, and a browser's worth of client."""

    desk: Desk
    http: ClientSession
    participant: str
    experimenter: str

    @property
    def root(self) -> str:
        return self.participant.partition('?')[0].rstrip('/')

    async def join(self, key: str = KEY, *, fresh: bool = True) -> ClientWebSocketResponse:
        """Open the participant's page."""
        socket = await self.http.ws_connect(f'{self.root}/ws/participant')
        await socket.send_json({'type': 'hello', 'page': key, 'fresh': fresh})
        return socket

    async def direct(self) -> ClientWebSocketResponse:
        """Open the experimenter's page."""
        async with self.http.get(self.experimenter) as answer:
            assert answer.status == 200
        return await self.direct_again()

    async def direct_again(self) -> ClientWebSocketResponse:
        """Open another page of the experimenter, in the same browser."""
        return await self.http.ws_connect(f'{self.root}/ws/experimenter')


@asynccontextmanager
async def served(folder: Path, host: str = '127.0.0.1', step_s: float = 0.02,
                 token: str | None = None, **changed: Any) -> AsyncIterator[Served]:
    study = write_study(folder / 'study', **changed)
    with ParticipantSession(study, folder / 'P07', 'P07', 0) as session:
        desk = Desk(session, DrivesWithoutGraph(session, step_s=step_s))
        runner, lines = await serve_desk(desk, Access(host, 0, token), folder)
        participant, experimenter = (re.findall(r'http\S+', line)[0] for line in lines)
        async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as http:
            try:
                yield Served(desk, http, participant, experimenter)
            finally:
                await asyncio.wait_for(runner.cleanup(), PATIENCE_S)


def in_loop(test: Callable[..., Awaitable[None]]) -> Callable[..., None]:
    """Run a test in an event loop, which must have no task at its end."""
    @functools.wraps(test)
    def run(tmp_path: Path) -> None:
        async def body() -> None:
            await asyncio.wait_for(test(tmp_path), 4 * PATIENCE_S)
            left = asyncio.all_tasks() - {asyncio.current_task()}
            assert not left
        asyncio.run(body())
    return run


async def shown(socket: ClientWebSocketResponse, fits: Callable[[dict[str, Any]], bool]
                ) -> dict[str, Any]:
    """Wait for a message that fits."""
    async with asyncio.timeout(PATIENCE_S):
        async for message in socket:
            if message.type is WSMsgType.TEXT:
                content: dict[str, Any] = json.loads(message.data)
                if fits(content):
                    return content
    pytest.fail(f'the connection ended ({socket.close_code})')


def shows(what: str, item: str = '') -> Callable[[dict[str, Any]], bool]:
    """Return a predicate that fits a document of the participant's page."""
    return lambda content: content['type'] == 'desk' and content['show'] == what \
        and item in ('', content['item'])


async def do(socket: ClientWebSocketResponse, order: dict[str, Any]) -> dict[str, Any]:
    """Send an order as the experimenter; return the reply."""
    await socket.send_json({**order, 'id': 7})
    return await shown(socket, lambda content: content['type'] == 'reply')


async def do_until(served_: Served, socket: ClientWebSocketResponse, wanted: str) -> None:
    """Complete the items before a given one as a willing participant."""
    desk = served_.desk
    while (item := desk.session.next_item) is not None and item.id != wanted:
        document = participant_document(desk)
        if document['show'] == 'language':
            await socket.send_json({'type': 'language', 'language': 'de'})
        elif document['show'] == 'drive':
            await socket.send_json({'type': 'ready', 'item': item.id})
        else:
            answers = {question['name']: answer_to(question)
                       for question in document.get('questions', [])}
            await socket.send_json({'type': 'finish', 'item': item.id, 'answers': answers,
                                    'agreed': True, **TIMES})
        # The page would be dropped if it answered faster than people.
        await asyncio.sleep(0.06)


def answer_to(question: dict[str, Any]) -> Any:
    """Return a valid answer."""
    match question['kind']:
        case 'choice':
            return [] if question['several'] else question['choices'][0][0]
        case 'text':
            return 'x'
        case 'number':
            return 30
        case _:
            return 1
