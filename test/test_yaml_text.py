# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reader of all YAML files: large, deep or non-plain data is refused in one line."""

from collections.abc import Callable
import os
from pathlib import Path
import time
from typing import Any

from crgame_ros.driver.device_map import load_device_map
from crgame_ros.driver.timeline import read_timeline
from crgame_ros.errors import InputError, LONGEST
from crgame_ros.game.game import load_game
from crgame_ros.occupancy.map_file import read_map_file
from crgame_ros.recording.metadata import read_metadata
from crgame_ros.vehicle.control_settings import load_control_settings
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.steering import load_steering_ratio
from crgame_ros.yaml_text import parse_yaml
import pytest

READERS: dict[str, Callable[[Path], Any]] = {
    'game': load_game, 'vehicle': lambda path: load_vehicle_parameters(str(path)),
    'steering': lambda path: load_steering_ratio(str(path)), 'timeline': read_timeline,
    'device': lambda path: load_device_map(str(path)), 'gains': load_control_settings,
    'map': read_map_file, 'metadata': lambda path: read_metadata(path.parent)}
LEVELS = ['a0: &a0 {k: 1}', *(f'a{i}: &a{i} {{<<: [*a{i - 1}, *a{i - 1}]}}' for i in range(1, 61))]
HOSTILE = {
    'deep': '[' * 100_000, 'deep mapping': '{a: ' * 5000, 'tag': 'a: !!python/object:os.system {}',
    'binary': 'a: !!binary aGk=', 'set': 'a: !!set {a, b}', 'date': 'a: !!timestamp 2026-99-99',
    'half a character': 'a: "\\ud800"', 'NUL': 'a: "\\0"', 'control': 'a: "\\x1b[31m"',
    'bomb': '\n'.join(LEVELS), 'in itself': 'a: &a [*a]', 'no anchor': 'a: *b',
    'digits': 'a: ' + '9' * 100_000, 'hexadecimal': 'a: 0x' + 'f' * 100_000,
    'base 60': 'a: 1' + ':01' * 100_000, 'list as key': '? [a]\n: b', 'no float': 'a: !!float []',
    'no number': 'a: !!int abc', 'two documents': 'a: 1\n---\nb: 2', 'no UTF-8': b'a: \xff\xfe',
    'large': '#' * (40 << 20)}


@pytest.mark.slow
@pytest.mark.parametrize('kind', READERS)
def test_hostile_yaml_is_refused_in_one_line_by_all_readers(
        kind: str, tmp_path: Path) -> None:
    """Each refuses within 2 s, in fewer than 500 characters with the file's name, no traceback."""
    for number, (name, text) in enumerate(HOSTILE.items()):
        # Vehicles and devices are remembered by their names.
        path = tmp_path / str(number) / 'metadata.yaml'
        path.parent.mkdir()
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        start_s = time.process_time()
        with pytest.raises(InputError) as caught:
            READERS[kind](path)
        assert time.process_time() - start_s < 2.0, name
        told = str(caught.value)
        assert 'metadata.yaml' in told and len(told) < 500 and '\n' not in told, (name, told)


@pytest.mark.parametrize('kind', READERS)
def test_what_is_no_regular_file_is_not_opened(kind: str, tmp_path: Path) -> None:
    """Reading a pipe without a writer would wait for ever."""
    path = tmp_path / 'metadata.yaml'
    os.mkfifo(path)
    with pytest.raises(InputError, match='is no regular file'):
        READERS[kind](path)


def test_plain_values_are_what_yaml_means() -> None:
    """Dates are text: no key here is a date, and 2026-13-45 is a good title."""
    text = 'a: 2026-13-45\nb: [1, 2.5, true, null, .inf]\nc: &c {d: é}\ne: *c\nf: 1_000\ng: 0x10'
    assert parse_yaml(text, 'x') == {
        'a': '2026-13-45', 'b': [1, 2.5, True, None, float('inf')], 'c': {'d': 'é'},
        'e': {'d': 'é'}, 'f': 1000, 'g': 16}


def test_a_message_is_short_and_can_be_shown_anywhere() -> None:
    """Long parts are cut, the end of a path stays, half and hidden characters are spelled out."""
    told = str(InputError('w' * 5000, '/long' * 900 + '/name.yaml', 'r' * 5000))
    assert len(told) < 500 and '/name.yaml: www' in told and 'rrr' in told
    assert len(told) >= LONGEST
    assert str(InputError('is \ud800\x1b[2J\n\tx', 'f')) == r'f: is \ud800\x1b[2J x'
