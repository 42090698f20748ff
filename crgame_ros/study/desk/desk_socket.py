# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One WebSocket of a page of the desk, from its first message to its end."""

import asyncio
import contextlib
import logging
from typing import Any

from aiohttp import web, WSCloseCode, WSMsgType
from crgame_ros.cockpit.client import Client, TokenBucket
from crgame_ros.errors import InputError
from crgame_ros.study.desk.desk_messages import MAX_BYTES, parse_experimenter, parse_participant
from crgame_ros.study.desk.desk_pages import DeskPages

MESSAGES_PER_S, MESSAGE_BURST = 20.0, 60.0
MAX_MALFORMED = 5
HEARTBEAT_S = 5.0
CLOSE_S = 0.4

_log = logging.getLogger(__name__)


class DeskSocket:
    """
    Reads a page's messages; a page that talks nonsense, or too much, is dropped.

    :param pages: of the desk.
    :param experimenter: whose page it is.
    """

    def __init__(self, pages: DeskPages, *, experimenter: bool) -> None:
        self._pages = pages
        self._is_experimenter = experimenter
        self._bucket = TokenBucket(MESSAGES_PER_S, MESSAGE_BURST)
        self._malformed = 0
        self._transport: asyncio.WriteTransport | None = None
        # Pings count as messages.
        self.socket = web.WebSocketResponse(
            timeout=CLOSE_S, heartbeat=HEARTBEAT_S, compress=False, autoping=False,
            max_msg_size=MAX_BYTES + 1)

    async def run(self, request: web.Request, name: str) -> web.WebSocketResponse:
        """
        Serve the connection until it ends.

        :param request: the upgrade request.
        :param name: of the page, in the log.
        """
        await self.socket.prepare(request)
        transport = request.transport
        if not isinstance(transport, asyncio.WriteTransport):
            return self.socket
        self._transport = transport
        client = Client(name, name, transport.abort, transport.get_write_buffer_size)
        writer = asyncio.create_task(client.write(self.socket))
        writer.add_done_callback(lambda task: _end_with(task, client))
        code: int = WSCloseCode.INTERNAL_ERROR
        reason = ''
        try:
            self._pages.joined(client, experimenter=self._is_experimenter)
            code, reason = await self._read(client)
        finally:
            self._pages.left(client)
            writer.cancel()
            if reason or client.dropped:
                _log.info('%s was dropped: %s', client.id, reason or client.dropped)
            await self.close(code, reason)
        return self.socket

    async def close(self, code: int, reason: str) -> None:
        """Close the connection within a second, whatever its other end does."""
        with contextlib.suppress(TimeoutError, ConnectionError):
            async with asyncio.timeout(2 * CLOSE_S):
                await self.socket.close(code=code, message=reason.encode()[:123])
        if self._transport is not None:
            self._transport.abort()

    async def _read(self, client: Client) -> tuple[int, str]:
        loop = asyncio.get_running_loop()
        while True:
            message = await self.socket.receive()
            if message.type in (WSMsgType.CLOSE, WSMsgType.CLOSING, WSMsgType.CLOSED,
                                WSMsgType.ERROR):
                return WSCloseCode.OK, ''
            if not self._bucket.take(loop.time()):
                return (WSCloseCode.POLICY_VIOLATION,
                        f'more than {MESSAGES_PER_S:g} messages a second')
            if message.type is WSMsgType.PING:
                await self.socket.pong(message.data)
            elif message.type is WSMsgType.TEXT:
                self._take(client, message.data)
            elif message.type is WSMsgType.BINARY:
                self._malformed += 1
            if self._malformed >= MAX_MALFORMED:
                return (WSCloseCode.POLICY_VIOLATION,
                        f'{MAX_MALFORMED} messages that cannot be read')

    def _take(self, client: Client, text: str) -> None:
        try:
            message: dict[str, Any] = (parse_experimenter if self._is_experimenter
                                       else parse_participant)(text)
        except InputError as error:
            self._malformed += 1
            _log.info('%s: %s', client.id, error)
            return
        if self._is_experimenter:
            self._pages.experimenter_says(client, message)
        else:
            self._pages.participant_says(client, message)


def _end_with(writer: asyncio.Task[None], client: Client) -> None:
    """Drop a client that nothing can be sent to any more."""
    if not writer.cancelled() and writer.exception() is not None:
        client.drop('cannot be sent to')
