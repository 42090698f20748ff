# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Timelines: their contents over time, and the files that are refused."""

import json
from pathlib import Path

from crgame_ros.driver.keyboard import KeyState
from crgame_ros.driver.timeline import (
    JoyTimeline,
    KeyTimeline,
    parse_timeline,
    read_timeline,
    SCRIPTED_LAYOUT,
    timeline_text,
)
from crgame_ros.driver.wheel import normalize
from crgame_ros.errors import InputError
from crgame_ros.yaml_text import MAX_BYTES
import pytest

KEYS = """
keys:
  - {from: 0.0, to: 3.0, hold: [throttle]}
  - {from: 2.0, to: 2.4, hold: left}
  - {from: 2.2, to: 2.6, hold: [left, right]}
  - {from: 6, to: 8, hold: [throttle, reverse]}
  - {from: 8, to: 9, hold: put_back}
"""
JOY = """
joy:
  axes: [throttle, brake, steering]
  points:
    - [1.0, 0.4, 0.0, -0.2]
    - [3.0, 0.8, 0.0, 0.2]
    - [3.5, 0.0, 1.0, 0.0]
  reverse:
    - {from: 2.0, to: 2.5}
  put_back:
    - {from: 3.0, to: 3.25}
"""


def keys() -> KeyTimeline:
    """Read the example of keys."""
    timeline = parse_timeline(KEYS, 'drive.yaml')
    assert isinstance(timeline, KeyTimeline)
    return timeline


def joy(text: str = JOY) -> JoyTimeline:
    """Read an example of axes."""
    timeline = parse_timeline(text, 'drive.yaml')
    assert isinstance(timeline, JoyTimeline)
    return timeline


@pytest.mark.parametrize(('t_s', 'held'), [
    (0.0, {'throttle'}), (1.999999, {'throttle'}), (2.0, {'throttle', 'left'}),
    (2.2, {'throttle', 'left', 'right'}), (2.4, {'throttle', 'left', 'right'}),
    (2.6, {'throttle'}), (3.0, set()), (7.0, {'throttle', 'reverse'}), (8.0, {'put_back'}),
    (1e9, set()), (-1.0, set())])
def test_keys_are_held_from_start_until_just_before_the_end(t_s: float, held: set[str]) -> None:
    """Intervals are half-open and add up where they overlap."""
    assert keys().keys_at(t_s) == KeyState(**dict.fromkeys(held, True))


@pytest.mark.parametrize('rate', [10, 30, 100, 125, 1000])
def test_edges_are_met_at_every_rate(rate: int) -> None:
    """With n * dt on an edge (0.1, 0.7, 1.1, 5.7 s) the new keys hold, for any rounding."""
    lines = [f'  - {{from: {i / 10}, to: {(i + 1) / 10}, hold: [left]}}'
             for i in range(1, 100, 2)]
    timeline = parse_timeline('\n'.join(['keys:', *lines]), 'edges')
    assert isinstance(timeline, KeyTimeline)
    for n in range(10 * rate):
        tenth = n * 10 // rate  # in integers, so without rounding
        assert timeline.keys_at(n * (1.0 / rate)).left == (tenth % 2 == 1)


def test_axes_are_linear_between_points_and_constant_outside() -> None:
    """Half-way between two points every axis has the mean value."""
    at = [normalize(joy().raw_at(t), SCRIPTED_LAYOUT)[:3] for t in (0.0, 1.0, 2.0, 3.0, 3.25, 99)]
    assert at[0] == at[1] == (0.4, 0.0, -0.2)
    assert at[2] == pytest.approx((0.6, 0.0, 0.0))
    assert at[3] == (0.8, 0.0, 0.2)
    assert at[4] == pytest.approx((0.4, 0.5, 0.1))
    assert at[5] == (0.0, 1.0, 0.0)


def test_axes_may_be_few() -> None:
    """Unlisted axes rest, and the listed ones may be in any order."""
    timeline = joy('joy: {axes: [steering, throttle], points: [[0, -0.5, 1], [2, 0.5, 0]]}')
    assert normalize(timeline.raw_at(0.5), SCRIPTED_LAYOUT)[:3] == (0.75, 0.0, -0.25)


def test_reverse_lasts_for_its_intervals() -> None:
    """Reverse is requested in [2, 2.5)."""
    assert [joy().held.keys_at(t).reverse for t in (1.99, 2.0, 2.49, 2.5)] == [
        False, True, True, False]


@pytest.mark.parametrize('text', [
    KEYS, JOY, 'keys: []', 'joy: {points: [[0.000001, 1.0e-7, 0.1, 0.2]]}',
    'keys: [{from: 0.123456789, to: 1.0e-6, hold: left}]'.replace('1.0e-6', '12345.678901234')])
def test_text_round_trip(text: str) -> None:
    """The text in the resolved game, also as JSON, gives an equal timeline."""
    timeline = parse_timeline(text, 'here')
    carried = json.loads(json.dumps(timeline_text(timeline)))
    assert parse_timeline(carried, 'there') == timeline
    assert timeline_text(parse_timeline(carried, 'there')) == carried


def test_json_is_read() -> None:
    """JSON is YAML."""
    text = json.dumps({'keys': [{'from': 0.0, 'to': 1.5, 'hold': ['brake']}]})
    timeline = parse_timeline(text, 'here')
    assert isinstance(timeline, KeyTimeline) and timeline.keys_at(1.0) == KeyState(brake=True)


@pytest.mark.parametrize(('text', 'message'), [
    ('keys: [{from: 0, to: 1, hold: [thrust]}]',
     r"drive.yaml: keys.0.: \"hold\" is .'thrust'.; give one or a list of throttle"),
    ('keys: [{from: 0, to: 1, hold: [[left]]}]', '"hold" is ..'),
    ('keys: [{from: 0, to: 1}]', 'keys.0.: "hold" is missing'),
    ('keys: [{from: 0, to: 1, hold: left, tap: x}]',
     'keys.0.: "tap" is unknown; known are from, to, hold'),
    ('keys: [{from: -0.1, to: 1, hold: left}]',
     'keys.0.: "from" is -0.1; give a number from 0 to 1e.06'),
    ('keys: [{from: 0, to: 1, hold: left}, {from: 2, to: 2, hold: left}]',
     'keys.1.: ends at 2 s, not after its start at 2 s'),
    ('keys: [{from: 3, to: 2, hold: left}]', 'not after its start'),
    ('keys: [{from: .nan, to: 2, hold: left}]', '"from" is nan'),
    ('keys: [{from: 0, to: .inf, hold: left}]', '"to" is inf'),
    ('keys: [{from: 0, to: true, hold: left}]', '"to" is True'),
    ('keys: [{from: 0, to: 1e1, hold: left}]', "\"to\" is '1e1'.* 1.0e-3, not 1e-3"),
    ('keys: {from: 0}', '"keys" is {.*give a list of {from:, to:, hold:}'),
    ('keys: [5]', 'keys.0.: is no mapping'),
    ('doors: []', '"doors" is unknown; known are keys, joy'),
    ('{keys: [], joy: {points: [[0, 0, 0, 0]]}}',
     r'has 2 timelines \(keys, joy\); give exactly one of keys, joy'),
    ('', 'is no mapping'),
    ('[1, 2]', 'is no mapping'),
    ('keys: [', 'is no YAML'),
    ('\x00', 'is no YAML'),
    ('keys: !!python/object/apply:os.getcwd []', 'is no YAML'),
    ('x: 2025-99-99', '"x" is unknown; known are keys, joy'),
    ('keys: "\\ud800"', 'is no YAML'),
    ('a: &a [x, *a]', 'the alias .a stands inside'),
    ('[' * 100000, 'nested deeper than 20 levels'),
    ('#' * (MAX_BYTES + 1), 'is longer than'),
    ('joy: 3', 'joy: is no mapping'),
    ('joy: {points: []}', 'points: has 0 entries; give 1 or more'),
    ('joy: {points: [[0, 0, 0]]}', r'points.0.: is .*give .t, throttle, brake, steering'),
    ('joy: {axes: [clutch], points: [[0, 0]]}',
     "\"axes\" holds 'clutch'; give a list of throttle, brake, steering"),
    ('joy: {axes: [brake, brake], points: [[0, 0, 0]]}',
     '"brake" is doubled; name each axis once'),
    ('joy: {points: [[0, 1.5, 0, 0]]}', 'points.0.: "throttle" is 1.5; give a number from 0 to 1'),
    ('joy: {points: [[0, 0, -0.5, 0]]}', 'points.0.: "brake" is -0.5'),
    ('joy: {points: [[0, 0, 0, -1.5]]}', 'points.0.: "steering" is -1.5'),
    ('joy: {points: [[0, 0, 0, .nan]]}', 'points.0.: holds nan'),
    ('joy: {points: [[-1, 0, 0, 0]]}', 'points.0.: "t" is -1'),
    ('joy: {points: [[1, 0, 0, 0], [1, 1, 0, 0]]}', 'points.1.: is at 1 s, not after 1 s'),
    ('joy: {points: [[0, 0, 0, 0]], reverse: [{from: 1}]}', 'reverse.0.: "to" is missing'),
])
def test_wrong_timelines_name_file_and_line(text: str, message: str) -> None:
    """Each gives one message with the file and the entry."""
    with pytest.raises(InputError, match=message) as caught:
        parse_timeline(text, 'drive.yaml')
    assert str(caught.value).startswith('drive.yaml')
    assert len(str(caught.value)) < 500


def test_a_yaml_bomb_is_refused_before_it_expands() -> None:
    """Merge keys that double at each of 60 levels would expand to 2^60 entries."""
    lines = ['a0: &a0 {k: 1}']
    lines += [f'a{i}: &a{i} {{<<: [*a{i - 1}, *a{i - 1}]}}' for i in range(1, 61)]
    with pytest.raises(InputError, match='alias'):
        parse_timeline('\n'.join(lines), 'bomb.yaml')


@pytest.mark.parametrize(('content', 'message'), [
    (None, 'No such file'), (b'\xff\xfe\x00\x01', 'no text in UTF-8'),
    (b' ' * (3 * MAX_BYTES), 'is larger than')])
def test_wrong_files_are_refused(tmp_path: Path, content: bytes | None, message: str) -> None:
    """Missing, binary and huge files are refused; reading stops at the limit."""
    path = tmp_path / 'drive.yaml'
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_timeline(path)


def test_a_directory_is_no_timeline(tmp_path: Path) -> None:
    """The message names it."""
    with pytest.raises(InputError, match='is a directory'):
        read_timeline(tmp_path)


def test_a_file_is_read(tmp_path: Path) -> None:
    """A file gives the same timeline as its text."""
    path = tmp_path / 'drive.yaml'
    path.write_text(KEYS, encoding='utf-8')
    assert read_timeline(path) == keys()


def test_the_documented_examples_are_read() -> None:
    """docs/driving.md shows one timeline of keys and one of axes; both are valid."""
    text = (Path(__file__).parents[2] / 'docs' / 'driving.md').read_text(encoding='utf-8')
    blocks = [block.split('```')[0] for block in text.split('```yaml')[1:]]
    read = [parse_timeline(b, 'driving.md') for b in blocks if b.startswith(('\nkeys:', '\njoy:'))]
    keys, joy = read
    assert isinstance(keys, KeyTimeline) and isinstance(joy, JoyTimeline)
    assert [max(held.end_ns for held in timeline.intervals)
            for timeline in (keys, joy.held)] == [8_000_000_000] * 2
