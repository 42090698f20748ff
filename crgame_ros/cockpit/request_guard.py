# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The checks of connections and requests before an answer, and the headers of answers."""

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable
from html import escape
import logging
import ssl

from aiohttp import hdrs, web
from aiohttp.http_exceptions import HttpProcessingError
from aiohttp.typedefs import Handler, Middleware
from crgame_ros.cockpit.access import Access, cookie_name, is_own_origin
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.page_files import PageFile
from crgame_ros.cockpit.rights import ALL_RIGHTS, Rights
from crgame_ros.cockpit.shown_paths import without_paths
from crgame_ros.errors import CrgameError, InputError

# Simultaneous connections, in total and of one address; a browser opens six for a page.
MAX_CONNECTIONS = 256
MAX_OF_ADDRESS = 128
# Until the end of a handshake, in which a connection is not counted yet [s]
HANDSHAKE_S = 3.0
# Until the first request, and between two of them [s]
FIRST_REQUEST_S = 10.0
NEXT_REQUEST_S = 40.0
_LOOK_S = 5.0

_log = logging.getLogger(__name__)
# Set by the server's guard.
RIGHTS = web.RequestKey('rights', Rights)
# The key of the page from which a request comes.
KEY_HEADER = 'X-Crgame-Key'
# In the order of the search: most browsers name others, too.
_BROWSERS = (('Firefox/', 'Firefox'), ('Edg/', 'Edge'), ('OPR/', 'Opera'),
             ('Chromium/', 'Chromium'), ('Chrome/', 'Chrome'), ('Version/', 'Safari'))
ACCESS = web.AppKey('access', Access)
# How long a browser keeps its cookie [s].
_COOKIE_S = 12 * 3600
_POLICY = 'Content-Security-Policy'
_FRAMED_BY = 'frame-ancestors'
_HEADERS = {
    _POLICY: (
        "default-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
        f"connect-src 'self'; {_FRAMED_BY} 'none'; base-uri 'none'; form-action 'none'"),
    'X-Content-Type-Options': 'nosniff',
    'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Resource-Policy': 'same-origin',
    'Server': 'crgame_ros',
}


class Doorkeeper:
    """Counter of the connections of each address, which closes idle ones."""

    def __init__(self) -> None:
        self._of_address: Counter[str] = Counter()
        self._open: dict[asyncio.Transport, _Watched] = {}

    def watched(self, make: Callable[[], asyncio.Protocol]) -> Callable[[], asyncio.Protocol]:
        """Return a factory of watched protocols."""
        return lambda: _Watched(self, make())

    def begins(self, transport: asyncio.BaseTransport | None) -> None:
        """Record that a request has arrived."""
        if transport in self._open:
            self._open[transport].requests += 1
            self._open[transport].spoke = True

    def ends(self, transport: asyncio.BaseTransport | None) -> None:
        """Record that a request has been answered."""
        if transport in self._open:
            watched = self._open[transport]
            watched.requests -= 1
            watched.idle_since_s = asyncio.get_running_loop().time()
            watched.patience_s = NEXT_REQUEST_S

    def lets_in(self, transport: asyncio.Transport, watched: '_Watched') -> bool:
        """
        Count a connection and return True, or return False if there are too many.

        A connection without a request makes room, first one that has never had any.
        """
        crowded = self._of_address[watched.address] >= MAX_OF_ADDRESS
        if crowded or len(self._open) >= MAX_CONNECTIONS:
            idle = {each: item for each, item in self._open.items() if not item.requests
                    and (not crowded or item.address == watched.address)}
            if not idle:
                return False
            oldest = min(idle, key=lambda each: (idle[each].spoke, idle[each].idle_since_s))
            self.forget(oldest, idle[oldest])
            oldest.abort()
        self._of_address[watched.address] += 1
        self._open[transport] = watched
        return True

    def forget(self, transport: asyncio.Transport, watched: '_Watched') -> None:
        """Record that a connection has ended."""
        if self._open.pop(transport, None) is not None:
            self._of_address[watched.address] -= 1
            if not self._of_address[watched.address]:
                del self._of_address[watched.address]


class _Watched(asyncio.Protocol):
    """A wrapper that passes everything on to the protocol of one connection."""

    def __init__(self, keeper: Doorkeeper, protocol: asyncio.Protocol) -> None:
        self._keeper = keeper
        self._protocol = protocol
        self._transport: asyncio.Transport | None = None
        self._refused = False
        self._timer: asyncio.TimerHandle | None = None
        self.address = ''
        self.requests, self.spoke = 0, False
        self.idle_since_s = 0.0
        self.patience_s = FIRST_REQUEST_S

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        peer = transport.get_extra_info('peername')
        self.address = str(peer[0]) if peer else ''
        if not self._keeper.lets_in(transport, self):
            self._refused = True
            transport.abort()
            return
        self._transport = transport
        self.idle_since_s = asyncio.get_running_loop().time()
        self._poll()
        self._protocol.connection_made(transport)

    def connection_lost(self, error: Exception | None) -> None:
        if self._refused or self._transport is None:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._keeper.forget(self._transport, self)
        self._protocol.connection_lost(error)

    def data_received(self, data: bytes) -> None:
        if not self._refused:
            self._protocol.data_received(data)

    def eof_received(self) -> bool | None:
        return None if self._refused else self._protocol.eof_received()

    def pause_writing(self) -> None:
        self._protocol.pause_writing()

    def resume_writing(self) -> None:
        self._protocol.resume_writing()

    def _poll(self) -> None:
        loop = asyncio.get_running_loop()
        if self._transport is not None and not self.requests \
                and loop.time() - self.idle_since_s > self.patience_s:
            self._transport.abort()
            return
        self._timer = loop.call_later(_LOOK_S, self._poll)


class WatchedSite(web.BaseSite):
    """
    A site of the server whose connections a doorkeeper limits.

    :param port: 0 for any.
    :param ssl_context: of TLS; None for plain HTTP.
    """

    def __init__(self, runner: web.AppRunner, host: str, port: int, keeper: Doorkeeper,
                 ssl_context: ssl.SSLContext | None = None) -> None:
        super().__init__(runner, ssl_context=ssl_context)
        self._host = host
        self._port = port
        self._keeper = keeper

    @property
    def name(self) -> str:
        """Return the address."""
        return f'{"https" if self._ssl_context else "http"}://{self._host}:{self._port}'

    async def start(self) -> None:
        """Start listening."""
        await super().start()
        server = self._runner.server
        assert server is not None
        self._server = await asyncio.get_running_loop().create_server(
            self._keeper.watched(server), self._host, self._port,
            ssl=self._ssl_context, backlog=self._backlog,
            ssl_handshake_timeout=HANDSHAKE_S if self._ssl_context else None)


class _StrangersMistakes(logging.Filter):
    """A filter of log records about requests that are not HTTP, which any client can send."""

    def filter(self, record: logging.LogRecord) -> bool:  # noqa: A003
        error = record.exc_info[1] if record.exc_info else None
        return not isinstance(error, HttpProcessingError)


def server_log() -> logging.Logger:
    """Return the log of the HTTP server, without tracebacks of requests that are not HTTP."""
    log = logging.getLogger(f'{__name__}.http')
    if not log.filters:
        log.addFilter(_StrangersMistakes())
    return log


KEEPER = web.AppKey('keeper', Doorkeeper)


def granted(request: web.Request) -> Rights:
    """Return the rights that the browser's link or address grants."""
    return request.get(RIGHTS, ALL_RIGHTS)


def actor(request: web.Request, hub: Hub, kind: str) -> Client | None:
    """
    Return the client that sent a request, and check its rights.

    :param kind: load or invite.
    :return: None for a program that is no page.
    :raises CrgameError: if its rights do not allow the request.
    """
    client = hub.client_with_key(request.headers.get(KEY_HEADER, ''))
    rights = granted(request) if client is None else client.rights
    refusal = (granted(request).refusal(kind) or rights.refusal(kind))
    if refusal:
        raise CrgameError(refusal)
    return client


def browser_of(request: web.Request) -> str:
    """Return the name and version of the browser; empty if it is unknown."""
    agent = request.headers.get(hdrs.USER_AGENT, '')
    for mark, name in _BROWSERS:
        _, found, rest = agent.partition(mark)
        version = rest.partition('.')[0]
        if found and version.isascii() and version.isdecimal():
            return f'{name} {version[:6]}'
    return ''


def guard(access: Access, keeper: Doorkeeper,
          also: Callable[[web.Request], bool] = lambda _: False) -> Middleware:
    """
    Return the middleware that admits or refuses requests.

    :param also: returns whether a request without a valid cookie is admitted nevertheless.
    """
    @web.middleware
    async def guarded(request: web.Request, handler: Handler) -> web.StreamResponse:
        transport = request.transport
        keeper.begins(transport)
        try:
            return await _answer(access, request, handler, also)
        finally:
            keeper.ends(transport)
    return guarded


def header_writer(is_static: Callable[[str], bool], frames: Callable[[web.Request], str] | None
                  = None, framed_by: str = ''
                  ) -> Callable[[web.Request, web.StreamResponse], Awaitable[None]]:
    """
    Return the function that writes the headers of every answer.

    :param is_static: returns whether the answer to a path changes only with its tag.
    :param frames: returns the addresses of pages that a page may frame; None for none.
    :param framed_by: origins of the only pages that may frame this one, as in the header.
    """
    headers = dict(_HEADERS)
    if framed_by:
        headers[_POLICY] = _HEADERS[_POLICY].replace(
            f"{_FRAMED_BY} 'none'", f'{_FRAMED_BY} {framed_by}')

    async def write(request: web.Request, response: web.StreamResponse) -> None:
        own = response.headers.get(_POLICY)
        response.headers.update(headers)
        if own is not None:
            response.headers[_POLICY] = own
        elif frames is not None:
            response.headers[_POLICY] += f'; frame-src {frames(request)}'
        response.headers[hdrs.CACHE_CONTROL] = 'no-cache' if is_static(request.path) \
            else 'no-store'
    return write


def file_answer(request: web.Request, file: PageFile | None) -> web.Response:
    """Return the answer with a file of a page, or that the browser's copy is current."""
    if file is None:
        return web.Response(status=404, text='There is no such file.\n')
    if request.headers.get(hdrs.IF_NONE_MATCH) == f'"{file.tag}"':
        return web.Response(status=304, headers={hdrs.ETAG: f'"{file.tag}"'})
    packs = file.is_text and 'gzip' in request.headers.get(hdrs.ACCEPT_ENCODING, '')
    try:
        body = file.packed if packs else file.body
    except CrgameError as error:
        return web.Response(status=500, text=f'{error}\n')
    return web.Response(body=body, content_type=file.content_type,
                        charset='utf-8' if file.is_text else None,
                        headers={hdrs.ETAG: f'"{file.tag}"', hdrs.VARY: hdrs.ACCEPT_ENCODING,
                                 **({hdrs.CONTENT_ENCODING: 'gzip'} if packs else {})})


async def _answer(access: Access, request: web.Request,
                  handler: Handler,
                  also: Callable[[web.Request], bool]) -> web.StreamResponse:
    sockname = request.get_extra_info('sockname')
    if sockname is None:
        raise ConnectionResetError
    refusal = _refusal(access, request, sockname[1])
    if refusal:
        return web.Response(status=403, text=f'{refusal}\n')
    if access.asks and 'token' in request.query \
            and request.headers.get('Sec-Fetch-Site') == 'cross-site':
        return _begun_here(request)
    name = cookie_name(sockname[1], access.tls is not None)
    cookie = request.cookies.get(name)
    if access.asks and request.path == '/' and 'token' in request.query:
        return enter(request, access.exchange, name,
                     str(request.url.without_query_params('token').relative()))
    rights = access.rights(cookie)
    if rights is None and also(request):
        rights = ALL_RIGHTS
    if rights is None:
        return web.Response(status=403, text=f'{access.refusal}\n')
    request[RIGHTS] = rights
    return await handler(request)


def enter(request: web.Request, exchange: Callable[[str, str | None], str], name: str, to: str,
          refusal: str = '') -> web.Response:
    """
    Exchange the token of an address for a cookie, and return the answer.

    :param exchange: returns the cookie for a token and the browser's cookie.
    :param name: of the cookie.
    :param to: the address of the page.
    :param refusal: what a browser is told that is not admitted; empty for what `exchange` says.
    """
    try:
        cookie = exchange(request.query['token'], request.cookies.get(name))
    except InputError as error:
        return web.Response(status=403, text=f'{refusal or error}\n')
    except CrgameError as error:
        return web.Response(status=500, text=f'{without_paths(str(error))}\n')
    answer = web.Response(status=303, headers={'Location': to})
    answer.set_cookie(name, cookie, httponly=True, samesite='Strict',
                      secure=request.app[ACCESS].tls is not None, max_age=_COOKIE_S)
    return answer


def _begun_here(request: web.Request) -> web.Response:
    """
    Return a page that opens its own address again.

    Browsers send no strict cookie with a navigation that a page of another site began, such as a
    click on a link in a mail.
    """
    return web.Response(content_type='text/html', text=(
        '<!DOCTYPE html><meta http-equiv="refresh" '
        f'content="0; url={escape(str(request.rel_url))}">\n'))


def _refusal(access: Access, request: web.Request, port: int) -> str:
    """Return why a request is refused regardless of its token; empty if it is not."""
    host = request.headers.get(hdrs.HOST, '')
    if not access.allows_host(host, port):
        return f'This is not the name of this server: open http://127.0.0.1:{port}/'
    foreign = request.headers.get('Sec-Fetch-Site') in ('cross-site', 'same-site')
    if not is_own_origin(request.headers.get(hdrs.ORIGIN), host) \
            or foreign and request.path != '/':
        return 'Pages of other sites cannot use this one.'
    if request.method == hdrs.METH_POST and request.headers.get('X-Crgame') != '1':
        return 'The header X-Crgame: 1 is missing.'
    return ''
