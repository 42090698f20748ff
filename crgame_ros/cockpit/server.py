# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The web server of the cockpit: its routes and ports, and its WebSocket connections."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
import contextlib
import errno
import json
import logging
from pathlib import Path
import socket
import time
from typing import cast, TYPE_CHECKING

from aiohttp import web, WSCloseCode
from crgame_ros.cockpit import library_routes, page_files
from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.backend import Backend
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.library import Library
from crgame_ros.cockpit.page_files import PageFile
from crgame_ros.cockpit.page_messages import (
    DeviceUsed,
    Input,
    Layers,
    MAX_BYTES,
    Name,
    Order,
    PageMessage,
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
from crgame_ros.cockpit.page_socket import PageSocket
from crgame_ros.cockpit.request_guard import (
    ACCESS,
    browser_of,
    Doorkeeper,
    file_answer,
    granted,
    guard,
    header_writer,
    KEEPER,
    server_log,
    WatchedSite,
)
from crgame_ros.cockpit.rights import ROLES
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.documents import VEHICLE_ID

if TYPE_CHECKING:
    from crgame_ros.cockpit.replay_backend import ReplayBackend

MESSAGES_PER_S = 400.0
MESSAGE_BURST = 800.0
MAX_REQUESTS = 16
# Most bytes unsent in the kernel: more would be seconds of old frames on a slow network.
_KERNEL_UNSENT = 64 * 1024

_log = logging.getLogger(__name__)


async def _invite(request: web.Request) -> web.Response:
    access = request.app[ACCESS]
    if access.invitations is None:
        raise CrgameError('this cockpit cannot make links: start it with --open-cockpit')
    try:
        content = json.loads(await request.read())
        role, seat = content['role'], content.get('seat', '')
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise CrgameError('name a role') from error
    if role not in ROLES or not isinstance(seat, str) \
            or (seat and not VEHICLE_ID.fullmatch(seat)):
        raise CrgameError('there is no such role or seat')
    port = request.get_extra_info('sockname')[1]
    link = access.at_port(port).link(access.invitations.make(role, seat))
    return web.json_response({'link': link})


HUB = web.AppKey('hub', Hub)
PORTS_TRIED = 20
SHUTDOWN_S = 0.8
_STALL_CHECK_S = 0.5
_JSON_BYTES = 256 * 1024


def create_app(backend: Backend, access: Access, library: Library | None, *,
               page: Path | None = None, framed_by: str = '') -> web.Application:
    """
    Return the server's application, which starts the backend and stops it at cleanup.

    :param backend: the run or recording behind the page.
    :param library: scenarios that can be chosen; None for none.
    :param page: the folder of the page; None for that of the cockpit.
    :param framed_by: origins of the only pages that may frame this one, as in the header.
    :raises CrgameError: if the page or Plotly is not installed.
    """
    hub = Hub(backend.mode, framed_by)
    keeper = Doorkeeper()
    sessions: set[Session] = set()
    app = web.Application(middlewares=[guard(access, keeper)], client_max_size=_JSON_BYTES)
    app[HUB], app[KEEPER], app[ACCESS] = hub, keeper, access
    app.cleanup_ctx.append(_running(backend, hub))
    app.on_response_prepare.append(header_writer(_is_static, framed_by=framed_by))

    async def connect(request: web.Request) -> web.WebSocketResponse:
        session = Session(hub, backend)
        sessions.add(session)
        try:
            return await session.run(request)
        finally:
            sessions.discard(session)

    async def close_all(_: web.Application) -> None:
        await asyncio.gather(*(session.end() for session in sessions))

    app.on_shutdown.append(close_all)
    app.router.add_get('/ws', connect)
    _add_page(app, page_files.read_page(page))
    library_routes.add_routes(app, library, backend, hub)
    app.router.add_post('/api/invite', library_routes.guarded(_invite, hub, 'invite'))
    if backend.mode == 'replay':
        app.add_routes(cast('ReplayBackend', backend).routes())
    return app


async def listen(app: web.Application, host: str, port: int) -> tuple[web.AppRunner, int]:
    """
    Start to listen, at the next free port if the requested one is taken.

    :param app: from `create_app`; its backend is started.
    :param port: the first to try; 0 takes any.
    :return: the runner, whose `cleanup` ends everything, and the port.
    :raises InputError: if no port can be used.
    """
    # No log of requests: the first address holds the token.
    runner = web.AppRunner(app, access_log=None, shutdown_timeout=SHUTDOWN_S,
                           keepalive_timeout=30.0, lingering_time=1.0, auto_decompress=False,
                           logger=server_log())
    try:
        await runner.setup()
        for candidate in range(port, port + PORTS_TRIED if port else 1):
            try:
                await WatchedSite(runner, host, candidate, app[KEEPER],
                                  app[ACCESS].tls).start()
            except OSError as error:
                if error.errno != errno.EADDRINUSE:
                    raise InputError(f'cannot listen ({error.strerror})', f'{host}:{candidate}',
                                     'choose another address or port') from error
            except OverflowError:
                break
            except UnicodeError as error:
                raise InputError('is no address', host[:80], 'give one of this machine') from error
            else:
                return runner, runner.addresses[0][1]
        raise InputError(f'the ports {port} to {port + PORTS_TRIED - 1} are taken', host,
                         'choose another port')
    except BaseException:
        await runner.cleanup()
        raise


def _is_static(path: str) -> bool:
    return path.startswith('/static/') or path in page_files.LIBRARIES


def _add_page(app: web.Application, table: Mapping[str, PageFile]) -> None:
    libraries: dict[str, PageFile] = {}

    def find(path: str) -> PageFile | None:
        if path in page_files.LIBRARIES and path not in libraries:
            file = page_files.read_library(path)
            if file is not None:
                libraries[path] = file
        return table.get(path) or libraries.get(path)

    async def serve(request: web.Request) -> web.Response:
        return file_answer(request, find(request.path))

    for path in (page_files.INDEX, *page_files.LIBRARIES, '/static/{name:.*}'):
        app.router.add_get(path, serve)


def _running(backend: Backend, hub: Hub) -> Callable[[web.Application], AsyncIterator[None]]:
    async def running(_: web.Application) -> AsyncIterator[None]:
        await backend.start(hub)
        checking = asyncio.create_task(_check_stalls(hub))
        yield
        checking.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await checking
        await backend.stop()
    return running


async def _check_stalls(hub: Hub) -> None:
    loop = asyncio.get_running_loop()
    while True:
        await asyncio.sleep(_STALL_CHECK_S)
        hub.check_stalls(loop.time())


class Session(PageSocket[PageMessage]):
    """A connection that reads a client's messages and reports its end to the backend."""

    def __init__(self, hub: Hub, backend: Backend) -> None:
        # The backend comes before the answer to a close.
        super().__init__(MAX_BYTES, MESSAGES_PER_S, MESSAGE_BURST, autoclose=False,
                         writer_limit=0)
        self._hub = hub
        self._backend = backend
        self._requests: asyncio.Queue[Order | None] = asyncio.Queue(MAX_REQUESTS)
        self._worker: asyncio.Task[None] | None = None

    async def run(self, request: web.Request) -> web.WebSocketResponse:
        """Serve the connection until it ends."""
        transport = await self.prepare(request)
        if transport is None:
            return self.socket
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
        self._worker = asyncio.create_task(self._work(client))
        await self.serve(client)
        # A started request is finished even if its page has gone.
        await asyncio.wait([self._worker])
        return self.socket

    async def end(self) -> None:
        """Close the connection because the server ends, and cancel pending requests."""
        await self.close(WSCloseCode.GOING_AWAY, 'the cockpit ends')
        if self._worker is not None:
            self._worker.cancel()

    def joined(self, client: Client) -> None:
        """Report the client to the backend."""
        self._backend.joined(client)

    def left(self, client: Client) -> None:
        """Report the client's end to the backend, and end its requests."""
        while not self._requests.empty():
            self._requests.get_nowait()
        self._hub.remove(client)
        try:
            self._backend.left(client)
        except Exception:
            _log.exception('end of %s', client.id)
        self._requests.put_nowait(None)

    def parse(self, text: str) -> PageMessage:
        """Return the message in a text."""
        return parse_message(text)

    def tell(self, client: Client, error: InputError) -> None:
        """Show on the page why its message cannot be read."""
        self._hub.send_event('notice', {'level': 'error', 'text': str(error)}, only=client)

    async def act(self, client: Client, message: PageMessage) -> None:
        """Do what a message asks for, or leave it to the worker."""
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


def _send_promptly(transport: asyncio.WriteTransport) -> None:
    """Limit the send buffer to one message, so that old frames are replaced, not sent late."""
    # With 0, TLS would never send: it treats an empty buffer as a full one.
    transport.set_write_buffer_limits(high=1, low=0)
    raw = transport.get_extra_info('socket')
    if raw is not None and hasattr(socket, 'TCP_NOTSENT_LOWAT'):
        raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, _KERNEL_UNSENT)
