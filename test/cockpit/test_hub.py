# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All clients: the first messages of a new one, recipients, and values beyond JSON."""

import asyncio
import json
import math
from typing import Any

from cockpit_support import cockpit, in_loop, next_text, wait_until
from crgame_ros import __version__
from crgame_ros.analysis.criticality.criticality import MEASURES
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.shown_paths import without_paths
import numpy as np
import pytest


class Sink:
    """Keeps all messages that are sent to a client."""

    def __init__(self) -> None:
        self.texts: list[dict[str, Any]] = []
        self.frames: list[bytes] = []

    async def send_frame(self, message: bytes, opcode: int) -> None:
        if opcode == 1:
            self.texts.append(json.loads(message, parse_constant=_refuse))
        else:
            self.frames.append(message)

    @property
    def kinds(self) -> list[str]:
        return [text['type'] for text in self.texts]


def _refuse(name: str) -> None:
    raise AssertionError(f'{name} is no JSON')


async def received(client: Client) -> Sink:
    """Return all messages that wait for a client."""
    sink = Sink()
    task = asyncio.create_task(client.write(sink))
    await asyncio.sleep(0.005)
    task.cancel()
    await asyncio.wait([task])
    return sink


def add(hub: Hub) -> Client:
    return hub.add(lambda: None, lambda: 0)


@in_loop
async def test_a_new_client_gets_hello_then_documents_and_the_newest_frames() -> None:
    hub = Hub('live')
    hub.set_document('scene', {'id': 1})
    hub.set_document('seats', {'seats': {}})
    hub.set_document('scene', {'id': 2})
    hub.send_event('notice', {'level': 'info', 'text': 'before it came'})
    hub.send_frame('state', b'old')
    hub.send_frame('state', b'new')
    sink = await received(add(hub))
    program, measures, exposures = (
        sink.texts[0][name] for name in ('program', 'measures', 'exposures'))
    assert [measure['name'] for measure in measures] == [*MEASURES, 'pet']
    assert measures[3] == {
        'name': 'ttc', 'label': 'Time to collision (TTC)', 'unit': 's', 'worst': -1, 'limit': 3.0,
        'definition': MEASURES['ttc'].definition}
    assert exposures[0] == {
        'name': 'tet_s', 'label': 'Time with a TTC below 3 s (TET)', 'unit': 's',
        'definition': 'time with a ttc below 3 s'}
    assert sink.texts == [
        {'type': 'hello', 'client': 'c1', 'name': 'Guest 1', 'mode': 'live',
         'version': __version__, 'program': program, 'rights': {
             'role': 'director and driver', 'directs': True, 'drives': True, 'seat': '',
             'may_direct': True, 'may_drive': True}, 'framed_by': '', 'measures': measures,
         'exposures': exposures},
        {'type': 'scene', 'id': 2}, {'type': 'seats', 'seats': {}}]
    assert sink.frames == [b'new']
    assert (await received(add(hub))).texts[0]['program'] == program
    assert (await received(add(Hub('live')))).texts[0]['program'] != program


@in_loop
async def test_frames_of_the_scene_before_are_not_shown_in_the_next() -> None:
    hub = Hub('live')
    hub.set_document('scene', {'id': 1})
    hub.send_frame('state', b'two vehicles')
    hub.set_document('scene', {'id': 2})
    assert (await received(add(hub))).frames == []


@in_loop
async def test_a_document_that_did_not_change_is_not_sent_again() -> None:
    hub = Hub('live')
    client = add(hub)
    for value in (1, 1, 2):
        hub.set_document('signals', {'k': value})
        await received(client)
    hub.set_document('signals', {'k': 2})
    assert (await received(client)).texts == []


@in_loop
async def test_events_and_frames_can_be_for_some_only() -> None:
    hub = Hub('live')
    first, second = add(hub), add(hub)
    second.wants_predictions = True
    hub.send_event('reply', {'to': 4}, only=first)
    hub.send_frame('prediction:1', b'p', only_if=lambda client: client.wants_predictions)
    one, two = await received(first), await received(second)
    assert one.kinds == ['hello', 'reply'] and one.frames == []
    assert two.kinds == ['hello'] and two.frames == [b'p']


@in_loop
async def test_numbers_that_json_cannot_hold_become_null() -> None:
    hub = Hub('live')
    hub.set_document('status', {
        't': math.nan, 'timing': {'lag': math.inf, 'list': (1.0, -math.inf)},
        'measured': np.float64(math.nan)})
    client = add(hub)
    assert (await received(client)).texts[-1] == {
        'type': 'status', 't': None, 'timing': {'lag': None, 'list': [1.0, None]},
        'measured': None}


@in_loop
async def test_ids_are_never_used_again() -> None:
    hub = Hub('live')
    hub.remove(add(hub))
    assert add(hub).id == 'c2' and list(hub.clients) == ['c2']


@in_loop
async def test_a_client_that_leaves_is_told_of_at_once_and_once() -> None:
    async with cockpit() as running:
        closing, breaking = await running.join(), await running.join()
        await next_text(breaking, 'hello')
        await closing.close()
        # The server tells the backend first and sends its close frame afterwards.
        assert running.backend.gone == ['c1']
        breaking._response.connection.transport.abort()
        await wait_until(lambda: len(running.backend.gone) == 2, 'the second')
        assert running.backend.present == ['c1', 'c2'] == running.backend.gone
        assert not running.hub.clients
        await breaking.close()
    assert running.backend.gone == ['c1', 'c2']


@pytest.mark.parametrize(('text', 'shown'), [
    ('keys:/tmp/a/cut_in.keys.yaml', 'keys:cut_in.keys.yaml'),
    ('policy:/usr/x/p.py:load', 'policy:p.py:load'),
    ('/usr/share/my folder/', 'my folder/'),
    ('/tmp/ärger/x.xml: no lanelet 7', 'x.xml: no lanelet 7'),
    ('/sim/reset: no answer in 5 s', '/sim/reset: no answer in 5 s'),
    ('/hv0/drivability, 3/4 of /timing/cycle', '/hv0/drivability, 3/4 of /timing/cycle'),
    ('http://127.0.0.1/tmp/x', 'http://127.0.0.1/tmp/x')])
def test_a_page_learns_the_names_of_files_and_not_where_they_are(text: str, shown: str) -> None:
    hub = Hub('live')
    hub.set_document('status', {'reason': text})
    assert without_paths(text) == shown
    assert json.loads(hub._documents['status'])['reason'] == shown
