# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The web server of the cockpit: routes and ports."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
import contextlib
import errno
import json
from pathlib import Path
from typing import cast

from aiohttp import web
from crgame_ros.cockpit import library_routes, page_files
from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.backend import Backend, ReplayControls
from crgame_ros.cockpit.doorkeeper import Doorkeeper, server_log, WatchedSite
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.library import Library
from crgame_ros.cockpit.page_files import PageFile
from crgame_ros.cockpit.request_guard import (
    ACCESS,
    actor,
    file_answer,
    guard,
    header_writer,
    KEEPER,
)
from crgame_ros.cockpit.rights import ROLES
from crgame_ros.cockpit.session import Session
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.driven_vehicle import VEHICLE_ID


def _add_invite_routes(app: web.Application, access: Access, hub: Hub) -> None:
    """
    Add the route.

    :param access: access control with the links; it may have none.
    :param hub: all clients.
    """
    async def invite(request: web.Request) -> web.Response:
        try:
            actor(request, hub, 'invite')
            return web.json_response({'link': _link(access, request, await request.read())})
        except CrgameError as error:
            return web.json_response({'error': str(error)}, status=400)

    app.router.add_post('/api/invite', invite)


def _link(access: Access, request: web.Request, body: bytes) -> str:
    if access.invitations is None:
        raise CrgameError('this cockpit cannot make links: start it with --open-cockpit')
    try:
        content = json.loads(body)
        role, seat = content['role'], content.get('seat', '')
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise CrgameError('name a role') from error
    if role not in ROLES or not isinstance(seat, str) \
            or (seat and not VEHICLE_ID.fullmatch(seat)):
        raise CrgameError('there is no such role or seat')
    port = request.get_extra_info('sockname')[1]
    return access.at_port(port).link(access.invitations.make(role, seat))


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
    :param access: access control of the server.
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
    _add_invite_routes(app, access, hub)
    if backend.mode == 'replay':
        app.add_routes(cast(ReplayControls, backend).routes())
    return app


async def listen(app: web.Application, host: str, port: int) -> tuple[web.AppRunner, int]:
    """
    Start to listen, at the next free port if the requested one is taken.

    :param app: from `create_app`; its backend is started.
    :param host: address or name.
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
