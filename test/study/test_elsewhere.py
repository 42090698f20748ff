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
import time
from typing import Any

from aiohttp import (
    ClientConnectionError,
    ClientSession,
    CookieJar,
    Fingerprint,
    WSServerHandshakeError,
)
from crgame_ros.cli import main
from crgame_ros.cockpit.access import Access, reachable_addresses
from crgame_ros.cockpit.exposure import Exposure
from crgame_ros.cockpit.server import listen
from crgame_ros.errors import InputError
from crgame_ros.schema.reading import read
from crgame_ros.study.conduct.reception_run import ReceptionRequest, Sessions
from crgame_ros.study.desk.desk import Desk, PINGS
from crgame_ros.study.desk.pages import words_of
from crgame_ros.study.desk.participant_document import participant_document
from crgame_ros.study.desk.reception import create_reception_app, Reception
from crgame_ros.study.desk.server import PARTICIPANT, serve_desk
from crgame_ros.study.elsewhere import Elsewhere, PlatformIds
from crgame_ros.study.folder import StudyFolder
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
    exposure = Exposure(ADDRESS, 0, links=True, private=private)
    with ParticipantSession(study, folder / 'P07', 'P07', 0) as session:
        desk = Desk(session, DrivesWithoutGraph(session, step_s=0.02))
        runner, lines = await serve_desk(desk, exposure.access(), private)
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


@in_loop
async def test_a_slow_link_keeps_the_first_drive_from_beginning(tmp_path: Path) -> None:
    bound_s, slow_s = 0.1, 0.15
    async with opened(tmp_path, languages=[], before=[], after=[], quality={
            'link_delay_s': bound_s}) as running, running.browser() as anna:
        await running.get(anna, running.participant)
        socket = await running.enter(anna)

        async def ping(count: int, delay_s: float) -> None:
            """Measure round trips as the page does; each pong comes late by a delay."""
            measured: dict[str, float] = {}
            for _ in range(count):
                sent_s = time.monotonic()
                await socket.send_json({'type': 'ping', 't': sent_s, **measured})
                await shown(socket, lambda content: content['type'] == 'pong')
                await asyncio.sleep(delay_s)
                measured = {'round_trip_ms': 1e3 * (time.monotonic() - sent_s)}

        await do_until(running, socket, 'main/practice')
        await ping(PINGS, slow_s)
        told = participant_document(running.desk)
        assert (told['show'], told['why']) == ('wait', 'slow')
        assert told['link']['bound_ms'] == 1e3 * bound_s
        assert 1e3 * slow_s <= told['link']['median_ms'] <= told['link']['worst_ms']
        await socket.send_json({'type': 'ready', 'item': 'main/practice'})
        await ping(1, 0.0)
        assert not running.desk.session.attempts('main/practice')
        assert [entry['text'] for entry in running.desk.session.journal.entries
                if entry['entry'] == 'note'][0].startswith('the link is too slow')
        # It goes on by itself, and a link that becomes slow later is for the bounds of drives.
        await ping(2 * PINGS, 0.0)
        assert participant_document(running.desk)['show'] == 'drive'
        await do_until(running, socket, 'main/1')
        await ping(PINGS, slow_s)
        await do_until(running, socket, '')
        assert running.desk.session.attempts('main/2') == 1
        await socket.close()


PLATFORM = {'id_from': 'PROLIFIC_PID', 'completion_code': 'C1A2B3', 'screen_out_code': 'S9',
            'completed_address': 'https://app.example.org/submissions/complete?cc={code}'}
# Ids of a platform that are none.
HOSTILE = ('', ' ', 'a b', 'a/b', '../../etc', 'a' * 65, 'me@example.org', '"><script>', 'a\nb',
           '\u0661', 'a\x00', '{code}', '=1+1')


def test_ids_of_a_platform_become_ids_of_the_study(tmp_path: Path) -> None:
    ids = PlatformIds.begun(tmp_path / 'a')
    own = ids.own_id('5f0c1234abcd')
    assert re.fullmatch('E[0-9a-f]{12}', own)
    # It is always the same, also after another start, and that of another is another.
    assert PlatformIds.begun(tmp_path / 'a').own_id('5f0c1234abcd') == own
    assert PlatformIds(tmp_path / 'a').token == ids.token
    assert len({ids.own_id(f'{number:x}') for number in range(2000)}) == 2000
    # Without the secret of the study, nobody can tell whose it is.
    other = PlatformIds.begun(tmp_path / 'b')
    assert other.own_id('5f0c1234abcd') != own and other.token != ids.token
    key = tmp_path / 'a' / '.private' / 'platform.key'
    assert key.parent.stat().st_mode & 0o077 == 0
    assert b'5f0c1234abcd' not in key.read_bytes() and len(ids.token) == 32
    for given in (*HOSTILE, '\ud800'):
        with pytest.raises(InputError, match='is no id of a platform'):
            ids.own_id(given)
    key.write_bytes(b'short')
    with pytest.raises(InputError, match='is no key'):
        PlatformIds.begun(tmp_path / 'a')
    with pytest.raises(InputError, match='has received nobody yet'):
        PlatformIds(tmp_path / 'c')


@pytest.mark.parametrize(('key', 'value'), [
    ('id_from', 'token'), ('id_from', 'a b'), ('id_from', ''), ('completion_code', 'a"b'),
    ('completion_code', ''), ('completed_address', 'http://example.org/'),
    ('completed_address', 'javascript:alert(1)'), ('completed_address', 'https://a b/'),
    ('completed_address', 'https://user@example.org/')])
def test_a_platform_is_refused_that_cannot_be_one(key: str, value: str) -> None:
    with pytest.raises(InputError, match=key):
        read(Elsewhere, PLATFORM | {key: value}, 'elsewhere')


@pytest.mark.parametrize(('age', 'how', 'code'), [(30, 'done', 'C1A2B3'), (19, 'excluded', 'S9')])
def test_the_last_page_has_the_code_of_how_it_ended(tmp_path: Path, age: int, how: str,
                                                    code: str) -> None:
    study = write_study(
        tmp_path / 'study', languages=[], before=[], after=[], elsewhere=PLATFORM,
        fields=[{'name': 'age', 'number': {'low': 18, 'high': 99}}],
        exclude=[{'when': {'field': 'age', 'below': 20}}])
    with ParticipantSession(study, tmp_path / 'P07', 'P07', 0) as session:
        desk = Desk(session, DrivesWithoutGraph(session))
        desk.finish('fields', {'age': age})
        while session.next_item is not None:
            session.skip('not needed here')
        told = participant_document(desk)
        assert (told['how'], told['code'], told['address']) == (
            how, code, f'https://app.example.org/submissions/complete?cc={code}')


def test_without_a_platform_there_is_no_code(tmp_path: Path) -> None:
    study = write_study(tmp_path / 'study', languages=[])
    with ParticipantSession(study, tmp_path / 'P07', 'P07', 0) as session:
        session.end('tired')
        told = participant_document(Desk(session, DrivesWithoutGraph(session)))
        assert (told['how'], told['code'], told['address']) == ('ended', '', '')


class _Talkative(Sessions):
    """Sessions of a program that prints a line of a megabyte before its link, and waits."""

    def _command(self, participant: str, place: int) -> list[str]:
        return [sys.executable, '-c', 'import time; print("x" * 10**6); '
                f'print("{PARTICIPANT}, page: https://a/", flush=True); time.sleep(600)']


@in_loop
async def test_a_session_that_prints_a_very_long_line_goes_on(tmp_path: Path) -> None:
    """The line is left out; the session keeps its place, and ends with the reception."""
    said: list[str] = []
    sessions = _Talkative(ReceptionRequest(
        write_study(tmp_path / 'study', elsewhere=PLATFORM), tmp_path / 'study' / 'study.yaml',
        StudyFolder(tmp_path / 'data'), Exposure('127.0.0.1', 0), 1), said.append)
    assert await sessions.receive('P01') == Reception('https://a/', 'failed')
    await sessions.end()
    assert await sessions.receive('P02') == Reception(why='full')
    assert not [line for line in said if 'xx' in line]


@in_loop
async def test_those_who_arrive_are_led_to_their_sessions_or_told_why_not(tmp_path: Path) -> None:
    study = write_study(tmp_path / 'study', elsewhere=PLATFORM)
    ids = PlatformIds.begun(tmp_path)
    arrived: list[str] = []
    result = Reception('https://192.0.2.7:8091/?token=x')

    async def receive(participant: str) -> Reception:
        arrived.append(participant)
        return result

    access = Access('127.0.0.1', 0, ids.token)
    runner, port = await listen(create_reception_app(study, access, ids, receive), '127.0.0.1', 0)
    address = access.at_port(port).url
    try:
        async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as http:
            async def arrive(*given: str, language: str = 'de-AT,en;q=0.5') -> tuple[int, str]:
                query = [('PROLIFIC_PID', each) for each in given]
                async with http.get(root, params=[*query, ('STUDY_ID', '1')],
                                    headers={'Accept-Language': language},
                                    allow_redirects=False) as answer:
                    return answer.status, answer.headers.get('Location', await answer.text())

            root = address.partition('?')[0]
            # Whoever does not have the platform's address gets nothing.
            assert (await arrive('p1'))[0] == 403
            async with http.get(f'{root}?token=guessed&PROLIFIC_PID=p1') as answer:
                assert answer.status == 403
            assert not arrived
            async with http.get(f'{address}&PROLIFIC_PID=p1', allow_redirects=False) as answer:
                assert (answer.status, answer.headers['Location']) == (303, '/?PROLIFIC_PID=p1')
            assert await arrive('p1') == (303, 'https://192.0.2.7:8091/?token=x')
            assert await arrive('p1') == await arrive('p1') and arrived == 3 * [ids.own_id('p1')]
            for given in HOSTILE:
                status, text = await arrive(given)
                assert status == 400 and 'Dieser Link sagt nicht' in text, given
                assert '<script' not in text
            assert (await arrive())[0] == (await arrive('p1', 'p2'))[0] == 400
            assert len(arrived) == 3
            for language in ('en', 'de', 'fr', '', '<script>', ';;,,' * 99):
                result = Reception(why='full')
                status, text = await arrive('p2', language=language)
                words = words_of(study, language if language == 'de' else 'en')
                assert status == 503 and words['arrive_full'] in text and 'refresh' in text
            result = Reception(why='done')
            status, text = await arrive('p1')
            assert status == 200 and 'Code: C1A2B3' in text
            assert 'href="https://app.example.org/submissions/complete?cc=C1A2B3"' in text
            result = Reception(why='declined')
            assert 'Code' not in (await arrive('p1'))[1]
            async with http.get(f'{root}static/desk/desk.css') as answer:
                assert answer.status == 200
            for path in ('experimenter', 'static/desk/experimenter.html', 'ws/participant'):
                async with http.get(root + path) as answer:
                    assert answer.status == 404, path
    finally:
        await asyncio.wait_for(runner.cleanup(), PATIENCE_S)


@pytest.mark.parametrize(('command', 'more', 'message'), [
    ('serve', (), '--listen'),
    ('serve', ('--listen', '127.0.0.1', '--capacity', '0'), '--capacity'),
    ('serve', ('--listen', '127.0.0.1', '--certificate', 'c.pem'), 'belong together'),
    ('serve', ('--listen', '203.0.113.9'), 'cannot listen'),
    ('serve', ('--id-of', 'p1'), 'has received nobody yet'),
    ('run', ('--participant', 'P1', '--certificate', 'c.pem', '--key', 'k.pem'), '--listen'),
    ('run', ('--participant', 'P1', '--listen', '127.0.0.1', '--certificate', 'c.pem', '--key',
             'k.pem'), 'there is no such file'),
    ('run', ('--participant', 'P1', '--absent', 'nan'), '--absent')])
def test_options_that_cannot_be_used_begin_nothing(
        command: str, more: tuple[str, ...], message: str, tmp_path: Path,
        capsys: pytest.CaptureFixture[str]) -> None:
    write_study(tmp_path / 'study', elsewhere=PLATFORM)
    out = tmp_path / 'data'
    assert main(['study', command, str(tmp_path / 'study' / 'study.yaml'), '--out', str(out),
                 *more]) == 2
    told = capsys.readouterr().err
    assert message in told and 'Traceback' not in told
    assert not out.exists()


def test_those_who_drive_together_do_not_come_from_a_platform(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_study(tmp_path, elsewhere=PLATFORM, settings={'seats': ['hv0', 'av0']})
    assert main(['study', 'serve', str(tmp_path / 'study.yaml'), '--listen', '127.0.0.1']) == 2
    assert 'is for participants who drive together' in capsys.readouterr().err
