# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Participants at other machines: links over TLS, at an address that others can reach."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
import hashlib
from pathlib import Path
import re
import shutil
import ssl
import sys
from typing import Any

from aiohttp import (
    ClientConnectionError,
    ClientSession,
    CookieJar,
    Fingerprint,
    WSServerHandshakeError,
)
from crgame_ros.cockpit.access import reachable_addresses
from crgame_ros.study.conduct.session_run import SessionRequest
from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.server import serve_desk
from crgame_ros.study.participant_session import ParticipantSession
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from desk_client import (  # noqa: E402, I100
    do_until,
    in_loop,
    KEY,
    PATIENCE_S,
    Served,
    shown,
    shows,
)
from desk_support import DrivesWithoutGraph, write_study  # noqa: E402, I100

pytestmark = pytest.mark.skipif(shutil.which('openssl') is None,
                                reason='openssl is not installed')

# One that other machines reach, if this machine has one.
ADDRESS = reachable_addresses('0.0.0.0')[0]


@dataclass
class Opened(Served):
    """
    A desk that is opened to other machines.

    :param folder: of links and certificate.
    """

    folder: Path

    @asynccontextmanager
    async def browser(self) -> AsyncIterator[ClientSession]:
        """Behave as a browser whose user has compared the fingerprint."""
        der = ssl.PEM_cert_to_DER_cert((self.folder / 'certificate.pem').read_text())
        async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as http:
            http.trusted = Fingerprint(hashlib.sha256(der).digest())
            yield http

    async def get(self, http: ClientSession, address: str, **headers: str) -> tuple[int, str]:
        async with http.get(address, ssl=http.trusted, headers=headers) as answer:
            return answer.status, await answer.text()

    async def enter(self, http: ClientSession) -> Any:
        """Open the participant's page."""
        socket = await http.ws_connect(f'{self.root}/ws/participant', ssl=http.trusted)
        await socket.send_json({'type': 'hello', 'page': KEY, 'fresh': True})
        return socket


@asynccontextmanager
async def opened(folder: Path, **changed: Any) -> AsyncIterator[Opened]:
    """Serve a desk as `crgame study run --listen` does."""
    study = write_study(folder / 'study', **changed)
    private = folder / '.private'
    private.mkdir(exist_ok=True)
    request = SessionRequest(study, folder / 'P07', 'P07', 0, listen=ADDRESS)
    with ParticipantSession(study, request.folder, 'P07', 0) as session:
        desk = Desk(session, DrivesWithoutGraph(session, step_s=0.02))
        runner, lines = await serve_desk(desk, request.exposure(private).access(), private)
        participant, experimenter = (re.findall(r'https\S+', line)[0] for line in lines)
        async with ClientSession() as http:
            try:
                yield Opened(desk, http, participant, experimenter, private)
            finally:
                await asyncio.wait_for(runner.cleanup(), PATIENCE_S)


@in_loop
async def test_one_link_lets_the_participants_browser_in(tmp_path: Path) -> None:
    async with opened(tmp_path) as running, running.browser() as anna, \
            running.browser() as other:
        assert running.root.startswith(f'https://{ADDRESS}:')
        # Without a link there is nothing, and nothing without TLS.
        for path in ('/', '/static/desk/desk.css', '/consent', '/experimenter',
                     '/picture/road.png', '/?token=guessed'):
            assert (await running.get(anna, running.root + path))[0] == 403, path
        with pytest.raises(ClientConnectionError):
            await anna.get(running.participant.replace('https', 'http'))
        # The first browser is let in, again as well; others are not.
        assert await running.get(anna, running.participant) == (
            200, (await running.get(anna, running.root))[1])
        assert (await running.get(anna, running.participant))[0] == 200
        status, text = await running.get(other, running.participant)
        assert status == 403 and 'This link has been used' in text
        assert (await running.get(other, running.root))[0] == 403
        with pytest.raises(WSServerHandshakeError):
            await running.enter(other)
        # The participant's cookie opens nothing of the experimenter's.
        for path in ('/experimenter', '/experimenter/journal', '/ws/experimenter'):
            assert (await running.get(anna, running.root + path))[0] == 403, path
        assert (await running.get(other, running.experimenter))[0] == 200
        assert (await running.get(other, f'{running.root}/experimenter/journal'))[0] == 200


@in_loop
async def test_pages_of_other_sites_get_nothing(tmp_path: Path) -> None:
    async with opened(tmp_path) as running, running.browser() as anna:
        await running.get(anna, running.participant)
        for headers in ({'Origin': 'https://evil.example'}, {'Origin': 'null'},
                        {'Host': 'evil.example', 'Origin': running.root}):
            assert (await running.get(anna, running.root, **headers))[0] == 403, headers
        for site in ('cross-site', 'same-site'):
            assert (await running.get(anna, f'{running.root}/static/desk/desk.css',
                                      **{'Sec-Fetch-Site': site}))[0] == 403


@in_loop
async def test_a_click_on_a_link_in_a_mail_is_begun_again_here(tmp_path: Path) -> None:
    """A browser sends no strict cookie with it, so the link would seem to be used by another."""
    async with opened(tmp_path) as running, running.browser() as anna, \
            running.browser() as stranger:
        status, text = await running.get(anna, running.participant,
                                         **{'Sec-Fetch-Site': 'cross-site'})
        token = running.participant.partition('?')[2]
        assert status == 200 and f'content="0; url=/?{token}"' in text
        assert '<h1' not in text and not list(anna.cookie_jar)
        assert (await running.get(anna, running.participant))[0] == 200
        hostile = f'{running.root}/?token=%22%3E%3Cscript%3E'
        _, text = await running.get(stranger, hostile, **{'Sec-Fetch-Site': 'cross-site'})
        assert '<script' not in text and text.count('"') == 4


@in_loop
async def test_a_session_goes_on_after_a_lost_connection_and_another_start(tmp_path: Path
                                                                           ) -> None:
    async with opened(tmp_path) as running, running.browser() as anna:
        await running.get(anna, running.participant)
        socket = await running.enter(anna)
        await do_until(running, socket, 'before/3')
        await socket.close()
        socket = await running.enter(anna)
        await shown(socket, shows('device', 'before/3'))
        await do_until(running, socket, 'main/2')
        await socket.close()
    async with opened(tmp_path) as again, again.browser() as anna:
        # A new start prints another link.
        assert (await again.get(anna, again.participant))[0] == 200
        socket = await again.enter(anna)
        assert again.desk.session.next_item.id == 'main/2'
        await do_until(again, socket, '')
        await shown(socket, shows('over'))
        await socket.close()
