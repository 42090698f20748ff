# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The web server of a desk: its two pages, their files and sockets, and access control."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
import contextlib
from itertools import count
import json
import logging
from pathlib import Path
from typing import cast
from urllib.parse import urlsplit

from aiohttp import hdrs, web, WSCloseCode
from aiohttp.typedefs import Handler
from crgame_ros.cockpit.access import Access, cookie_name, is_loopback
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.page_files import PageFile, read_files
from crgame_ros.cockpit.page_socket import PageSocket
from crgame_ros.cockpit.request_guard import (
    ACCESS,
    Doorkeeper,
    enter,
    file_answer,
    guard,
    header_writer,
    KEEPER,
)
from crgame_ros.cockpit.rights import Invitations
from crgame_ros.cockpit.server import listen
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.paths import page_directory
from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.messages import (
    ExperimenterMessage,
    FROM_EXPERIMENTER,
    FROM_PARTICIPANT,
    MAX_BYTES,
    ParticipantMessage,
)
from crgame_ros.study.desk.page_markdown import consent_copy, picture
from crgame_ros.study.desk.pages import DeskPages, TOLD_EVERY_S, words_of
from crgame_ros.study.file import Page

MESSAGES_PER_S, MESSAGE_BURST = 20.0, 60.0

_log = logging.getLogger(__name__)


class DeskSocket(PageSocket[ExperimenterMessage | ParticipantMessage]):
    """
    A connection of a page.

    :param experimenter: whether it is an experimenter's page.
    """

    def __init__(self, pages: DeskPages, *, experimenter: bool) -> None:
        super().__init__(MAX_BYTES, MESSAGES_PER_S, MESSAGE_BURST)
        self._pages = pages
        self._is_experimenter = experimenter

    async def run(self, request: web.Request, name: str) -> web.WebSocketResponse:
        """
        Serve the connection until it ends.

        :param name: of the page, in the log.
        """
        transport = await self.prepare(request)
        if transport is not None:
            await self.serve(Client(name, name, transport.abort, transport.get_write_buffer_size))
        return self.socket

    def joined(self, client: Client) -> None:
        """Add the page to those of the desk."""
        self._pages.joined(client, experimenter=self._is_experimenter)

    def left(self, client: Client) -> None:
        """Remove the page from them."""
        self._pages.left(client)

    def parse(self, text: str) -> ExperimenterMessage | ParticipantMessage:
        """Return the message in a text."""
        return FROM_EXPERIMENTER.read(text) if self._is_experimenter \
            else FROM_PARTICIPANT.read(text)

    async def act(self, client: Client, message: ExperimenterMessage | ParticipantMessage) -> None:
        """Do what a message asks for."""
        if self._is_experimenter:
            self._pages.experimenter_says(client, cast(ExperimenterMessage, message))
        else:
            self._pages.participant_says(client, cast(ParticipantMessage, message))

    def tell(self, client: Client, error: InputError) -> None:
        """Write into the log why a message cannot be read."""
        _log.info('%s: %s', client.id, error)


# JavaScript modules import each other by their path among the pages.
SHARED = ('cockpit', 'desk')
PAGES = {'/': 'desk/participant.html', '/experimenter': 'desk/experimenter.html'}
LINKS = 'desk_links.json'
# Begins the line with the participant's address.
PARTICIPANT = 'participant'
# Of experimenters, and of participants.
MAX_PAGES = 12
_STALL_CHECK_S = 0.5
_ONLY_EXPERIMENTER = "This page is the experimenter's: its address stands on the terminal."
_USED = ('This link is not good any more: it lets one browser in, once. '
         'The program prints another one when it is started again.')
_LOOPBACK = ('127.0.0.1', 'localhost')


def create_desk_app(desk: Desk, access: Access, experimenters: Invitations) -> web.Application:
    """
    Build the server's application.

    :param desk: whose pages are served.
    :param access: access control for participants.
    :param experimenters: links that admit experimenters, one browser each.
    :raises CrgameError: if the pages are not installed.
    """
    keeper, pages = Doorkeeper(), DeskPages(desk)
    # Of experimenters, and of participants: neither shuts the other one out.
    sockets: dict[bool, set[DeskSocket]] = {True: set(), False: set()}
    numbers = count(1)
    app = web.Application(middlewares=[
        guard(access, keeper, lambda request: _is_experimenter(request, access, experimenters)
              or (request.path == '/experimenter' and 'token' in request.query))])
    app[KEEPER], app[ACCESS] = keeper, access
    app.cleanup_ctx.append(_telling(pages))
    app.on_response_prepare.append(header_writer(
        lambda path: path.startswith('/static/'), lambda request: _frames(request, desk)))

    def connector(*, experimenter: bool) -> Handler:
        own = sockets[experimenter]

        async def connect(request: web.Request) -> web.StreamResponse:
            if experimenter and not _is_experimenter(request, access, experimenters):
                return web.Response(status=403, text=f'{_ONLY_EXPERIMENTER}\n')
            if len(own) >= MAX_PAGES:
                return web.Response(status=503, text='Too many pages are open.\n')
            socket = DeskSocket(pages, experimenter=experimenter)
            own.add(socket)
            try:
                who = 'experimenter' if experimenter else 'participant'
                return await socket.run(request, f'{who} {next(numbers)}')
            finally:
                own.discard(socket)
        return connect

    async def close_all(_: web.Application) -> None:
        await asyncio.gather(*(socket.close(WSCloseCode.GOING_AWAY, 'the session ends')
                               for socket in (*sockets[True], *sockets[False])))

    app.on_shutdown.append(close_all)
    app.router.add_get('/ws/participant', connector(experimenter=False))
    app.router.add_get('/ws/experimenter', connector(experimenter=True))
    _add_pages(app, desk, access, experimenters)
    return app


async def serve_desk(desk: Desk, access: Access, private: Path
                     ) -> tuple[web.AppRunner, list[str]]:
    """
    Serve a desk until the returned runner is cleaned up.

    :param access: with the address, and the first port to try.
    :param private: folder of the experimenters' keys, so that links of an earlier process of the
        same session stay valid.
    :return: the runner, and lines with the addresses of the pages.
    :raises InputError: if no port can be used.
    """
    experimenters = Invitations(private / LINKS)
    runner, port = await listen(create_desk_app(desk, access, experimenters), access.host,
                                access.port)
    here = access.at_port(port)
    own = here.link(experimenters.make('direct')).replace('/?', '/experimenter?')
    if access.invitations is None:
        first, *others = here.urls
        lines = [f'{PARTICIPANT}: {first}', *(f'  also: {other}' for other in others)]
    else:
        link = here.link(access.invitations.make('drive'))
        lines = [f'{PARTICIPANT}, in one browser alone: {link}']
    return runner, [*lines, f'experimenter, in one browser alone: {own}']


def _add_pages(app: web.Application, desk: Desk, access: Access,
               experimenters: Invitations) -> None:
    table = read_desk_files()

    async def participant(request: web.Request) -> web.Response:
        return file_answer(request, table['/'])

    async def experimenter(request: web.Request) -> web.Response:
        if 'token' in request.query:
            return enter(request, experimenters.exchange, _cookie_name(request, access),
                         '/experimenter', _USED)
        if not _is_experimenter(request, access, experimenters):
            return web.Response(status=403, text=f'{_ONLY_EXPERIMENTER}\n')
        return file_answer(request, table['/experimenter'])

    async def journal(request: web.Request) -> web.Response:
        if not _is_experimenter(request, access, experimenters):
            return web.Response(status=403, text=f'{_ONLY_EXPERIMENTER}\n')
        lines = ''.join(f'{json.dumps(entry)}\n' for entry in desk.session.journal.entries)
        name = f'{desk.session.study.name}_{desk.session.participant}.jsonl'
        return web.Response(text=lines, content_type='application/jsonl', headers={
            hdrs.CONTENT_DISPOSITION: f'attachment; filename="{name}"'})

    async def copy(_: web.Request) -> web.Response:
        item, language = desk.session.next_item, desk.language
        if item is None or not isinstance(item.what, Page) or not item.what.consent:
            return web.Response(status=404, text='No consent is asked for now.\n')
        study = desk.session.study
        name, html = consent_copy(study, item.what, language, desk.session.participant,
                                  desk.clock_s(), words_of(study, language))
        return web.Response(text=html, content_type='text/html', headers={
            hdrs.CONTENT_DISPOSITION: f'attachment; filename="{name}"'})

    async def static(request: web.Request) -> web.Response:
        return file_answer(request, table.get(request.path))

    async def shown(request: web.Request) -> web.Response:
        return file_answer(request, picture(desk.session.study, request.match_info['name']))

    app.router.add_get('/', participant)
    app.router.add_get('/experimenter', experimenter)
    app.router.add_get('/experimenter/journal', journal)
    app.router.add_get('/consent', copy)
    app.router.add_get('/picture/{name:.*}', shown)
    app.router.add_get('/static/{name:.*}', static)


def read_desk_files() -> Mapping[str, PageFile]:
    """
    Return the files of the pages by their path.

    :raises CrgameError: if a page is not installed.
    """
    pages = page_directory()
    table: dict[str, PageFile] = {}
    for folder in SHARED:
        table |= read_files(pages / folder, f'/static/{folder}/')
    for path, file in PAGES.items():
        if f'/static/{file}' not in table:
            raise CrgameError(f'{pages / file}: a page of the desk is missing; '
                              'install crgame_ros again')
        table[path] = table[f'/static/{file}']
    return table


def _is_experimenter(request: web.Request, access: Access, experimenters: Invitations) -> bool:
    return experimenters.rights(request.cookies.get(_cookie_name(request, access))) is not None


def _cookie_name(request: web.Request, access: Access) -> str:
    sockname = request.get_extra_info('sockname')
    return cookie_name(sockname[1] if sockname else 0, access.tls is not None, 'desk')


def _frames(request: web.Request, desk: Desk) -> str:
    """Return the allowed origins of frames with the drive: this machine, at any port."""
    if request.path not in ('/', '/experimenter'):
        return "'none'"
    host = urlsplit(f'//{request.host}').hostname or ''
    names = dict.fromkeys((host, *(_LOOPBACK if is_loopback(host) else ())))
    # An IPv6 literal does not allow a wildcard port.
    allowed = [f'{scheme}://{name}:*' for name in names if name and ':' not in name
               for scheme in ('http', 'https')]
    link = urlsplit(desk.drives.state.link)
    if link.scheme in ('http', 'https') and ';' not in link.netloc and ' ' not in link.netloc:
        allowed.append(f'{link.scheme}://{link.netloc}')
    return ' '.join(allowed) or "'none'"


def _telling(pages: DeskPages) -> Callable[[web.Application], AsyncIterator[None]]:
    """Update experimenters' pages several times a second, and drop pages that do not read."""
    async def notify() -> None:
        loop = asyncio.get_running_loop()
        checked_s = loop.time()
        while True:
            await asyncio.sleep(TOLD_EVERY_S)
            if pages.is_due:
                pages.update_experimenters()
            if loop.time() - checked_s > _STALL_CHECK_S:
                checked_s = loop.time()
                for client in pages.clients:
                    client.check_stall(checked_s)

    async def telling(_: web.Application) -> AsyncIterator[None]:
        task = asyncio.create_task(notify())
        yield
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
    return telling
