# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The server, as a browser sees it: files, ports, messages and replies, shutdown."""

import asyncio
import json
from pathlib import Path
import re
import shutil
import struct
import time

from aiohttp import ClientSession, web, WSMsgType, WSServerHandshakeError
from cockpit_support import (
    close_code,
    cockpit,
    get,
    HOST,
    in_loop,
    next_text,
    PumpBackend,
    wait_until,
)
from crgame_ros.cockpit import hub, page_files, server
from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.frames import FrameKind
from crgame_ros.cockpit.page_messages import SeenView, Sound
from crgame_ros.cockpit.server import create_app, listen
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.paths import page_directory
from crgame_ros.type_stripping import strip_types
import pytest


@in_loop
async def test_the_page_plotly_and_all_files_of_the_page_are_served(tmp_path: Path) -> None:
    page = shutil.copytree(page_directory() / 'cockpit', tmp_path / 'page')
    async with cockpit(page=page) as running:
        async with running.http.get(f'{running.address}/') as answer:
            assert answer.status == 200 and answer.content_type == 'text/html'
            lines = (await answer.text()).splitlines()
            assert [line for line in lines if 'modulepreload' not in line] == [
                *(page / 'index.html').read_text().splitlines()]
        async with running.http.get(f'{running.address}/plotly.js') as answer:
            assert answer.content_type == 'text/javascript'
            assert b'plotly.js (basic' in (await answer.read())[:200]
        scripts = [path for path in page.rglob('*.ts') if not path.name.endswith('.d.ts')]
        assert scripts
        for script in scripts:
            name = script.relative_to(page).with_suffix('.js').as_posix()
            async with running.http.get(f'{running.address}/static/{name}') as answer:
                assert (answer.status, answer.content_type) == (200, 'text/javascript'), name
                assert await answer.read() == strip_types(script.read_bytes(), name)


@in_loop
async def test_an_unchanged_file_is_not_sent_again() -> None:
    async with cockpit() as running:
        async with running.http.get(f'{running.address}/plotly.js') as answer:
            tag = answer.headers['ETag']
        again = {'If-None-Match': tag}
        async with running.http.get(f'{running.address}/plotly.js', headers=again) as answer:
            assert answer.status == 304 and await answer.read() == b''


@in_loop
async def test_only_kinds_that_a_page_has_are_read(tmp_path: Path) -> None:
    (tmp_path / 'js').mkdir()
    for name in ('index.html', 'js/a.ts', 'js/b.d.ts', 'notes.txt', 'key.pem', '.hidden'):
        (tmp_path / name).write_text('a;')
    absent = ('js/a.ts', 'js/b.d.ts', 'js/b.js', 'js/b.d.js', 'notes.txt', 'key.pem', '.hidden',
              'index.html', '')
    async with cockpit(page=tmp_path) as running:
        found = {name: (await get(running.port, f'/static/{name}'))[0]
                 for name in ('js/a.js', *absent)}
    assert found == {'js/a.js': 200, **dict.fromkeys(absent, 404)}


@in_loop
async def test_a_fault_in_a_script_is_told_with_its_place(tmp_path: Path) -> None:
    (tmp_path / 'index.html').write_text('')
    (tmp_path / 'a.ts').write_text('const a = 1;\nenum B { c }\n')
    async with cockpit(page=tmp_path) as running:
        status, answer = await get(running.port, '/static/a.js')
    assert status == 500
    assert answer.endswith(b'\r\n\r\na.ts: line 2, column 1: `enum B { c }` is more than a type, '
                           b'and browsers do not know it\n')


@in_loop
async def test_a_page_names_the_scripts_it_begins_with_and_comes_packed(tmp_path: Path) -> None:
    """Those that only others import, too, but none of types alone; whoever asks gets it plain."""
    (tmp_path / 'js').mkdir()
    for name, text in (
            ('index.html', '<script type="module" src="/static/js/a.js"></script>'),
            ('js/a.ts', "import {\n  b,\n} from './b.js';\nimport type { D } from './d.js';\n"),
            ('js/b.ts', "import { a } from './a.js';\nexport { c } from './c.js';\n"),
            ('js/c.ts', "import './e.js';\nconst text = '/* from \\'./f.js\\' */';\n"),
            *((f'js/{name}.ts', 'const x: number = 1;\n' * 100) for name in 'def')):
        (tmp_path / name).write_text(text)
    async with cockpit(page=tmp_path) as running:
        for path, words in (('/', 3), ('/static/js/e.js', 0)):
            answers = {}
            for packing in ('gzip', 'identity'):
                async with running.http.get(running.address + path, headers={
                        'Accept-Encoding': packing}) as answer:
                    answers[packing] = await answer.text()
                    assert answer.headers.get('Content-Encoding', 'identity') == packing
                    assert answer.headers['Vary'] == 'Accept-Encoding'
                    size = int(answer.headers['Content-Length'])
            assert answers['gzip'] == answers['identity'] and size >= len(answers['identity'])
            assert answers['gzip'].count('modulepreload') == words
        async with running.http.get(f'{running.address}/') as answer:
            page = await answer.text()
    assert re.findall('modulepreload" href="([^"]+)"', page) == [
        f'/static/js/{name}.js' for name in 'bce']


def test_a_missing_page_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(CrgameError, match='page of the cockpit is missing'):
        page_files.read_page(tmp_path)


@in_loop
async def test_libraries_are_served_from_when_they_are_there(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Libraries may appear while the server runs; no other file of their folder is served."""
    monkeypatch.setattr(page_files, 'find_libraries', lambda: next(tmp_path.iterdir(), None))
    async with cockpit() as running:
        for path in page_files.LIBRARIES:
            async with running.http.get(running.address + path) as answer:
                assert answer.status == 404
        folder = tmp_path / 'fetched'
        folder.mkdir()
        for name in (*page_files.LIBRARIES.values(), 'three-LICENSE'):
            (folder / name).write_text(f'// {name}')
        for path, name in page_files.LIBRARIES.items():
            async with running.http.get(running.address + path) as answer:
                assert (answer.status, answer.content_type) == (200, 'text/javascript')
                assert await answer.text() == f'// {name}'
                assert answer.headers['Cache-Control'] == 'no-cache'
        for name in ('three-LICENSE', '..%2Ffetched%2Fx.js', 'other.js'):
            async with running.http.get(f'{running.address}/three/{name}') as answer:
                assert answer.status == 404, name


@in_loop
async def test_every_answer_has_the_headers_that_protect_the_page() -> None:
    async with cockpit() as running:
        kept = {}
        for path in ('/', '/static/js/main.js', '/plotly.js', '/api/scenarios', '/nothing'):
            async with running.http.get(f'{running.address}{path}') as answer:
                policy = answer.headers['Content-Security-Policy']
                assert policy.startswith("default-src 'self'; style-src 'self'; img-src")
                assert "frame-ancestors 'none'" in policy and 'script-src' not in policy
                assert answer.headers['X-Content-Type-Options'] == 'nosniff'
                assert answer.headers['Referrer-Policy'] == 'no-referrer'
                assert 'aiohttp' not in answer.headers['Server']
                kept[path] = answer.headers['Cache-Control']
    assert kept == {'/': 'no-store', '/static/js/main.js': 'no-cache', '/plotly.js': 'no-cache',
                    '/api/scenarios': 'no-store', '/nothing': 'no-store'}


@in_loop
async def test_one_origin_may_show_the_page_and_the_page_is_told_which() -> None:
    async with cockpit(framed_by='http://127.0.0.1:8070') as running:
        for path in ('/', '/static/js/main.js', '/nothing'):
            async with running.http.get(f'{running.address}{path}') as answer:
                policy = answer.headers['Content-Security-Policy']
                assert 'frame-ancestors http://127.0.0.1:8070; base-uri' in policy
                assert policy.startswith("default-src 'self';")
        joined = await running.join()
        assert (await next_text(joined, 'hello'))['framed_by'] == 'http://127.0.0.1:8070'
        # The framing page may show the cockpit, but its own scripts may not connect.
        with pytest.raises(WSServerHandshakeError):
            await running.join(Origin='http://127.0.0.1:8070')
        await joined.close()


@in_loop
async def test_a_client_gets_hello_documents_and_frames() -> None:
    async with cockpit() as running:
        socket = await running.join()
        kinds = []
        async for message in socket:
            if message.type is WSMsgType.BINARY:
                break
            kinds.append(json.loads(message.data)['type'])
        assert kinds == ['hello', 'seats', 'scene']
        kind, _, n = struct.unpack_from('<3d', message.data)
        assert kind == FrameKind.STATE and n >= 1
        await socket.close()


@in_loop
async def test_requests_get_the_backends_reply_and_inputs_do_not() -> None:
    async with cockpit() as running:
        socket = await running.join()
        for event, ok, text in (('go', True, 'did trigger'),
                                ('forbidden', False, 'event: is not to be'),
                                ('broken', False, 'it failed; the log of the server says why')):
            await socket.send_json({'type': 'trigger', 'event': event, 'id': 7})
            assert await next_text(socket, 'reply') == {
                'type': 'reply', 'to': 7, 'ok': ok, 'text': text}
        await socket.send_json({'type': 'input', 'seat': 'hv0', 'keys': [1, 0, 0, 0]})
        asked_s = time.monotonic()
        await socket.send_json({'type': 'ping', 't': 5.5})
        async for message in socket:
            if message.type is WSMsgType.TEXT:
                pong = json.loads(message.data)
                assert (pong['type'], pong['t']) == ('pong', 5.5)
                assert asked_s <= pong['steady_s'] <= time.monotonic()
                break
        assert running.backend.commands[-1] == ('c1', {
            'type': 'input', 'seat': 'hv0', 'keys': [True, False, False, False]})
        await socket.close()


@in_loop
async def test_a_request_that_takes_long_does_not_hold_up_inputs() -> None:
    async with cockpit() as running:
        socket = await running.join()
        running.backend.held.clear()
        await socket.send_json({'type': 'trigger', 'event': 'slow', 'id': 1})
        await socket.send_json({'type': 'control', 'action': 'start', 'id': 2})
        await socket.send_json({'type': 'input', 'seat': 'hv0', 'away': True})
        await wait_until(lambda: len(running.backend.commands) == 2, 'the input')
        assert [message['type'] for _, message in running.backend.commands] == [
            'trigger', 'input']
        running.backend.held.set()
        # Requests are answered in their order.
        assert [(await next_text(socket, 'reply'))['to'] for _ in range(2)] == [1, 2]
        await socket.close()


@in_loop
async def test_a_request_is_finished_though_its_page_has_gone() -> None:
    async with cockpit() as running:
        socket = await running.join()
        running.backend.held.clear()
        for number in range(2):
            await socket.send_json({'type': 'trigger', 'event': f'{number}', 'id': number})
        await wait_until(lambda: len(running.backend.commands) == 1, 'the first')
        await socket.close()
        await wait_until(lambda: running.backend.gone == ['c1'], 'the end')
        running.backend.held.set()
        await asyncio.sleep(0.05)
        assert len(running.backend.commands) == 1


@in_loop
async def test_too_many_waiting_requests_are_refused_one_by_one() -> None:
    async with cockpit() as running:
        socket = await running.join()
        running.backend.held.clear()
        await socket.send_json({'type': 'trigger', 'event': 'slow', 'id': 0})
        await wait_until(lambda: len(running.backend.commands) == 1, 'the first')
        for number in range(1, server.MAX_REQUESTS + 2):
            await socket.send_json({'type': 'claim', 'seat': 'hv0', 'id': number})
        reply = await next_text(socket, 'reply')
        assert (reply['to'], reply['ok']) == (server.MAX_REQUESTS + 1, False)
        running.backend.held.set()
        assert (await next_text(socket, 'reply'))['ok']
        await socket.close()


@in_loop
async def test_names_layers_and_sound_are_kept() -> None:
    async with cockpit() as running:
        socket = await running.join()
        await socket.send_json({'type': 'name', 'name': 'Ada'})
        await socket.send_json({'type': 'sound', 'on': 1, 'volume': 0.5, 'rumble': 0.25})
        await socket.send_json({
            'type': 'view', 'shown': 'chase', 'inset': 1, 'plans': 0, 'mirrors': 0, 'bare': 0,
            'software': 1, 'width_px': 900, 'height_px': 500, 'ratio': 0.5, 'renderer': 'x'})
        await socket.send_json({'type': 'layers', 'predictions': True})
        client = running.hub.clients['c1']
        await wait_until(lambda: client.wants_predictions, 'the layers')
        assert client.name == 'Ada' and not running.backend.commands
        assert client.sound == Sound(on=True, volume=0.5, rumble=0.25)
        assert client.view == SeenView(
            shown='chase', inset=True, plans=False, mirrors=False, bare=False, software=True,
            width_px=900.0, height_px=500.0, ratio=0.5, renderer='x')
        # Unnamed layers stay; a client that adds one gets its newest frame, also in a pause.
        wanted = running.hub.send_frame
        wanted('seen:1', b'12345678', only_if=lambda other: other.perceives_as == 'av0')
        await socket.send_json({'type': 'layers', 'perception': 'av0', 'scans': True})
        await wait_until(lambda: client.wants_scans, 'the layers')
        assert client.wants_predictions and client.perceives_as == 'av0'
        while (message := await socket.receive(timeout=5.0)).data != b'12345678':
            assert message.type in (WSMsgType.TEXT, WSMsgType.BINARY)
        await socket.close()


@in_loop
async def test_an_address_gets_no_more_than_its_share_and_silent_pages_give_way() -> None:
    async with cockpit(backend=PumpBackend(period_s=0.1)) as running:
        sockets = [await running.join() for _ in range(hub.MAX_OF_ADDRESS)]
        late = await running.join()
        assert await close_code(late) == 1013
        clients = list(running.hub.clients.values())
        assert len(running.backend.present) == len(clients) == hub.MAX_OF_ADDRESS
        # All but one have been silent for a while; the longest silent one drives.
        for age_s, client in enumerate(reversed(clients)):
            client.heard_s -= 2.0 * hub.GIVES_WAY_S + age_s
        clients[0].drives = True
        await sockets[2].send_json({'type': 'ping', 't': 1})
        await next_text(sockets[2], 'pong')
        again = await running.join()
        await next_text(again, 'hello')
        await wait_until(lambda: running.backend.gone == ['c2'], 'the longest silent one to go')
        for socket in [*sockets, again]:
            await socket.close()


@in_loop
async def test_a_client_that_says_nothing_is_no_page() -> None:
    async with cockpit(backend=PumpBackend(period_s=0.1)) as running:
        socket = await running.join()
        await next_text(socket, 'hello')
        running.hub.clients['c1'].heard_s -= hub.SILENT_S
        # A pong is the browser's, not the page's.
        await socket.pong()
        await wait_until(lambda: running.backend.gone == ['c1'], 'it to go')
        await socket.close()


@in_loop
async def test_the_next_free_port_is_taken() -> None:
    async with cockpit() as running:
        app = create_app(PumpBackend(), Access(HOST, running.port), None)
        runner, port = await listen(app, HOST, running.port)
        assert running.port < port < running.port + server.PORTS_TRIED
        assert (await get(port, '/'))[0] == 200
        # The first server's name and port are not valid for the second.
        assert (await get(port, '/', host=f'{HOST}:{running.port}'))[0] == 403
        await runner.cleanup()


@in_loop
async def test_ports_that_cannot_be_used_are_an_error_and_stop_the_backend(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, 'PORTS_TRIED', 1)
    async with cockpit() as running:
        for host, port, message in ((HOST, running.port, 'are taken'),
                                    ('203.0.113.1', 8000, 'cannot listen')):
            backend = PumpBackend()
            app = create_app(backend, Access(host, port, 'x' * 16), None)
            with pytest.raises(InputError, match=message):
                await listen(app, host, port)
            assert backend.stopped


@pytest.mark.clock
@in_loop
async def test_the_end_closes_every_socket_within_a_second() -> None:
    backend = PumpBackend()
    runner, port = await listen(create_app(backend, Access(HOST, 0), None), HOST, 0)
    async with ClientSession() as http:
        reading = await http.ws_connect(f'http://{HOST}:{port}/ws')
        # This client never answers the server's close frame.
        deaf = await http.ws_connect(f'http://{HOST}:{port}/ws', autoclose=False)
        backend.held.clear()
        await reading.send_json({'type': 'trigger', 'event': 'never ends', 'id': 1})
        await wait_until(lambda: bool(backend.commands) and len(backend.present) == 2, 'both')
        closing = asyncio.create_task(close_code(reading))
        loop = asyncio.get_running_loop()
        start_s = loop.time()
        await runner.cleanup()
        # The server has one second; the rest is for a busy machine.
        assert loop.time() - start_s < 2.0
        assert await closing == 1001
        assert sorted(backend.gone) == ['c1', 'c2'] and backend.stopped
        await deaf.close()


@in_loop
async def test_a_replay_brings_its_own_routes() -> None:
    class Replay(PumpBackend):
        mode = 'replay'

        def routes(self) -> list[web.RouteDef]:
            async def info(_: web.Request) -> web.Response:
                return web.json_response({'chunks': 3})
            return [web.get('/api/replay/info', info)]

    async with cockpit(backend=Replay()) as running:
        async with running.http.get(f'{running.address}/api/replay/info') as answer:
            assert await answer.json() == {'chunks': 3}
        socket = await running.join()
        assert (await next_text(socket, 'hello'))['mode'] == 'replay'
        await socket.close()
