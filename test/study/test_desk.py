# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The desk's server over real sockets: documents, orders, who is let in, hostile pages."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
import functools
import json
from pathlib import Path
import random
import re
import sys
from typing import Any

from aiohttp import (
    ClientSession,
    ClientWebSocketResponse,
    CookieJar,
    WSMsgType,
    WSServerHandshakeError,
)
from crgame_ros.cockpit.access import Access
from crgame_ros.errors import InputError
from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.desk_messages import parse_experimenter, parse_participant
from crgame_ros.study.desk.desk_server import serve_desk
from crgame_ros.study.desk.desk_socket import MAX_MALFORMED
from crgame_ros.study.desk.page_markdown import picture, read_tree
from crgame_ros.study.desk.page_words import words_of
from crgame_ros.study.desk.participant_document import participant_document
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.study_file import Page
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from desk_support import DrivesWithoutGraph, write_study  # noqa: E402, I100

PATIENCE_S = 30.0
TIMES = {'shown_at': 10.0, 'answered_at': 12.0, 'taken_s': 2.0}
KEY = 'a' * 32


@dataclass
class Served:
    """A desk that listens, and a browser's worth of client."""

    desk: Desk
    http: ClientSession
    participant: str
    experimenter: str

    @property
    def root(self) -> str:
        return self.participant.partition('?')[0].rstrip('/')

    async def join(self, key: str = KEY, *, fresh: bool = True) -> ClientWebSocketResponse:
        """Open the participant's page."""
        socket = await self.http.ws_connect(f'{self.root}/ws/participant')
        await socket.send_json({'type': 'hello', 'page': key, 'fresh': fresh})
        return socket

    async def direct(self) -> ClientWebSocketResponse:
        """Open the experimenter's page."""
        async with self.http.get(self.experimenter) as answer:
            assert answer.status == 200
        return await self.http.ws_connect(f'{self.root}/ws/experimenter')


@asynccontextmanager
async def served(folder: Path, host: str = '127.0.0.1', step_s: float = 0.02,
                 token: str | None = None, **changed: Any) -> AsyncIterator[Served]:
    study = write_study(folder / 'study', **changed)
    with ParticipantSession(study, folder / 'P07', 'P07', 0) as session:
        desk = Desk(session, DrivesWithoutGraph(session, step_s=step_s))
        runner, lines = await serve_desk(desk, Access(host, 0, token), folder)
        participant, experimenter = (re.findall(r'http\S+', line)[0] for line in lines)
        async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as http:
            try:
                yield Served(desk, http, participant, experimenter)
            finally:
                await asyncio.wait_for(runner.cleanup(), PATIENCE_S)


def in_loop(test: Callable[..., Awaitable[None]]) -> Callable[..., None]:
    """Run a test in an event loop, which must be empty at its end."""
    @functools.wraps(test)
    def run(tmp_path: Path) -> None:
        async def body() -> None:
            await asyncio.wait_for(test(tmp_path), 4 * PATIENCE_S)
            left = asyncio.all_tasks() - {asyncio.current_task()}
            assert not left
        asyncio.run(body())
    return run


async def shown(socket: ClientWebSocketResponse, fits: Callable[[dict[str, Any]], bool]
                ) -> dict[str, Any]:
    """Wait for a message that fits."""
    async with asyncio.timeout(PATIENCE_S):
        async for message in socket:
            if message.type is WSMsgType.TEXT:
                content: dict[str, Any] = json.loads(message.data)
                if fits(content):
                    return content
    pytest.fail(f'the connection ended ({socket.close_code})')


def shows(what: str, item: str = '') -> Callable[[dict[str, Any]], bool]:
    """Fit a document of the participant's page."""
    return lambda content: content['type'] == 'desk' and content['show'] == what \
        and item in ('', content['item'])


async def do(socket: ClientWebSocketResponse, order: dict[str, Any]) -> dict[str, Any]:
    """Give an order as the experimenter; give the reply."""
    await socket.send_json({**order, 'id': 7})
    return await shown(socket, lambda content: content['type'] == 'reply')


async def do_until(served_: Served, socket: ClientWebSocketResponse, wanted: str) -> None:
    """Do as a willing participant does, up to an item."""
    desk = served_.desk
    while (item := desk.session.next_item) is not None and item.id != wanted:
        document = participant_document(desk)
        if document['show'] == 'language':
            await socket.send_json({'type': 'language', 'language': 'de'})
        elif document['show'] == 'drive':
            await socket.send_json({'type': 'ready', 'item': item.id})
        else:
            answers = {question['name']: answer_to(question)
                       for question in document.get('questions', [])}
            await socket.send_json({'type': 'finish', 'item': item.id, 'answers': answers,
                                    'agreed': True, **TIMES})
        # No faster than people, or the page would be dropped.
        await asyncio.sleep(0.06)


def answer_to(question: dict[str, Any]) -> Any:
    """Give an answer that can be taken."""
    match question['kind']:
        case 'choice':
            return [] if question['several'] else question['choices'][0][0]
        case 'text':
            return 'x'
        case 'number':
            return 30
        case _:
            return 1


@in_loop
async def test_a_session_goes_on_by_what_its_page_says(tmp_path: Path) -> None:
    async with served(tmp_path) as running:
        socket = await running.join()
        assert (await shown(socket, shows('language')))['languages'] == ['en', 'de']
        await socket.send_json({'type': 'language', 'language': 'de'})
        words = await shown(socket, lambda content: content['type'] == 'words'
                            and content['words']['next'] == 'Weiter')
        assert set(words['words']) == set(words_of(running.desk.session.study, 'en'))
        document = await shown(socket, shows('questions', 'fields'))
        assert document['study'] == 'Einfädeln mit anderen'
        assert document['progress'] == {'done': 0, 'of': 13, 'drives_done': 0, 'drives': 2}
        assert document['questions'][1]['choices'][0] == ['yes', 'Ja']
        await do_until(running, socket, '')
        assert (await shown(socket, shows('over')))['how'] == 'done'
        finished = [entry for entry in running.desk.session.journal.entries
                    if entry['entry'] == 'finished']
        assert [entry['item'] for entry in finished] == [
            item.id for item in running.desk.session.items]
        assert all(entry['taken_s'] == 2.0 for entry in finished if 'main/' not in entry['item'])
        await socket.close()


@in_loop
async def test_what_is_stale_twice_or_wrong_changes_nothing(tmp_path: Path) -> None:
    async with served(tmp_path, languages=[]) as running:
        socket = await running.join()
        await shown(socket, shows('questions'))
        before = len(running.desk.session.journal.entries)
        wrong = {'type': 'finish', 'item': 'fields', 'answers': {'age': 7, 'licence': 'yes'},
                 **TIMES}
        await socket.send_json(wrong)
        assert 'age' in (await shown(socket, lambda content: content['type'] == 'refused'))['text']
        for item in ('main/1', 'nonsense', 'before/1'):
            await socket.send_json({**wrong, 'item': item})
            await shown(socket, shows('questions', 'fields'))
        assert len(running.desk.session.journal.entries) == before
        right = {**wrong, 'answers': {'age': 33, 'licence': 'yes'}}
        for _ in range(3):
            await socket.send_json(right)
        await shown(socket, shows('page'))
        await socket.send_json({'type': 'finish', 'item': 'before/1', **TIMES})
        assert 'consent' in (await shown(
            socket, lambda content: content['type'] == 'refused'))['text']
        assert len(running.desk.session.journal.entries) == before + 1
        await socket.close()


@in_loop
async def test_who_does_not_agree_ends_the_session(tmp_path: Path) -> None:
    async with served(tmp_path, languages=[]) as running:
        director, socket = await running.direct(), await running.join()
        await do_until(running, socket, 'before/1')
        await socket.send_json({'type': 'finish', 'item': 'before/1', 'agreed': False, **TIMES})
        assert (await shown(socket, shows('over')))['how'] == 'declined'
        told = await shown(director, lambda content: content.get('over') == 'declined')
        assert told['log'][-1]['reason'] == 'consent was not given'
        for each in (socket, director):
            await each.close()


@in_loop
async def test_the_newest_page_is_used_and_an_old_one_takes_over_when_asked(tmp_path: Path
                                                                            ) -> None:
    async with served(tmp_path, languages=[]) as running:
        first = await running.join()
        await shown(first, shows('questions'))
        second = await running.join('b' * 32)
        await shown(second, shows('questions'))
        await shown(first, shows('elsewhere'))
        await first.send_json({'type': 'finish', 'item': 'fields',
                               'answers': {'age': 33, 'licence': 'yes'}, **TIMES})
        await shown(first, shows('elsewhere'))
        assert running.desk.session.next_item.id == 'fields'
        # Who comes back after a broken connection does not push the other aside.
        await first.close()
        first = await running.join(fresh=False)
        await shown(first, shows('elsewhere'))
        await first.send_json({'type': 'here'})
        await shown(first, shows('questions'))
        await shown(second, shows('elsewhere'))
        for each in (first, second):
            await each.close()


@in_loop
async def test_orders_of_the_experimenter(tmp_path: Path) -> None:
    async with served(tmp_path, step_s=0.4) as running:
        director, socket = await running.direct(), await running.join()
        session = running.desk.session
        await do_until(running, socket, 'main/1')
        assert (await do(director, {'type': 'hold', 'held': True}))['ok']
        await shown(socket, shows('wait'))
        await socket.send_json({'type': 'ready', 'item': 'main/1'})
        await shown(socket, shows('wait'))
        assert session.attempts('main/1') == 0
        assert (await do(director, {'type': 'hold', 'held': False}))['ok']
        await shown(socket, shows('drive', 'main/1'))
        await socket.send_json({'type': 'ready', 'item': 'main/1'})
        await shown(socket, lambda content: content.get('phase') == 'driving')
        assert (await do(director, {'type': 'note', 'text': 'late <b>'}))['ok']
        assert (await do(director, {'type': 'mark', 'name': 'spoke'}))['ok']
        note, marker = session.journal.entries[-2:]
        assert (note['text'], note['run'], note['time_s']) == ('late <b>', 'runs/1', 0.01)
        assert (marker['name'], marker['run']) == ('spoke', 'runs/1')
        for order in ({'type': 'skip', 'item': 'main/1', 'reason': 'x'},
                      {'type': 'repeat', 'item': 'fields', 'reason': 'x'}):
            assert 'under way' in (await do(director, order))['text']
        assert (await do(director, {'type': 'abort', 'item': 'main/1', 'reason': 'ill'}))['ok']
        drive = await shown(socket, lambda content: content.get('phase') == 'ready')
        assert drive['attempt'] == 2
        assert (await do(director, {'type': 'repeat', 'item': 'fields', 'reason': 'wrong'}))['ok']
        await shown(socket, shows('questions', 'fields'))
        assert not (await do(director, {'type': 'skip', 'item': 'main/1', 'reason': 'x'}))['ok']
        assert (await do(director, {'type': 'skip', 'item': 'fields', 'reason': 'known'}))['ok']
        document = await shown(director, lambda content: content.get('item') == 'main/1')
        rows = {row['id']: row for row in document['items']}
        assert (rows['fields']['state'], rows['fields']['outcome']) == ('skipped', 'known')
        assert (rows['main/1']['state'], rows['main/1']['attempts']) == ('now', 1)
        assert rows['main/1']['condition'] in ('a', 'b')
        assert document['page']['connected'] and document['drive']['phase'] == 'ready'
        for each in (socket, director):
            await each.close()


@in_loop
async def test_the_end_comes_after_the_drive_and_stays(tmp_path: Path) -> None:
    async with served(tmp_path, step_s=0.4, languages=[]) as running:
        director, socket = await running.direct(), await running.join()
        await do_until(running, socket, 'main/practice')
        await socket.send_json({'type': 'ready', 'item': 'main/practice'})
        await shown(socket, lambda content: content.get('phase') == 'countdown')
        assert (await do(director, {'type': 'end', 'reason': 'asked to stop'}))['ok']
        assert (await shown(socket, shows('over')))['how'] == 'ended'
        assert [entry['entry'] for entry in running.desk.session.journal.entries[-3:]] == [
            'started', 'aborted', 'ended']
        assert 'over already' in (await do(director, {'type': 'end', 'reason': 'x'}))['text']
        for each in (socket, director):
            await each.close()


@in_loop
async def test_a_break_lasts_whatever_the_page_says(tmp_path: Path) -> None:
    async with served(tmp_path, languages=[], before=[{'break': {'minutes': 60}}]) as running:
        socket = await running.join()
        await do_until(running, socket, 'before/1')
        document = await shown(socket, shows('break'))
        assert 3590.0 < document['left_s'] <= 3600.0
        await socket.send_json({'type': 'finish', 'item': 'before/1', **TIMES})
        await shown(socket, lambda content: content['type'] == 'refused')
        assert running.desk.session.next_item.id == 'before/1'
        await socket.close()


@in_loop
async def test_only_who_has_the_printed_link_is_the_experimenter(tmp_path: Path) -> None:
    async with served(tmp_path) as running:
        for path in ('/experimenter', '/experimenter/journal', '/ws/experimenter',
                     '/experimenter?token=guessed'):
            async with running.http.get(f'{running.root}{path}') as answer:
                text = await answer.text()
                assert answer.status == 403 and 'participant' not in text, path
        director = await running.direct()
        async with running.http.get(f'{running.root}/experimenter/journal') as answer:
            lines = (await answer.text()).splitlines()
            assert 'attachment' in answer.headers['Content-Disposition']
            assert json.loads(lines[0])['entry'] == 'begun'
        async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as other, \
                other.get(running.experimenter) as answer:
            assert answer.status == 403 and 'not good any more' in await answer.text()
        await director.close()


@in_loop
async def test_other_sites_names_and_tokens(tmp_path: Path) -> None:
    async with served(tmp_path, token='correct-horse-battery') as running:
        for headers in ({}, {'Origin': 'http://evil.example'}):
            with pytest.raises(WSServerHandshakeError):
                await running.http.ws_connect(f'{running.root}/ws/participant', headers=headers)
        async with running.http.get(f'{running.root}/static/study/desk/page/desk.css') as answer:
            assert answer.status == 403
        # The experimenter needs no other token than that of the own link.
        await (await running.direct()).close()
        async with running.http.get(running.participant) as answer:
            assert answer.status == 200
            policy = answer.headers['Content-Security-Policy']
            assert "default-src 'self'" in policy and 'http://127.0.0.1:*' in policy
            assert "frame-ancestors 'none'" in policy and 'unsafe' not in policy
        for path in ('../study.yaml', 'study.yaml', '%2e%2e/P07/journal.jsonl', 'consent.md'):
            async with running.http.get(f'{running.root}/picture/{path}') as answer:
                assert answer.status == 404, path
        async with running.http.get(f'{running.root}/picture/road.png') as answer:
            assert (answer.status, answer.content_type) == (200, 'image/png')


@in_loop
async def test_a_hostile_page_is_dropped_and_the_others_go_on(tmp_path: Path) -> None:
    rng = random.Random(5)
    async with served(tmp_path, languages=[]) as running:
        good = await running.join()
        await shown(good, shows('questions'))
        bad = await running.http.ws_connect(f'{running.root}/ws/participant')
        for text in ('{', '[]', '{"type":"finish"}', '{"type":["x"]}', '[' * 5000):
            await bad.send_str(text)
        assert MAX_MALFORMED == 5
        async with asyncio.timeout(PATIENCE_S):
            while (await bad.receive()).type is not WSMsgType.CLOSED:
                pass
        fast = await running.http.ws_connect(f'{running.root}/ws/participant')
        for _ in range(200):
            await fast.send_json({'type': 'ping', 't': rng.random()})
        async with asyncio.timeout(PATIENCE_S):
            while (await fast.receive()).type is WSMsgType.TEXT:
                pass
        await good.send_json({'type': 'finish', 'item': 'fields',
                              'answers': {'age': 33, 'licence': 'yes'}, **TIMES})
        await shown(good, shows('page'))
        await good.close()


@pytest.mark.parametrize('message', [
    'x', '1', 'null', '{"type":"note"}', '{"type":"finish","item":5}',
    '{"type":"finish","item":"a","shown_at":NaN,"answered_at":1,"taken_s":1}',
    '{"type":"finish","item":"a","shown_at":1,"answered_at":1,"taken_s":-1}',
    '{"type":"finish","item":"a","shown_at":1,"answered_at":1,"taken_s":1,"answers":{"a":{}}}',
    '{"type":"finish","item":"a","shown_at":1,"answered_at":1,"taken_s":1,"answers":{"a":true}}',
    '{"type":"finish","item":"a","shown_at":1,"answered_at":1,"taken_s":1,"answers":{"a":[1]}}',
    f'{{"type":"ping","t":{"9" * 400}}}', '{"type":"hello","page":"x","fresh":true}',
    '{"type":"ready"}', '{"type":"language","language":null}'])
def test_messages_that_no_page_sends_are_refused(message: str) -> None:
    with pytest.raises(InputError):
        parse_participant(message)


def test_messages_of_the_experimenter_need_their_fields() -> None:
    assert parse_experimenter('{"type":"note","text":"x","id":1,"more":2}') == {
        'type': 'note', 'text': 'x', 'id': 1}
    for message in ('{"type":"note","text":" ","id":1}', '{"type":"note","text":"x"}',
                    '{"type":"end","reason":"","id":1}', '{"type":"hold","held":1,"id":1}',
                    '{"type":"skip","item":"a","reason":"","id":1}',
                    '{"type":"mark","name":"","id":1}', '{"type":"ready","item":"a"}'):
        with pytest.raises(InputError):
            parse_experimenter(message)


def test_markdown_becomes_a_tree_without_html(tmp_path: Path) -> None:
    study = write_study(tmp_path / 'study')
    tree = read_tree(study, Page('welcome.md'), 'de')
    assert tree[0] == {'tag': 'h1', 'children': ['Welcome']}
    assert {'tag': 'em', 'children': ['other']} in tree[1]['children']
    assert '<script>document.title = "hurt"</script>' in tree[1]['children'][-1]
    assert tree[2]['tag'] == 'ol' and tree[2]['children'][0]['children'] == ['Take your seat.']
    assert tree[3]['tag'] == 'table'
    image, _, link, rest = tree[4]['children']
    assert (image['tag'], image['src'], image['alt']) == ('img', 'road.png', 'a road')
    assert link['href'] == 'https://example.org/' and 'javascript' in rest
    assert 'href' not in json.dumps(tree[4]['children'][3:])
    assert read_tree(study, Page('consent.md'), 'de')[0]['children'] == ['Zustimmung']
    assert picture(study, 'road.png') is not None and picture(study, '../road.png') is None
    with pytest.raises(InputError, match='no such page'):
        read_tree(study, Page('none.md'), 'en')


def test_words_of_another_language_come_from_a_file(tmp_path: Path) -> None:
    study = write_study(tmp_path / 'study')
    (study.base / 'words.fr.yaml').write_text('next: Continuer\n', encoding='utf-8')
    french = words_of(study, 'fr')
    assert french['next'] == 'Continuer' and french['agree'] == 'I agree'
    assert words_of(study, 'de').keys() == words_of(study, 'en').keys()
    (study.base / 'words.it.yaml').write_text('nxet: Avanti\n', encoding='utf-8')
    with pytest.raises(InputError, match='no word of the page'):
        words_of(study, 'it')
