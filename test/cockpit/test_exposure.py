# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cockpit opened to others: links, TLS, roles, and idle connections."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
import hashlib
import json
import logging
from pathlib import Path
import shutil
import ssl
import stat
import subprocess
from typing import Any

from aiohttp import ClientSession, CookieJar, Fingerprint, ServerFingerprintMismatch
from cockpit_support import cockpit, get, HOST, in_loop, next_text, PumpBackend, wait_until
from crgame_ros.cockpit import request_guard
from crgame_ros.cockpit.access import Access, reachable_addresses
from crgame_ros.cockpit.exposure import Exposure, fingerprint, make_certificate, tls_context
from crgame_ros.cockpit.rights import Invitations, Rights
from crgame_ros.cockpit.server import create_app, listen
from crgame_ros.errors import CrgameError, InputError
import pytest

openssl = pytest.mark.skipif(shutil.which('openssl') is None, reason='openssl is not installed')


@asynccontextmanager
async def opened(folder: Path) -> AsyncIterator[tuple[PumpBackend, Access, list[str]]]:
    """Listen as --open-cockpit does, for one seat; return the printed lines."""
    opening = Exposure(HOST, 0, links=True, private=folder)
    access, backend = opening.access(), PumpBackend()
    runner, port = await listen(create_app(backend, access, None), HOST, 0)
    try:
        access = access.at_port(port)
        yield backend, access, opening.lines(access, ['hv0'])
    finally:
        await runner.cleanup()


def links_of(lines: list[str]) -> dict[str, str]:
    """Return the links by their purpose."""
    return {' '.join(line.split()[:-1]): line.split()[-1] for line in lines if '?token=' in line}


@asynccontextmanager
async def browser(folder: Path) -> AsyncIterator[ClientSession]:
    """Behave as a browser whose user has compared the fingerprint."""
    digest = hashlib.sha256(ssl.PEM_cert_to_DER_cert(
        (folder / 'certificate.pem').read_text())).digest()
    async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as http:
        http.trusted = Fingerprint(digest)
        yield http


@openssl
@in_loop
async def test_a_link_lets_one_browser_in_over_tls(tmp_path: Path) -> None:
    async with opened(tmp_path) as (_, access, lines), browser(tmp_path) as anna, \
            browser(tmp_path) as other:
        links = links_of(lines)
        assert list(links) == ['to direct', 'to drive hv0', 'to watch']
        assert all(url.startswith(f'https://{HOST}:{access.port}/?token=')
                   for url in links.values())
        # Another program computes the same fingerprint of the server's certificate as was printed.
        shown = subprocess.run(
            ['openssl', 'x509', '-noout', '-fingerprint', '-sha256', '-in',
             str(tmp_path / 'certificate.pem')], capture_output=True, text=True, check=True)
        assert shown.stdout.strip().partition('=')[2] == fingerprint(tmp_path / 'certificate.pem')
        assert lines[-1].endswith(shown.stdout.strip().partition('=')[2])
        with pytest.raises(ServerFingerprintMismatch):
            await anna.get(links['to drive hv0'], ssl=Fingerprint(bytes(32)))
        async with anna.get(links['to drive hv0'], ssl=anna.trusted,
                            allow_redirects=False) as answer:
            assert (answer.status, answer.headers['Location']) == (303, '/')
            cookie = answer.headers['Set-Cookie']
            for word in ('HttpOnly', 'Secure', 'SameSite=Strict', 'Path=/'):
                assert word in cookie
            assert cookie.startswith('__Host-crgame-') and 'Domain' not in cookie
        async with anna.get(f'{access.url}', ssl=anna.trusted) as answer:
            assert answer.status == 200
        # The driver's own link admits the driver again; others get the reason of the refusal.
        async with anna.get(links['to drive hv0'], ssl=anna.trusted) as answer:
            assert answer.status == 200
        async with other.get(links['to drive hv0'], ssl=other.trusted) as answer:
            assert answer.status == 403
            assert await answer.text() == ('This link has been used: it lets one browser in. '
                                           'Ask whoever gave it to you for another.\n')
        async with other.get(access.url, ssl=other.trusted) as answer:
            assert answer.status == 403 and 'Open a link' in await answer.text()


@openssl
@in_loop
async def test_the_server_decides_what_a_role_may_do(tmp_path: Path) -> None:
    async with opened(tmp_path) as (backend, access, lines), browser(tmp_path) as anna, \
            browser(tmp_path) as guest, browser(tmp_path) as boss:
        links = links_of(lines)
        sockets = {}
        for name, http in (('to drive hv0', anna), ('to watch', guest), ('to direct', boss)):
            async with http.get(links[name], ssl=http.trusted):
                pass
            sockets[name] = await http.ws_connect(f'{access.url}ws', ssl=http.trusted)

        async def ask(name: str, **message: Any) -> dict[str, Any]:
            await sockets[name].send_json({**message, 'id': 1})
            return await next_text(sockets[name], 'reply')

        reset = {'type': 'control', 'action': 'reset'}
        assert (await ask('to direct', **reset))['ok']
        assert 'you are a driver' in (await ask('to drive hv0', **reset))['text']
        assert 'you are a spectator' in (await ask('to watch', **reset))['text']
        claim = {'type': 'claim', 'seat': 'hv0', 'device': ''}
        assert (await ask('to drive hv0', **claim))['ok']
        assert 'only a driver can take a seat' in (await ask('to watch', **claim))['text']
        assert 'you are a director' in (await ask('to direct', **claim))['text']
        # A client cannot gain rights by asking for them; a client that asks for fewer gets fewer.
        assert 'spectator' in (await ask('to watch', type='role', role='all'))['text']
        assert 'spectator' in (await ask('to direct', type='role', role='watch'))['text']
        assert not (await ask('to direct', **reset))['ok']
        await sockets['to watch'].send_json(
            {'type': 'input', 'seat': 'hv0', 'keys': [1, 0, 0, 0]})
        await ask('to watch', **claim)
        assert [message['type'] for _, message in backend.commands] == ['control', 'claim']
        await ask('to direct', type='role', role='all')
        headers = {'X-Crgame': '1'}
        body = json.dumps({'role': 'drive', 'seat': 'hv1'})
        async with guest.post(f'{access.url}api/invite', ssl=guest.trusted, headers=headers,
                              data=body) as answer:
            assert 'only a director can make links' in (await answer.json())['error']
        async with boss.post(f'{access.url}api/invite', ssl=boss.trusted, headers=headers,
                             data=body) as answer:
            more = (await answer.json())['link']
        async with browser(tmp_path) as bert, bert.get(more, ssl=bert.trusted) as answer:
            assert answer.status == 200
        for socket in sockets.values():
            await socket.close()


def test_links_outlive_the_cockpit_and_tell_no_secret(tmp_path: Path) -> None:
    path = tmp_path / 'links.json'
    first = Invitations(path)
    token = first.make('drive', 'hv1')
    cookie = first.exchange(token, None)
    assert token not in path.read_text() and cookie not in path.read_text()
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    again = Invitations(path)
    assert not again.is_new
    assert again.rights(cookie) == Rights(directs=False, drives=True, seat='hv1')
    assert again.exchange(token, cookie) == cookie
    for given, shown in ((token, None), (token, 'another'), ('none', cookie), ('\ud800', None)):
        with pytest.raises(InputError):
            again.exchange(given, shown)
    # Once the file cannot be written, no link is used up or made.
    token = again.make('watch')
    (tmp_path / 'links.new').mkdir()
    for attempt in (lambda: again.exchange(token, None), lambda: again.make('watch')):
        with pytest.raises(CrgameError, match='cannot be written'):
            attempt()
    (tmp_path / 'links.new').rmdir()
    assert again.rights(again.exchange(token, None)) == Rights(directs=False, drives=False)
    assert len(json.loads(path.read_text())) == 2
    assert again.rights(None) is None and again.rights('none') is None
    path.write_text('{"a": 1}')
    with pytest.raises(InputError, match='is no list of links'):
        Invitations(path)


@openssl
def test_a_certificate_is_made_once_or_given(tmp_path: Path) -> None:
    pair = make_certificate(tmp_path, ['192.0.2.7', 'lab-pc'])
    assert stat.S_IMODE(pair[1].stat().st_mode) == 0o600
    before = pair[0].read_bytes()
    assert make_certificate(tmp_path, ['lab-pc'])[0].read_bytes() == before
    told = subprocess.run(['openssl', 'x509', '-noout', '-ext', 'subjectAltName', '-in',
                           str(pair[0])], capture_output=True, text=True, check=True).stdout
    assert 'IP Address:192.0.2.7' in told and 'DNS:lab-pc' in told
    given = Exposure('0.0.0.0', 0, certificate=pair[0], key=pair[1])
    assert given.access().url.startswith('https://')
    (tmp_path / 'other').mkdir()
    other = make_certificate(tmp_path / 'other', ['lab-pc'])
    for wrong in ((pair[0], other[1]), (pair[1], pair[0]), (tmp_path / 'none', pair[1])):
        with pytest.raises(InputError):
            tls_context(*wrong)


def test_without_openssl_one_line_says_what_to_do(tmp_path: Path,
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('PATH', str(tmp_path))
    with pytest.raises(Exception, match='install openssl, or give a certificate with '
                       '--certificate and --key'):
        Exposure(HOST, 0, links=True, private=tmp_path).access()


def test_a_token_on_this_machine_too() -> None:
    opening = Exposure(HOST, 8000, token=True)
    access = opening.access()
    line, = opening.lines(access, [])
    assert line == f'the cockpit is at http://{HOST}:8000/?token={access.token}'
    assert Exposure(HOST, 8000).access().token is None


def test_all_addresses_are_those_that_others_can_open() -> None:
    found = reachable_addresses('0.0.0.0')
    # The kernel's route to another network, if there is one; nothing is sent.
    probe = subprocess.run(['hostname', '-I'], capture_output=True, text=True, check=False)
    own = [item for item in probe.stdout.split() if ':' not in item]
    assert set(own) <= set(found) or found == ('127.0.0.1',)
    assert '0.0.0.0' not in found and reachable_addresses('192.0.2.7') == ('192.0.2.7',)


@in_loop
async def test_connections_that_ask_nothing_are_ended_and_bounded(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(request_guard, 'FIRST_REQUEST_S', 0.2)
    monkeypatch.setattr(request_guard, 'NEXT_REQUEST_S', 0.4)
    monkeypatch.setattr(request_guard, '_LOOK_S', 0.1)
    monkeypatch.setattr(request_guard, 'MAX_OF_ADDRESS', 40)
    async with cockpit() as running:
        joined = await running.join()
        await next_text(joined, 'hello')
        idle = [await asyncio.open_connection(HOST, running.port) for _ in range(60)]
        for _, writer in idle[::2]:
            # A request that never ends is dropped.
            writer.write(b'GET / HTTP/1.1\r\nHost: ')
        for reader, writer in idle:
            try:
                assert await asyncio.wait_for(reader.read(), 30.0) == b''
            except ConnectionError:
                pass
            writer.close()
        # A page with a used connection stays, and others can connect again.
        await asyncio.sleep(0.8)
        await joined.send_json({'type': 'ping', 't': 1})
        await next_text(joined, 'pong')
        assert (await get(running.port, '/'))[0] == 200
        await joined.close()


@in_loop
async def test_those_who_say_nothing_make_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many sockets of an address idle, its next browser is let in at once."""
    monkeypatch.setattr(request_guard, 'MAX_OF_ADDRESS', 10)
    async with cockpit() as running:
        joined = await running.join()
        await next_text(joined, 'hello')
        idle = [await asyncio.open_connection(HOST, running.port) for _ in range(30)]
        assert (await get(running.port, '/'))[0] == 200
        # The page was silent longer, but it is in the middle of a request.
        await joined.send_json({'type': 'ping', 't': 1})
        await next_text(joined, 'pong')
        for _, writer in idle:
            writer.close()
        await joined.close()


@in_loop
async def test_what_is_no_http_leaves_no_traceback() -> None:
    lines: list[str] = []

    class Keep(logging.Handler):

        def emit(self, record: logging.LogRecord) -> None:
            lines.append(self.format(record))

    keep = Keep()
    logging.getLogger().addHandler(keep)
    try:
        async with cockpit() as running:
            for request in (b'\x00\xff\xfe\r\n\r\n', b'GET\r\n\r\n', b'\x16\x03\x01\x02\x00\x01',
                            b'GET / HTTP/9.9\r\n\r\n',
                            b'GET / HTTP/1.1\r\nHost: a\r\nHost\r\n\r\n',
                            b'POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n',
                            b'GET http://[ HTTP/1.1\r\nHost: a\r\n\r\n',
                            b'GET /' + b'a' * 20_000 + b' HTTP/1.1\r\n\r\n',
                            b'POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\nHost: '
                            + f'{HOST}:{running.port}'.encode() + b'\r\n\r\nzz\r\n'):
                _, writer = await asyncio.open_connection(HOST, running.port)
                writer.write(request)
                await asyncio.sleep(0.05)
                writer.close()
            assert (await get(running.port, '/'))[0] == 200
            await wait_until(lambda: running.backend.pumped > 5, 'the backend')
    finally:
        logging.getLogger().removeHandler(keep)
    assert not [line for line in lines if 'Traceback' in line], lines
