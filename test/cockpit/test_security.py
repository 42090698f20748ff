# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Attacks on the server, over real sockets: each is refused and harms no other client."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
import gc
import os
import socket
import threading
import tracemalloc
from typing import Any

from aiohttp import ClientWebSocketResponse, WSMsgType, WSServerHandshakeError
from cockpit_support import (
    close_code,
    Cockpit,
    cockpit,
    get,
    HOST,
    in_loop,
    next_text,
    PATIENCE_S,
    PumpBackend,
    raw_request,
    wait_until,
)
from crgame_ros.cockpit.access import cookie_for
from crgame_ros.cockpit.page_socket import MAX_MALFORMED
import pytest

TOKEN = 'correct-horse-battery-staple-123'
UPGRADE = ('Connection: Upgrade', 'Upgrade: websocket', 'Sec-WebSocket-Version: 13',
           'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==')


@in_loop
async def test_pages_of_other_sites_get_nothing() -> None:
    async with cockpit() as running:
        port = running.port
        for origin in ('http://evil.example', f'http://localhost:{port}', 'null',
                       f'http://{HOST}:{port + 1}', f'http://{HOST}:{port}.evil.example'):
            with pytest.raises(WSServerHandshakeError) as caught:
                await running.join(Origin=origin)
            assert caught.value.status == 403
            assert (await get(port, '/api/scenarios', f'Origin: {origin}'))[0] == 403
        # A request for an image or script of another page has no Origin, but has Sec-Fetch-Site.
        for site in ('cross-site', 'same-site'):
            assert (await get(port, '/static/js/main.js', f'Sec-Fetch-Site: {site}'))[0] == 403
        # A link on another page may lead here.
        assert (await get(port, '/', 'Sec-Fetch-Site: cross-site'))[0] == 200
        assert running.backend.present == []
        own = await running.join(Origin=running.address)
        await next_text(own, 'hello')
        await own.close()


@in_loop
async def test_names_that_others_made_point_here_get_nothing() -> None:
    async with cockpit() as running:
        port = running.port
        for host in (f'evil.example:{port}', f'{HOST}:{port + 1}', HOST, f'{HOST}.nip.io:{port}'):
            for target in ('/', '/static/js/main.js', '/api/scenarios', '/api/planner?name=idm',
                           '/ws'):
                status, answer = await get(port, target, *UPGRADE[1:], host=host)
                assert status == 403 and b'<html' not in answer
        assert (await get(port, '/', host=f'localhost:{port}'))[0] == 200
        # HTTP/1.0 needs no Host.
        assert b' 403 ' in await raw_request(port, b'GET / HTTP/1.0\r\n\r\n')


@in_loop
async def test_without_the_token_nothing_is_served_and_the_token_is_not_told() -> None:
    async with cockpit(token=TOKEN) as running:
        cookie = f'Cookie: crgame-{running.port}='
        for headers in ((), (cookie,), (cookie + TOKEN[:-1],), (cookie + TOKEN + 'x',),
                        (cookie + TOKEN,), ('Cookie: crgame=' + cookie_for(TOKEN),)):
            for target in ('/', '/?token=', '/?token=wrong', '/static/js/main.js', '/plotly.js',
                           '/api/scenarios', f'/api/scenarios?token={TOKEN}', '/ws', '/none'):
                status, answer = await get(running.port, target, *headers)
                body = answer.partition(b'\r\n\r\n')[2]
                assert (status, body.count(b'\n')) == (403, 1), (headers, target)
                assert TOKEN.encode() not in answer
        with pytest.raises(WSServerHandshakeError):
            await running.join()
        answer = await raw_request(running.port, b'GET / HTTP/1.0\r\n\r\n')
        assert b' 403 ' in answer and TOKEN.encode() not in answer
        assert running.backend.present == []


@in_loop
async def test_the_token_becomes_a_cookie_and_leaves_the_address() -> None:
    async with cockpit(token=TOKEN) as running:
        url = f'{running.address}/?token={TOKEN}'
        # The other parameters of the address stay.
        for rest, place in (('', '/'), ('&stage=hv0&view=map', '/?stage=hv0&view=map'),
                            ('&a=http://b.example', '/?a=http://b.example')):
            async with running.http.get(f'{url}{rest}', allow_redirects=False) as answer:
                assert (answer.status, answer.headers['Location']) == (303, place)
        async with running.http.get(url, allow_redirects=False) as answer:
            cookie = answer.headers['Set-Cookie']
            assert 'HttpOnly' in cookie and 'SameSite=Strict' in cookie
            assert cookie.startswith(f'crgame-{running.port}=') and TOKEN not in cookie
            assert answer.headers['Cache-Control'] == 'no-store'
        async with running.http.get(f'{running.address}/plotly.js') as answer:
            assert answer.status == 200
        joined = await running.join()
        await next_text(joined, 'hello')
        # Other sites are refused even with the token.
        with pytest.raises(WSServerHandshakeError):
            await running.join(Origin='http://evil.example')
        await joined.close()
        # A client with the token may use any name of the machine.
        assert (await get(running.port, f'/?token={TOKEN}', host='lab-pc:8000'))[0] == 303


@in_loop
async def test_paths_lead_nowhere_but_to_the_files_of_the_page() -> None:
    async with cockpit() as running:
        for target in (
                '/static/../server.py', '/static/js/../../server.py', '/../../../etc/passwd',
                '/static/%2e%2e/server.py', '/static/%2e%2e%2fserver.py',
                '/static/..%2f..%2fserver.py', '/static/..%5c..%5cserver.py',
                '/static/js%2fmain.js%00.html', '/static//etc/passwd', '/static/%2fetc%2fpasswd',
                '/static/....//server.py', '/static/%252e%252e/server.py', '/static/',
                '/static/js', '/static/./server.py', '/page/index.html',
                '/plotly.js/../server.py'):
            status, answer = await get(running.port, target)
            assert status in (400, 404), target
            assert b'Copyright' not in answer and b'root:' not in answer


@in_loop
async def test_other_methods_and_posts_without_the_header_do_nothing() -> None:
    async with cockpit() as running:
        own = f'Origin: {running.address}'
        for headers in ((own,), ('X-Crgame: 0',), ('X-Crgame: 1', 'Origin: http://evil.example')):
            for target in ('/api/load', '/api/upload', '/'):
                status, _ = await get(running.port, target, 'Content-Length: 0', *headers,
                                      method='POST')
                assert status == 403
        for method in ('PUT', 'DELETE', 'PATCH', 'TRACE'):
            assert (await get(running.port, '/', 'X-Crgame: 1', method=method))[0] == 405
        # The server never allows another site to send that header.
        _, answer = await get(running.port, '/api/load', own, method='OPTIONS')
        assert b'access-control' not in answer.lower()


@in_loop
async def test_what_is_no_message_ends_the_connection_after_a_few() -> None:
    bad: dict[str, Callable[[ClientWebSocketResponse], Any]] = {
        'no JSON': lambda sender: sender.send_str('{'),
        'unknown': lambda sender: sender.send_json({'type': '__proto__'}),
        'NaN': lambda sender: sender.send_str(
            '{"type": "input", "seat": "hv0", "axes": [NaN, 0, 0]}'),
        'binary': lambda sender: sender.send_bytes(b'\x00'),
        'deep': lambda sender: sender.send_str('[' * 60_000),
    }
    async with cockpit() as running:
        for send in bad.values():
            sender = await running.join()
            for _ in range(MAX_MALFORMED - 1):
                await send(sender)
            assert (await next_text(sender, 'notice'))['level'] == 'error'
            await send(sender)
            assert await close_code(sender) == 1008
        # One bad message of each kind counts like repeats of one kind.
        sender = await running.join()
        for send in bad.values():
            await send(sender)
        assert await close_code(sender) == 1008
        assert not running.backend.commands
        await wait_until(lambda: len(running.backend.gone) == 6, 'all to be gone')


@in_loop
async def test_the_backend_learns_of_a_drop_before_the_client_does() -> None:
    async with cockpit() as running:
        def misbehave() -> list[str]:
            peer = RawPeer(running.port)
            peer.send_many(b'{', MAX_MALFORMED)
            received = b''
            while b'\x03\xf0' not in received:
                received += peer.socket.recv(4096)
            gone = list(running.backend.gone)
            peer.socket.close()
            return gone

        # The close frame, whose code is 1008 = 0x3f0, is never answered.
        assert await asyncio.to_thread(misbehave) == ['c1']


@in_loop
async def test_a_text_that_is_no_unicode_ends_the_connection() -> None:
    async with cockpit() as running:
        sender = await running.join()
        await sender.send_frame(b'\xff\xfe', WSMsgType.TEXT)
        assert await close_code(sender) == 1007
        await wait_until(lambda: running.backend.gone == ['c1'], 'it to be gone')


@in_loop
async def test_a_message_of_64_kib_is_read_and_a_larger_one_ends_the_connection() -> None:
    async with cockpit() as running:
        sender = await running.join()
        text = '{"type": "claim", "seat": "hv0", "id": 1}'
        await sender.send_str(text + ' ' * (64 * 1024 - len(text)))
        assert (await next_text(sender, 'reply'))['ok']
        await sender.send_str(text + ' ' * (64 * 1024 - len(text) + 1))
        assert await close_code(sender) == 1009
        sender = await running.join()
        with pytest.raises(ConnectionError):
            await sender.send_bytes(bytes(10 * 2 ** 20))
            while True:
                await sender.send_str(text)
        await wait_until(lambda: running.backend.gone == ['c1', 'c2'], 'it to be gone')
        assert len(running.backend.commands) == 1
        await sender.close()


class RawPeer:
    """A WebSocket client in its own thread that violates the protocol, as no library does."""

    def __init__(self, port: int, receive_buffer: int | None = None) -> None:
        self.socket = socket.socket()
        if receive_buffer is not None:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect((HOST, port))
        request = '\r\n'.join(['GET /ws HTTP/1.1', f'Host: {HOST}:{port}', *UPGRADE, '', ''])
        self.socket.sendall(request.encode())
        answer = b''
        while b'\r\n\r\n' not in answer:
            answer += self.socket.recv(1)
        assert b' 101 ' in answer

    def send_many(self, text: bytes, count: int, opcode: int = 1) -> None:
        mask = os.urandom(4)
        masked = bytes(byte ^ mask[index % 4] for index, byte in enumerate(text))
        frame = bytes([0x80 | opcode, 0x80 | len(text)]) + mask + masked
        try:
            self.socket.sendall(frame * count)
        except OSError:
            pass  # The server dropped the client before the last message, as the test expects.

    def read_to_the_end(self) -> bytes:
        received = b''
        try:
            while chunk := self.socket.recv(65536):
                received += chunk
        except ConnectionError:
            pass
        return received


@contextmanager
def frames_of(reader: ClientWebSocketResponse) -> Iterator[list[float]]:
    """Note when each frame arrives at a client that behaves."""
    times: list[float] = []

    async def read() -> None:
        async for message in reader:
            if message.type is WSMsgType.BINARY:
                times.append(asyncio.get_running_loop().time())

    task = asyncio.create_task(read())
    try:
        yield times
    finally:
        task.cancel()


async def check_undisturbed(running: Cockpit, times: list[float], seconds: float) -> None:
    """Check that a client gets nearly all frames that the backend sends meanwhile."""
    pumped, got = running.backend.pumped, len(times)
    await asyncio.sleep(seconds)
    pumped, got = running.backend.pumped - pumped, len(times) - got
    # The attacker runs in this process, and the machine is shared: the backend itself is late.
    assert pumped > 10
    assert got > 0.8 * pumped


@pytest.mark.parametrize('opcode, text', [
    (1, b'{"type": "input", "seat": "hv0", "keys": [1, 0, 0, 0]}'), (9, b'ping'), (2, b'x')],
    ids=['inputs', 'pings', 'binary'])
@in_loop
async def test_a_flood_is_cut_off_and_others_go_on(opcode: int, text: bytes) -> None:
    async with cockpit() as running:
        reader = await running.join()
        await next_text(reader, 'hello')
        with frames_of(reader) as times:
            flood: list[bytes] = []

            def attack() -> None:
                peer = RawPeer(running.port)
                peer.send_many(text, 10_000, opcode)
                flood.append(peer.read_to_the_end())
                peer.socket.close()

            thread = threading.Thread(target=attack)
            loop = asyncio.get_running_loop()
            start_s = loop.time()
            thread.start()
            await check_undisturbed(running, times, 1.0)
            await wait_until(lambda: running.backend.gone == ['c2'], 'the end of the flood')
            await wait_until(lambda: not thread.is_alive(), 'the attacker')
            seconds = loop.time() - start_s
        # The burst, and the refill meanwhile.
        answered = len(running.backend.commands) + flood[0].count(b'\x8a\x04ping')
        assert answered <= min(800 + 400 * seconds, 9_000)
        await reader.close()


@pytest.mark.clock
@in_loop
async def test_a_client_that_sends_400_messages_a_second_is_kept() -> None:
    async with cockpit() as running:
        sender = await running.join()
        for _ in range(100):
            for _ in range(8):
                await sender.send_json({'type': 'input', 'seat': 'hv0', 'away': True})
            await asyncio.sleep(0.02)
        await sender.send_json({'type': 'ping', 't': 1})
        await next_text(sender, 'pong')
        assert len(running.backend.commands) == 800
        await sender.close()


@pytest.mark.clock
@in_loop
async def test_a_client_that_never_reads_is_dropped_and_costs_nothing() -> None:
    # 64 KiB at 100 Hz: 40 MB until it is dropped, if they were kept.
    async with cockpit(backend=PumpBackend(bytes(64 * 1024))) as running:
        reader = await running.join()
        await next_text(reader, 'hello')
        peer = await asyncio.to_thread(RawPeer, running.port, 4096)
        await wait_until(lambda: 'c2' in running.hub.clients, 'the second')
        deaf = running.hub.clients['c2']
        with frames_of(reader) as times:
            gc.collect()
            tracemalloc.start()
            try:
                before, _ = tracemalloc.get_traced_memory()
                await check_undisturbed(running, times, 3.0)
                _, peak = tracemalloc.get_traced_memory()
            finally:
                tracemalloc.stop()
            # One frame is half sent; the newest of each slot waits behind it.
            assert deaf.waiting <= 2 and deaf._unsent() <= 64 * 1024 + 16
            assert peak - before < 4 * 2 ** 20
            await wait_until(lambda: running.backend.gone == ['c2'], 'it to be dropped')
        assert deaf.dropped == 'reads nothing'
        peer.socket.close()
        await reader.close()


@pytest.mark.clock
@in_loop
async def test_a_silent_client_is_noticed() -> None:
    # The client neither reads nor answers, but no data is unsent either. Only a ping, sent after
    # 5 s and due within 2.5 s, detects it.
    class Quiet(PumpBackend):
        async def _pump(self, hub: Any) -> None:
            await asyncio.Event().wait()

    async with cockpit(backend=Quiet()) as running:
        loop = asyncio.get_running_loop()
        peer = await asyncio.to_thread(RawPeer, running.port)
        start_s = loop.time()
        await wait_until(lambda: running.backend.gone == ['c1'], 'it to be noticed')
        assert loop.time() - start_s < 12.0
        peer.socket.close()
