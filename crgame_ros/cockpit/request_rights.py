# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rights and the page of the client that sends a request."""

from aiohttp import hdrs, web
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.rights import ALL_RIGHTS, Rights
from crgame_ros.errors import CrgameError

# Set by the server's guard.
RIGHTS = web.RequestKey('rights', Rights)
# The key of the page from which a request comes.
KEY_HEADER = 'X-Crgame-Key'
# In the order of the search: most browsers name others, too.
_BROWSERS = (('Firefox/', 'Firefox'), ('Edg/', 'Edge'), ('OPR/', 'Opera'),
             ('Chromium/', 'Chromium'), ('Chrome/', 'Chrome'), ('Version/', 'Safari'))


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
