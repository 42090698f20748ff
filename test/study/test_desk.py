# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The desk's server over real sockets: documents, orders, access, hostile pages."""

import asyncio
import json
import logging
from pathlib import Path
import random
import sys

from aiohttp import ClientSession, CookieJar, WSMsgType, WSServerHandshakeError
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.page_socket import MAX_MALFORMED, PageSocket
from crgame_ros.study.desk.pages import words_of
from crgame_ros.study.desk.participant_document import experimenter_document
from crgame_ros.study.desk.server import LINKS, MAX_PAGES
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from desk_client import (  # noqa: E402, I100
    do,
    do_until,
    in_loop,
    PATIENCE_S,
    served,
    shown,
    shows,
    TIMES,
)


@pytest.mark.slow
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
async def test_refused_consent_ends_the_session(tmp_path: Path) -> None:
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
        # A page that reconnects after a broken connection does not displace the other page.
        await first.close()
        first = await running.join(fresh=False)
        await shown(first, shows('elsewhere'))
        await first.send_json({'type': 'here'})
        await shown(first, shows('questions'))
        await shown(second, shows('elsewhere'))
        for each in (first, second):
            await each.close()


@pytest.mark.slow
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
        assert (rows['fields']['state'], rows['fields']['reason']) == ('skipped', 'known')
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
        assert 'already ended' in (await do(director, {'type': 'end', 'reason': 'x'}))['text']
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
async def test_a_page_that_says_nothing_is_silent_and_its_delays_are_unknown(
        tmp_path: Path) -> None:
    """The desk's clock is set on: the same as a page that has frozen for a minute."""
    async with served(tmp_path) as running:
        socket, director = await running.join(), await running.direct()
        ping = {'type': 'ping', 't': 1.0, 'round_trip_ms': 12.5, 'seated': True}
        await socket.send_json(ping)
        await shown(director, lambda content: content['type'] == 'desk'
                    and content['page'].get('round_trip_ms') == 12.5)
        usual_s = running.desk.clock_s
        running.desk.clock_s = lambda: usual_s() + 60.0
        page = (await shown(director, lambda content: content['type'] == 'desk'
                            and 'silent_s' in content['page']))['page']
        assert page.keys() == {'connected', 'open', 'silent_s'} and page['silent_s'] >= 60
        await socket.send_json(ping)
        page = (await shown(director, lambda content: content['type'] == 'desk'
                            and 'silent_s' not in content['page']))['page']
        assert page['round_trip_ms'] == 12.5 and page['seated'] is True
        await socket.close()
        await director.close()


@in_loop
async def test_an_experimenters_page_has_a_language_of_its_own(tmp_path: Path) -> None:
    """Words that cannot be read are replaced, so that the page can show what is wrong."""
    async with served(tmp_path) as running:
        study = running.desk.session.study
        (study.base / 'words.it.yaml').write_text('desk_log: Registro\n', encoding='utf-8')
        (study.base / 'words.fr.yaml').write_text('nothing: rien\n', encoding='utf-8')
        first, second = await running.direct(), await running.direct_again()
        for socket, wanted, language, log in (
                (first, 'de', 'de', 'Protokoll'), (second, 'it', 'it', 'Registro'),
                (second, 'xx', 'en', 'Log'), (second, '../it', 'en', 'Log'),
                (second, 'fr', 'en', 'Log')):
            await socket.send_json({'type': 'language', 'language': wanted})
            told = await shown(socket, lambda content: content['type'] == 'words')
            assert (told['language'], told['words']['desk_log']) == (language, log)
            assert told['languages'] == ['de', 'en', 'fr', 'it']
        # The participant has not chosen yet, and the other page keeps its words.
        assert running.desk.session.language is None
        assert (await do(first, {'type': 'note', 'text': 'Grüße'}))['ok']
        for socket in (first, second):
            await socket.close()


@in_loop
async def test_what_a_drive_leaves_in_doubt_is_told_by_its_numbers(tmp_path: Path) -> None:
    """From the journal; values that another program has spoiled are left out."""
    async with served(tmp_path, languages=[], fields=[], before=[]) as running:
        session, socket = running.desk.session, await running.join()
        await do_until(running, socket, 'main/1')
        session.start('runs/1')
        session.finish(outcome='time', quality={'away_s': 1.27, 'resets': 'many', 'stimuli': 3},
                       doubts=['page hidden or without the focus 1.3 s instead of at most 0.5 s'])
        session.journal.entries[-1]['quality']['device_changes'] = float('inf')
        row = next(row for row in experimenter_document(running.desk, {})['items']
                   if row['id'] == 'main/1')
        assert (row['state'], row['outcome'], row['kind'], row['what']) == (
            'finished', 'time', 'drive', '1')
        assert row['doubts'] == [{'check': 'away_s', 'value': 1.27, 'bound': 0.5, 'unit': 's',
                                  'digits': 1, 'least': False}]
        await socket.close()


@in_loop
async def test_only_the_printed_link_makes_an_experimenter(tmp_path: Path) -> None:
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
async def test_a_link_that_cannot_be_saved_is_refused_in_a_sentence_and_stays(
        tmp_path: Path) -> None:
    async with served(tmp_path) as running:
        links = tmp_path / LINKS
        links.rename(tmp_path / 'aside')
        links.mkdir()
        async with running.http.get(running.experimenter) as answer:
            text = await answer.text()
            assert answer.status == 500 and text.count('\n') == 1, text
            assert 'Server got itself in trouble' not in text and str(tmp_path) not in text
        links.rmdir()
        await (await running.direct()).close()


@in_loop
async def test_a_page_to_which_nothing_can_be_sent_is_told_in_the_log(tmp_path: Path) -> None:
    """What nobody has foreseen would else leave no trace."""
    said: list[object] = []

    async def fail(*_: object) -> None:
        raise RuntimeError('unforeseen')

    async with served(tmp_path) as running:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Client, '_send', fail)
            patch.setattr(logging.getLogger(PageSocket.__module__), 'error',
                          lambda text, *parts, **_: said.append(text % parts))
            page = await running.join()
            async with asyncio.timeout(PATIENCE_S):
                while (await page.receive()).type is not WSMsgType.CLOSED:
                    pass
    assert said == ['cannot send to participant 1']


@in_loop
async def test_other_sites_names_and_tokens(tmp_path: Path) -> None:
    async with served(tmp_path, token='correct-horse-battery') as running:
        for headers in ({}, {'Origin': 'http://evil.example'}):
            with pytest.raises(WSServerHandshakeError):
                await running.http.ws_connect(f'{running.root}/ws/participant', headers=headers)
        async with running.http.get(f'{running.root}/static/desk/desk.css') as answer:
            assert answer.status == 403
        # The experimenter needs no token but that of the own link.
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


@in_loop
async def test_many_pages_of_a_participant_do_not_shut_the_experimenter_out(tmp_path: Path
                                                                            ) -> None:
    async with served(tmp_path, languages=[]) as running:
        pages = [await running.join() for _ in range(MAX_PAGES)]
        with pytest.raises(WSServerHandshakeError):
            await running.join()
        director = await running.direct()
        for page in (*pages, director):
            await page.close()
