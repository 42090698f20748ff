# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One client: order, slots, throttle, limits, and the messages that it may send."""

import asyncio
import json
from typing import Any

from aiohttp import WSMsgType
from cockpit_support import in_loop
from crgame_ros.cockpit.client import Client, MAX_WAITING, STALL_S, TokenBucket
from crgame_ros.cockpit.page_messages import clean_text, Input, MAX_BYTES, parse_message
from crgame_ros.errors import InputError
import pytest


class Wire:
    """The other end: keeps what arrives, and takes nothing while it is shut."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self.times: list[float] = []
        self.open = asyncio.Event()
        self.open.set()
        self.unsent = 0
        self.aborted = 0
        self.client = Client('c1', 'Guest 1', self._abort, lambda: self.unsent)

    async def send_frame(self, message: bytes, opcode: WSMsgType) -> None:
        self.sent.append(message)
        self.times.append(asyncio.get_running_loop().time())
        await self.open.wait()

    def _abort(self) -> None:
        self.aborted += 1

    async def run(self, seconds: float = 0.01) -> None:
        """Run the client's sender for a while."""
        task = asyncio.create_task(self.client.write(self))
        await asyncio.sleep(seconds)
        task.cancel()
        await asyncio.wait([task])


@in_loop
async def test_texts_come_first_and_in_order_and_only_the_newest_frame_of_each_slot() -> None:
    wire = Wire()
    for number in range(3):
        wire.client.put_frame('state', b'state %d' % number)
        wire.client.put_frame('plan:2', b'plan %d' % number)
        wire.client.put_event(b'event %d' % number)
    await wire.run()
    assert wire.sent == [b'event 0', b'event 1', b'event 2', b'state 2', b'plan 2']


@in_loop
async def test_an_unsent_document_is_replaced_where_it_waits() -> None:
    wire = Wire()
    wire.client.put_document('scene', b'old scene')
    wire.client.put_document('seats', b'seats')
    wire.client.put_document('scene', b'new scene')
    await wire.run()
    wire.client.put_document('scene', b'newest scene')
    await wire.run()
    assert wire.sent == [b'new scene', b'seats', b'newest scene']


@in_loop
async def test_a_slow_client_sees_fewer_frames_never_older_ones() -> None:
    wire = Wire()
    wire.open.clear()
    task = asyncio.create_task(wire.client.write(wire))
    for number in range(1000):
        wire.client.put_frame('state', b'%d' % number)
        await asyncio.sleep(0)
    assert wire.client.waiting == 1
    wire.open.set()
    await asyncio.sleep(0.01)
    task.cancel()
    await asyncio.wait([task])
    assert wire.sent == [b'0', b'999']


@pytest.mark.clock
@in_loop
async def test_state_is_throttled_to_the_mean_rate_and_the_last_one_is_sent() -> None:
    wire = Wire()
    wire.client.state_period_s = 0.05
    task = asyncio.create_task(wire.client.write(wire))
    for number in range(41):
        wire.client.put_frame('state', b'%d' % number)
        wire.client.put_frame('objects', b'objects')
        await asyncio.sleep(0.01)
    pumped_s = wire.times[-1] - wire.times[0]
    states = [item for item in wire.sent if item != b'objects']
    # One frame at once, then one every 50 ms; a sleep never ends early.
    assert pumped_s / 0.05 - 2 <= len(states) <= pumped_s / 0.05 + 2
    assert len(wire.sent) - len(states) == 41
    # A pause: no new frame comes, and the state that the throttle held back is the last one.
    await asyncio.sleep(0.1)
    assert [item for item in wire.sent if item != b'objects'][-1] == b'40'
    task.cancel()
    await asyncio.wait([task])


@in_loop
async def test_too_many_events_drop_the_client_and_free_them() -> None:
    wire = Wire()
    for _ in range(MAX_WAITING):
        wire.client.put_event(b'x')
    assert not wire.aborted
    wire.client.put_event(b'x')
    assert wire.aborted == 1 and wire.client.dropped == 'reads too slowly'
    wire.client.put_event(b'x')
    wire.client.put_document('scene', b'x')
    wire.client.put_frame('state', b'x')
    assert wire.client.waiting == 0 and wire.aborted == 1


@in_loop
async def test_too_many_bytes_drop_the_client_but_a_large_document_does_not() -> None:
    wire = Wire()
    megabyte = bytes(2 ** 20)
    wire.client.put_document('scene', megabyte * 20)
    for _ in range(16):
        wire.client.put_event(megabyte)
    assert not wire.aborted
    wire.client.put_event(b'x')
    assert wire.aborted == 1


@in_loop
async def test_a_connection_that_takes_nothing_is_given_up_one_that_is_slow_is_not() -> None:
    wire = Wire()
    now_s = 0.0
    for wire.unsent in range(1000, 900, -1):
        now_s += 1.0
        wire.client.check_stall(now_s)
    assert not wire.aborted
    # An added ping is no progress; a whole message that was sent is.
    wire.unsent += 2
    wire.client.check_stall(now_s + STALL_S - 0.1)
    assert not wire.aborted
    wire.client.put_event(b'x')
    await wire.run()
    now_s += STALL_S
    wire.client.check_stall(now_s)
    wire.client.check_stall(now_s + STALL_S - 0.1)
    assert not wire.aborted
    wire.client.check_stall(now_s + STALL_S)
    assert wire.aborted == 1


def test_the_bucket_allows_the_burst_then_the_rate() -> None:
    bucket = TokenBucket(400.0, 800.0)
    assert sum(bucket.try_spend(0.0) for _ in range(2000)) == 800
    assert sum(bucket.try_spend(0.5) for _ in range(2000)) == 200
    assert sum(bucket.try_spend(100.0) for _ in range(2000)) == 800


# A page reports its picture in this form; numeric flags become booleans.
MAP_VIEW = {'shown': 'map', 'inset': 0, 'plans': 1, 'mirrors': 0, 'bare': 1, 'software': 0,
            'width_px': 900.0, 'height_px': 500.0, 'ratio': 2.0, 'renderer': ''}
PICTURE = {
    'seat': 'hv0', 'epoch': 2, 'steady_s': 1000.5, 'clock_error_ms': 0.4,
    'place': [0, 23.5, 800, 500, 1920, 1080, 1.5], 'eye': [1e5, -3.0, 0.1, 1.2, 0.0, 0.77, 0.43],
    'shown': [['mirror', 'mirror_left', 0, 0.4, 0.2, 0.6],
              ['vehicle', 'o12', 0.4, 0.45, 0.6, 0.5, 31.07, None]]}
GOOD: list[tuple[dict[str, Any], dict[str, Any]]] = [
    ({'type': 'input', 'seat': 'hv0', 'keys': [1, 0, 0, 1], 'reverse': 1, 'more': 1},
     {'type': 'input', 'seat': 'hv0', 'keys': [True, False, False, True], 'reverse': True}),
    ({'type': 'input', 'seat': 'hv1', 'axes': [0.5, 0, -1.0000001]},
     {'type': 'input', 'seat': 'hv1', 'axes': [0.5, 0.0, -1.0], 'reverse': False}),
    ({'type': 'input', 'seat': 'hv0', 'away': True},
     {'type': 'input', 'seat': 'hv0', 'away': True}),
    ({'type': 'claim', 'seat': 'hv0', 'id': 4},
     {'type': 'claim', 'seat': 'hv0', 'device': '', 'id': 4}),
    ({'type': 'claim', 'seat': 'hv0', 'device': 'G29 <b>\n\u202e', 'id': 4},
     {'type': 'claim', 'seat': 'hv0', 'device': 'G29 b', 'id': 4}),
    ({'type': 'answer', 'seat': 'hv0', 'accept': 1, 'id': 4},
     {'type': 'answer', 'seat': 'hv0', 'accept': True, 'id': 4}),
    ({'type': 'ready', 'seat': 'hv0', 'ready': False, 'id': 4},
     {'type': 'ready', 'seat': 'hv0', 'ready': False, 'id': 4}),
    ({'type': 'person', 'key': '0af' + 29 * '1', 'fresh': True},
     {'type': 'person', 'key': '0af' + 29 * '1', 'fresh': True}),
    ({'type': 'role', 'role': 'watch', 'id': 4}, {'type': 'role', 'role': 'watch', 'id': 4}),
    ({'type': 'ping', 't': 1, 'round_trip_ms': 3},
     {'type': 'ping', 't': 1.0, 'round_trip_ms': 3.0}),
    ({'type': 'release', 'seat': 'av0', 'id': 0}, {'type': 'release', 'seat': 'av0', 'id': 0}),
    ({'type': 'ask', 'seat': 'hv0', 'id': 1}, {'type': 'ask', 'seat': 'hv0', 'id': 1}),
    ({'type': 'hand_over', 'seat': 'hv0', 'to': 'c5', 'id': 1},
     {'type': 'hand_over', 'seat': 'hv0', 'to': 'c5', 'id': 1}),
    ({'type': 'control', 'action': 'step', 'id': 1},
     {'type': 'control', 'action': 'step', 'id': 1}),
    ({'type': 'rate', 'factor': 2, 'id': 1}, {'type': 'rate', 'factor': 2.0, 'id': 1}),
    ({'type': 'planner', 'av': 'av0', 'run': False, 'id': 1},
     {'type': 'planner', 'av': 'av0', 'run': False, 'id': 1}),
    ({'type': 'trigger', 'event': 'cut in', 'id': 1},
     {'type': 'trigger', 'event': 'cut in', 'id': 1}),
    ({'type': 'name', 'name': ' Ada\n<b>Lovelace</b>\u202e '},
     {'type': 'name', 'name': 'Ada bLovelace/b'}),
    ({'type': 'layers', 'predictions': True}, {'type': 'layers', 'predictions': True}),
    ({'type': 'layers', 'perception': 'av0', 'scans': 1},
     {'type': 'layers', 'perception': 'av0', 'scans': True}),
    ({'type': 'layers', 'perception': ''}, {'type': 'layers', 'perception': ''}),
    ({'type': 'sound', 'on': 1, 'volume': 0.5, 'rumble': 1, 'pitch': 2},
     {'type': 'sound', 'on': True, 'volume': 0.5, 'rumble': 1.0}),
    ({'type': 'view', **MAP_VIEW, 'across_deg': None, 'rate_hz': None, 'more': 1},
     {'type': 'view', **MAP_VIEW, 'inset': False, 'plans': True, 'mirrors': False, 'bare': True,
      'software': False}),
    ({'type': 'view', **MAP_VIEW, 'shown': 'driver', 'across_deg': 75, 'screen_width_m': 0.6,
      'eye_distance_m': 0.7, 'rate_hz': 29.5, 'renderer': 'ANGLE <b>'},
     {'type': 'view', **MAP_VIEW, 'inset': False, 'plans': True, 'mirrors': False, 'bare': True,
      'software': False, 'shown': 'driver', 'across_deg': 75.0, 'screen_width_m': 0.6,
      'eye_distance_m': 0.7, 'rate_hz': 29.5, 'renderer': 'ANGLE b'}),
    ({'type': 'ping', 't': 12}, {'type': 'ping', 't': 12.0}),
    ({'type': 'task', 'seat': 'hv0', 'task': 'light', 'number': 3, 'what': 'answer',
      'response_ms': 312, 'delay_ms': 20.5},
     {'type': 'task', 'seat': 'hv0', 'task': 'light', 'number': 3, 'what': 'answer',
      'response_ms': 312.0, 'delay_ms': 20.5}),
    ({'type': 'picture', 'picture': PICTURE},
     {'type': 'picture', 'picture': PICTURE | {'shown': [
         ['mirror', 'mirror_left', 0, 0.4, 0.2, 0.6, None, None], PICTURE['shown'][1]]}}),
]


@pytest.mark.parametrize('sent, read', GOOD, ids=[
    f'{index} {sent["type"]}' for index, (sent, _) in enumerate(GOOD)])
def test_messages_are_read(sent: dict[str, Any], read: dict[str, Any]) -> None:
    found = json.loads(parse_message(json.dumps(sent)).model_dump_json())
    assert {key: found.pop(key) for key in read} == read
    # What was not sent is off, empty or unknown; what nobody knows is dropped.
    assert not any(found.values())


BAD = {
    'no JSON': '{', 'no object': '[1]', 'a number': '1', 'nothing': '',
    'deep': '[' * (MAX_BYTES - 1), 'a huge whole number': '9' * 5000,
    'no type': '{}', 'type is a list': '{"type": []}', 'unknown type': '{"type": "hello"}',
    'no seat': '{"type": "claim", "id": 1}',
    'seat is a path': '{"type": "claim", "seat": "../hv0", "id": 1}',
    'seat in other digits': '{"type": "claim", "seat": "hv\u0661", "id": 1}',
    'no id': '{"type": "claim", "seat": "hv0"}',
    'id is a flag': '{"type": "claim", "seat": "hv0", "id": true}',
    'id is negative': '{"type": "claim", "seat": "hv0", "id": -1}',
    'id is a fraction': '{"type": "claim", "seat": "hv0", "id": 1.5}',
    'a short key': '{"type": "person", "key": "0af", "fresh": false}',
    'no role': '{"type": "role", "role": "root", "id": 1}',
    'a device of numbers': '{"type": "device", "device": 7}',
    'an endless way': '{"type": "ping", "t": 1, "round_trip_ms": 1e9}',
    'to nobody': '{"type": "hand_over", "seat": "hv0", "to": "x", "id": 1}',
    'three keys': '{"type": "input", "seat": "hv0", "keys": [1, 0, 0]}',
    'a key of 2': '{"type": "input", "seat": "hv0", "keys": [2, 0, 0, 0]}',
    'keys and axes': '{"type": "input", "seat": "hv0", "keys": [0,0,0,0], "axes": [0,0,0]}',
    'no keys, no axes': '{"type": "input", "seat": "hv0"}',
    'axis is NaN': '{"type": "input", "seat": "hv0", "axes": [NaN, 0, 0]}',
    'axis overflows': '{"type": "input", "seat": "hv0", "axes": [1e999, 0, 0]}',
    'axis is text': '{"type": "input", "seat": "hv0", "axes": ["0", 0, 0]}',
    'axis out of range': '{"type": "input", "seat": "hv0", "axes": [-0.5, 0, 0]}',
    'away is false': '{"type": "input", "seat": "hv0", "away": false}',
    'unknown action': '{"type": "control", "action": "explode", "id": 1}',
    'action is a list': '{"type": "control", "action": ["stop"], "id": 1}',
    'rate of 0': '{"type": "rate", "factor": 0, "id": 1}',
    'rate of 11': '{"type": "rate", "factor": 11, "id": 1}',
    'rate is infinite': '{"type": "rate", "factor": Infinity, "id": 1}',
    'run is text': '{"type": "planner", "av": "av0", "run": "yes", "id": 1}',
    'planner of a human': '{"type": "planner", "av": "hv0", "run": true, "id": 1}',
    'event too long': json.dumps({'type': 'trigger', 'event': 'e' * 101, 'id': 1}),
    'event is empty': '{"type": "trigger", "event": "", "id": 1}',
    'name of spaces': '{"type": "name", "name": " \\u200b "}',
    'name is a number': '{"type": "name", "name": 4}',
    'layers without': '{"type": "layers"}',
    'perception of a human': '{"type": "layers", "perception": "hv0"}',
    'perception of nobody': '{"type": "layers", "perception": null}',
    'scans are text': '{"type": "layers", "scans": "yes"}',
    'sound without': '{"type": "sound"}',
    'sound too loud': '{"type": "sound", "on": 1, "volume": 1.01, "rumble": 0}',
    'view of the moon': json.dumps({'type': 'view', **MAP_VIEW, 'shown': 'moon'}),
    'view without size': '{"type": "view", "shown": "map"}',
    'view too wide': json.dumps({'type': 'view', **MAP_VIEW, 'across_deg': 181}),
    'view too fine': json.dumps({'type': 'view', **MAP_VIEW, 'ratio': 1e9}),
    'view by a number': json.dumps({'type': 'view', **MAP_VIEW, 'renderer': 4}),
    'sound on is 2': '{"type": "sound", "on": 2, "volume": 1, "rumble": 0}',
    'ping without': '{"type": "ping"}',
    'task of a path': '{"type": "task", "seat": "hv0", "task": "../x", "number": 1, '
                      '"what": "shown"}',
    'task without number': '{"type": "task", "seat": "hv0", "task": "x", "what": "shown"}',
    'task begins': '{"type": "task", "seat": "hv0", "task": "x", "number": 1, "what": "begin"}',
    'task for ever': '{"type": "task", "seat": "hv0", "task": "x", "number": 1, '
                     '"what": "answer", "response_ms": 1e12}',
    **{f'picture with {what}': json.dumps({'type': 'picture', 'picture': PICTURE | change})
       for what, change in (
           ('no seat', {'seat': 'x'}), ('a text for a time', {'steady_s': '1000'}),
           ('no time', {'steady_s': float('nan')}), ('an epoch of text', {'epoch': '2'}),
           ('a short place', {'place': [0, 0, 1, 1]}), ('an infinite eye', {'eye': [1e999] * 7}),
           ('an unknown kind', {'shown': [['cloud', 'a', 0, 0, 1, 1]]}),
           ('a path', {'shown': [['vehicle', '../a', 0, 0, 1, 1]]}),
           ('a number as id', {'shown': [['vehicle', 7, 0, 0, 1, 1]]}),
           ('a box outside', {'shown': [['vehicle', 'o1', 0, 0, 1.1, 1]]}),
           ('a short row', {'shown': [['vehicle', 'o1', 0, 0, 1]]}),
           ('a negative distance', {'shown': [['vehicle', 'o1', 0, 0, 1, 1, -1]]}),
           ('too much', {'shown': [['vehicle', 'o1', 0, 0, 1, 1]] * 201}))},
}


@pytest.mark.parametrize('text', BAD.values(), ids=BAD.keys())
def test_anything_else_is_refused_without_repeating_it(text: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_message(text)
    assert len(str(caught.value)) < 120


def test_names_lose_what_hides_or_marks_up() -> None:
    assert clean_text('<script>alert(1)</script>', 80) == 'scriptalert(1)/script'
    assert clean_text('a\x00b\u200bc\ud800d\u2028e\tf', 80) == 'abcd e f'
    assert clean_text('Zoë 山田', 80) == 'Zoë 山田'
    assert clean_text('x' * 200, 80) == 'x' * 80


def test_axes_are_finite_and_in_range_for_all_that_pass() -> None:
    message = parse_message('{"type": "input", "seat": "hv0", "axes": [1.0005, -0.0005, 1]}')
    assert isinstance(message, Input) and message.axes == (1.0, 0.0, 1.0)
