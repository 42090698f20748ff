# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The WebSocket of one open page: reads its messages within limits, and ends in good order."""

from abc import ABC, abstractmethod
import asyncio
import contextlib
import logging
from typing import Any, Generic, TypeVar

from aiohttp import web, WSCloseCode, WSMsgType
from crgame_ros.cockpit.client import Client, TokenBucket
from crgame_ros.errors import InputError

M = TypeVar('M')

MAX_MALFORMED = 5
# A ping after 5 s of silence, 2.5 s for its answer.
HEARTBEAT_S = 5.0
CLOSE_S = 0.4

_log = logging.getLogger(__name__)


class PageSocket(ABC, Generic[M]):
    """
    A connection; a page that sends malformed or too many messages is disconnected.

    :param max_bytes: of a message.
    :param per_s: messages that a page may send in the long run [1/s].
    :param burst: messages that it may send at once.
    :param options: further ones of the `WebSocketResponse`.
    """

    def __init__(self, max_bytes: int, per_s: float, burst: float, **options: Any) -> None:
        # One byte more: aiohttp refuses a message of exactly this size. This class answers pings,
        # because they count as messages.
        self.socket = web.WebSocketResponse(
            timeout=CLOSE_S, heartbeat=HEARTBEAT_S, compress=False, autoping=False,
            max_msg_size=max_bytes + 1, **options)
        self._per_s = per_s
        self._bucket = TokenBucket(per_s, burst)
        self._malformed = 0
        self._transport: asyncio.WriteTransport | None = None

    @abstractmethod
    def parse(self, text: str) -> M:
        """
        Return the message in a text.

        :raises InputError: if there is none.
        """

    @abstractmethod
    async def act(self, client: Client, message: M) -> None:
        """Do what a message asks for; an error is no fault of the message."""

    @abstractmethod
    def tell(self, client: Client, error: InputError) -> None:
        """Tell why a message cannot be read."""

    @abstractmethod
    def joined(self, client: Client) -> None:
        """Add the page to those that are open."""

    @abstractmethod
    def left(self, client: Client) -> None:
        """Remove the page from them."""

    async def prepare(self, request: web.Request) -> asyncio.WriteTransport | None:
        """Answer the upgrade request; return the transport, None if the connection has ended."""
        await self.socket.prepare(request)
        transport = request.transport
        self._transport = transport if isinstance(transport, asyncio.WriteTransport) else None
        return self._transport

    async def serve(self, client: Client) -> None:
        """Send what is queued for the page, and read its messages, until the connection ends."""
        writer = asyncio.create_task(client.write(self.socket))
        writer.add_done_callback(lambda task: _end_with(task, client))
        code: int = WSCloseCode.INTERNAL_ERROR
        reason = ''
        try:
            self.joined(client)
            code, reason = await self._read(client)
        finally:
            # Before any await: the client may hold a seat.
            self.left(client)
            writer.cancel()
            if reason or client.dropped:
                _log.info('%s was dropped: %s', client.id, reason or client.dropped)
            await self.close(code, reason)

    async def close(self, code: int, reason: str) -> None:
        """
        Close the connection within a second, whatever the client does.

        :param reason: readable reason of at most 123 bytes.
        """
        with contextlib.suppress(TimeoutError, ConnectionError):
            async with asyncio.timeout(2 * CLOSE_S):
                await self.socket.close(code=code, message=reason.encode()[:123])
        if self._transport is not None:
            self._transport.abort()

    async def _read(self, client: Client) -> tuple[int, str]:
        """Read messages until the connection ends; return the code and reason of the close."""
        loop = asyncio.get_running_loop()
        while True:
            message = await self.socket.receive()
            if message.type in (WSMsgType.CLOSE, WSMsgType.CLOSING, WSMsgType.CLOSED,
                                WSMsgType.ERROR):
                return WSCloseCode.OK, ''
            now_s = loop.time()
            if not self._bucket.try_spend(now_s):
                return (WSCloseCode.POLICY_VIOLATION,
                        f'more than {self._per_s:g} messages a second')
            if message.type is WSMsgType.PING:
                await self.socket.pong(message.data)
            elif message.type is WSMsgType.TEXT:
                # A browser answers pings even if its page does nothing any more.
                client.heard_s = now_s
                await self._handle(client, message.data)
            elif message.type is WSMsgType.BINARY:
                self._blame(client, InputError('is binary', 'message'))
            if self._malformed >= MAX_MALFORMED:
                return (WSCloseCode.POLICY_VIOLATION,
                        f'{MAX_MALFORMED} messages that cannot be read')

    async def _handle(self, client: Client, text: str) -> None:
        try:
            message = self.parse(text)
        except InputError as error:
            self._blame(client, error)
            return
        await self.act(client, message)

    def _blame(self, client: Client, error: InputError) -> None:
        self._malformed += 1
        self.tell(client, error)


def _end_with(writer: asyncio.Task[None], client: Client) -> None:
    """Drop a client to which nothing can be sent any more."""
    error = None if writer.cancelled() else writer.exception()
    if error is not None and not isinstance(error, ConnectionError):
        _log.error('cannot send to %s', client.id, exc_info=error)
    if error is not None:
        client.drop('cannot be sent to')
