# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is known of whoever sends a request: their rights, and their page."""

from aiohttp import hdrs, web
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.rights import ALL_RIGHTS, Rights
from crgame_ros.errors import CrgameError

# Set by the server's guard.
RIGHTS = web.RequestKey('rights', Rights)
# The key of the page from which a request comes.
KEY_HEADER = 'X-Crgame-Key'
# In the order in which they are looked for: most browsers name others, too.
_BROWSERS = (('Firefox/', 'Firefox'), ('Edg/', 'Edge'), ('OPR/', 'Opera'),
             ('Chromium/', 'Chromium'), ('Chrome/', 'Chrome'), ('Version/', 'Safari'))


def granted(request: web.Request) -> Rights:
    """Return what the browser's link or address grants."""
    return request.get(RIGHTS, ALL_RIGHTS)


def actor(request: web.Request, hub: Hub, kind: str) -> Client | None:
    """
    Find whose request it is, and make sure that they may do it.

    :param kind: load or invite.
    :return: None for a program that is no page.
    :raises CrgameError: if they may not.
    """
    client = hub.client_with_key(request.headers.get(KEY_HEADER, ''))
    rights = granted(request) if client is None else client.rights
    refusal = (granted(request).refusal(kind) or rights.refusal(kind))
    if refusal:
        raise CrgameError(refusal)
    return client


def browser_of(request: web.Request) -> str:
    """Name the browser and its version, empty for none that is known."""
    agent = request.headers.get(hdrs.USER_AGENT, '')
    for mark, name in _BROWSERS:
        _, found, rest = agent.partition(mark)
        version = rest.partition('.')[0]
        if found and version.isascii() and version.isdecimal():
            return f'{name} {version[:6]}'
    return ''
