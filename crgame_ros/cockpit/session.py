# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One WebSocket connection from its first message to its end."""

import asyncio
import contextlib
import logging
import socket
import time

from aiohttp import web, WSCloseCode, WSMsgType
from crgame_ros.cockpit.backend import Backend
from crgame_ros.cockpit.client import Client, TokenBucket
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.page_messages import (
    DeviceUsed,
    Input,
    Layers,
    MAX_BYTES,
    Name,
    Order,
    parse_message,
    Person,
    Ping,
    Request,
    Role,
    SeenView,
    Sound,
    TaskDone,
    ViewTold,
)
from crgame_ros.cockpit.request_guard import browser_of, granted
from crgame_ros.errors import CrgameError, InputError

MESSAGES_PER_S = 400.0
MESSAGE_BURST = 800.0
MAX_MALFORMED = 5
MAX_REQUESTS = 16
# A ping after 5 s of silence, 2.5 s for its answer.
HEARTBEAT_S = 5.0
CLOSE_S = 0.4
# Most bytes unsent in the kernel: more would be seconds of old frames on a slow network.
_KERNEL_UNSENT = 64 * 1024

_log = logging.getLogger(__name__)


class Session:
    """
    A connection that reads a client's messages and reports its end to the backend.

    :param hub: all clients.
    :param backend: carries out the messages.
    """

    def __init__(self, hub: Hub, backend: Backend) -> None:
        self._hub = hub
        self._backend = backend
        # One byte more: aiohttp refuses a message of exactly this size. This class answers pings,
        # because they count as messages, and closes, because the backend comes first.
        self.socket = web.WebSocketResponse(
            timeout=CLOSE_S, heartbeat=HEARTBEAT_S, compress=False, autoping=False,
            autoclose=False, max_msg_size=MAX_BYTES + 1, writer_limit=0)
        self._bucket = TokenBucket(MESSAGES_PER_S, MESSAGE_BURST)
        self._requests: asyncio.Queue[Order | None] = asyncio.Queue(MAX_REQUESTS)
        self._malformed = 0
        self._transport: asyncio.WriteTransport | None = None
        self._worker: asyncio.Task[None] | None = None

    async def run(self, request: web.Request) -> web.WebSocketResponse:
        """
        Serve the connection until it ends.

        :param request: the upgrade request.
        """
        await self.socket.prepare(request)
        transport = request.transport
        if not isinstance(transport, asyncio.WriteTransport):
            return self.socket
        self._transport = transport
        _send_promptly(transport)
        peer = transport.get_extra_info('peername')
        address = str(peer[0]) if peer else ''
        now_s = asyncio.get_running_loop().time()
        if not self._hub.make_room(address, now_s):
            await self.close(WSCloseCode.TRY_AGAIN_LATER, 'too many pages are open')
            return self.socket
        client = self._hub.add(transport.abort, transport.get_write_buffer_size,
                               rights=granted(request), address=address, now_s=now_s)
        client.browser = browser_of(request)
        writer = asyncio.create_task(client.write(self.socket))
        writer.add_done_callback(lambda task: _end_with(task, client))
        self._worker = asyncio.create_task(self._work(client))
        code: int = WSCloseCode.INTERNAL_ERROR
        reason = ''
        try:
            self._backend.joined(client)
            code, reason = await self._read(client)
        finally:
            # Before any await: the client may hold a seat.
            self._leave(client)
            writer.cancel()
            self._requests.put_nowait(None)
            if reason or client.dropped:
                _log.info('%s was dropped: %s', client.id, reason or client.dropped)
            await self.close(code, reason)
        # A started request is finished even if its page has gone.
        await asyncio.wait([self._worker])
        return self.socket

    async def end(self) -> None:
        """Close the connection because the server ends, and cancel pending requests."""
        await self.close(WSCloseCode.GOING_AWAY, 'the cockpit ends')
        if self._worker is not None:
            self._worker.cancel()

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

    def _leave(self, client: Client) -> None:
        while not self._requests.empty():
            self._requests.get_nowait()
        self._hub.remove(client)
        try:
            self._backend.left(client)
        except Exception:
            _log.exception('end of %s', client.id)

    async def _read(self, client: Client) -> tuple[int, str]:
        """Read messages until the connection ends; return the code and reason of the close."""
        loop = asyncio.get_running_loop()
        while True:
            message = await self.socket.receive()
            if message.type in (WSMsgType.CLOSE, WSMsgType.CLOSING, WSMsgType.CLOSED,
                                WSMsgType.ERROR):
                return WSCloseCode.OK, ''
            client.heard_s = loop.time()
            if not self._bucket.try_spend(client.heard_s):
                return (WSCloseCode.POLICY_VIOLATION,
                        f'more than {MESSAGES_PER_S:g} messages a second')
            if message.type is WSMsgType.PING:
                await self.socket.pong(message.data)
            elif message.type is WSMsgType.TEXT:
                await self._handle(client, message.data)
            elif message.type is WSMsgType.BINARY:
                self._blame(client, InputError('is binary', 'message'))
            if self._malformed >= MAX_MALFORMED:
                return (WSCloseCode.POLICY_VIOLATION,
                        f'{MAX_MALFORMED} messages that cannot be read')

    async def _handle(self, client: Client, text: str) -> None:
        try:
            message = parse_message(text)
        except InputError as error:
            self._blame(client, error)
            return
        refusal = client.rights.refusal(message.type, getattr(message, 'action', ''))
        match message:
            case _ if refusal and self._backend.mode == 'live':
                if isinstance(message, Request):
                    self._reply(client, message, False, refusal)
            case Input() | TaskDone() | ViewTold():
                try:
                    await self._backend.command(client, message)
                except CrgameError as error:
                    # Inputs repeat every 50 ms, and go on for a while after a seat was lost. The
                    # seats document already names the holders.
                    _log.debug('%s of %s: %s', message.type, client.id, error)
            case Name():
                client.name = message.name
            case Layers():
                client.choose_layers(message)
                self._hub.send_wanted(client)
            case Sound():
                client.sound = message
            case SeenView():
                client.view = message
            case Person():
                self._hub.identify(client, message.key, fresh=message.fresh)
                self._backend.joined(client)
            case Role():
                client.rights = client.granted.narrowed(message.role)
                self._hub.send_rights(client)
                self._backend.joined(client)
                self._reply(client, message, True, f'you are a {client.rights.role}')
            case DeviceUsed():
                client.device = message.device
            case Ping():
                if message.round_trip_ms is not None:
                    client.round_trip_ms = message.round_trip_ms
                self._hub.send_event('pong', {'t': message.t, 'steady_s': time.monotonic()},
                                     only=client)
            case _:
                await self._ask(client, message)

    async def _ask(self, client: Client, message: Order) -> None:
        try:
            self._requests.put_nowait(message)
        except asyncio.QueueFull:
            self._reply(client, message, False, f'{MAX_REQUESTS} requests are waiting already')
        # Let the task start before the next message is read.
        await asyncio.sleep(0)

    def _blame(self, client: Client, error: InputError) -> None:
        self._malformed += 1
        self._hub.send_event('notice', {'level': 'error', 'text': str(error)}, only=client)

    async def _work(self, client: Client) -> None:
        while (message := await self._requests.get()) is not None:
            try:
                text = await self._backend.command(client, message)
            except CrgameError as error:
                self._reply(client, message, False, str(error))
            except Exception:
                _log.exception('%s of %s', message.type, client.id)
                self._reply(client, message, False, 'it failed; the log of the server says why')
            else:
                self._reply(client, message, True, text)

    def _reply(self, client: Client, message: Request, ok: bool, text: str) -> None:
        self._hub.send_event('reply', {'to': message.id, 'ok': ok, 'text': text}, only=client)


def _end_with(writer: asyncio.Task[None], client: Client) -> None:
    """Drop a client to which nothing can be sent any more."""
    error = None if writer.cancelled() else writer.exception()
    if error is not None and not isinstance(error, ConnectionError):
        _log.error('cannot send to %s', client.id, exc_info=error)
    if error is not None:
        client.drop('cannot be sent to')


def _send_promptly(transport: asyncio.WriteTransport) -> None:
    """Limit the send buffer to one message, so that old frames are replaced, not sent late."""
    # With 0, TLS would never send: it treats an empty buffer as a full one.
    transport.set_write_buffer_limits(high=1, low=0)
    raw = transport.get_extra_info('socket')
    if raw is not None and hasattr(socket, 'TCP_NOTSENT_LOWAT'):
        raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, _KERNEL_UNSENT)
