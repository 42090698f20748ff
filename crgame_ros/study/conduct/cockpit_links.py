# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Links to the cockpit of a study's drives, where it is served to other machines."""

from pathlib import Path

from aiohttp import ClientError, ClientSession, ClientTimeout, CookieJar, Fingerprint
from crgame_ros.cockpit.exposure import fingerprint
from crgame_ros.errors import CrgameError

_PATIENCE_S = 20.0


async def make_links(director: str, certificate: Path, drivers: int) -> tuple[str, ...]:
    """
    Return a link to watch, and some to drive any seat, each for one browser.

    A game chosen later may have other seats than the one with which the cockpit began, so the
    links that it prints do not do.

    :param director: the link to direct, which is used up.
    :param certificate: of the cockpit.
    :param drivers: number of links to drive.
    :raises CrgameError: if the cockpit makes none.
    """
    trusted = Fingerprint(bytes.fromhex(fingerprint(certificate).replace(':', '')))
    page = director.partition('?')[0]
    links = []
    try:
        async with ClientSession(cookie_jar=CookieJar(unsafe=True), raise_for_status=True,
                                 timeout=ClientTimeout(total=_PATIENCE_S)) as http:
            async with http.get(director, ssl=trusted) as answer:
                await answer.read()
            for role in ('watch', *('drive',) * drivers):
                async with http.post(f'{page}api/invite', ssl=trusted, json={'role': role},
                                     headers={'X-Crgame': '1'}) as answer:
                    links.append(str((await answer.json())['link']))
    except (ClientError, TimeoutError, ValueError, KeyError) as error:
        raise CrgameError(f'the cockpit makes no links ({error})') from error
    return tuple(links)
