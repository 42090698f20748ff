# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The checks of every request before it is answered, and the headers of answers."""

from collections.abc import Awaitable, Callable
from html import escape

from aiohttp import hdrs, web
from aiohttp.typedefs import Handler, Middleware
from crgame_ros.cockpit.access import Access, cookie_name, is_own_origin
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.doorkeeper import Doorkeeper
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.page_files import PageFile
from crgame_ros.cockpit.rights import ALL_RIGHTS, Rights
from crgame_ros.errors import CrgameError, InputError

# Set by the server's guard.
RIGHTS = web.RequestKey('rights', Rights)
# The key of the page from which a request comes.
KEY_HEADER = 'X-Crgame-Key'
# In the order of the search: most browsers name others, too.
_BROWSERS = (('Firefox/', 'Firefox'), ('Edg/', 'Edge'), ('OPR/', 'Opera'),
             ('Chromium/', 'Chromium'), ('Chrome/', 'Chrome'), ('Version/', 'Safari'))
KEEPER = web.AppKey('keeper', Doorkeeper)
ACCESS = web.AppKey('access', Access)
# How long a browser keeps its cookie [s].
COOKIE_S = 12 * 3600
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

    :param access: access control of the server.
    :param keeper: counts the connections.
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
    try:
        body = file.body
    except CrgameError as error:
        return web.Response(status=500, text=f'{error}\n')
    return web.Response(body=body, content_type=file.content_type,
                        charset='utf-8' if file.is_text else None,
                        headers={hdrs.ETAG: f'"{file.tag}"'})


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
        try:
            cookie = access.exchange(request.query['token'], cookie)
        except InputError as error:
            return web.Response(status=403, text=f'{error}\n')
        rest = request.url.without_query_params('token').relative()
        answer = web.Response(status=303, headers={'Location': str(rest)})
        answer.set_cookie(name, cookie, httponly=True, samesite='Strict',
                          secure=access.tls is not None, max_age=COOKIE_S)
        return answer
    rights = access.rights(cookie)
    if rights is None and also(request):
        rights = ALL_RIGHTS
    if rights is None:
        return web.Response(status=403, text=f'{access.refusal}\n')
    request[RIGHTS] = rights
    return await handler(request)


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
    if not is_own_origin(request.headers.get(hdrs.ORIGIN), host):
        return 'Pages of other sites cannot use this one.'
    foreign = request.headers.get('Sec-Fetch-Site') in ('cross-site', 'same-site')
    if foreign and request.path != '/':
        return 'Pages of other sites cannot use this one.'
    if request.method == hdrs.METH_POST and request.headers.get('X-Crgame') != '1':
        return 'The header X-Crgame: 1 is missing.'
    return ''
