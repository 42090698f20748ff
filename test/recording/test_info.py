# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The description of a recording for users."""

import json
from pathlib import Path
import time
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.recording.info import describe, format_info, Gap
from crgame_ros.recording.metadata import TopicQos
from crgame_ros.recording.writer import BagWriter
import pytest

CYCLES = 'std_msgs/msg/Float64MultiArray'
STRING = 'std_msgs/msg/String'
GAME = {'benchmark_id': 'ZAM_CutIn-1_1_T-1', 'epoch': 2,
        'humans': [{'id': 'hv0', 'driver': 'keys:cut_in.yaml'}],
        'avs': [{'id': 'av0', 'planner': 'idm'}, {'id': 'av1', 'planner': 'reactive'}]}


def record(folder: Path, samples: Any, messages: list[tuple[str, str, bytes]]) -> Path:
    """Record messages 10 ms apart, the first at 2 s."""
    with BagWriter(folder, now_ns=time.monotonic_ns) as writer:
        channels = {topic: writer.add_topic(topic, type_name, TopicQos(1, 'reliable', 'volatile'))
                    for topic, type_name in {m[0]: m[1] for m in messages}.items()}
        for i, (topic, _, data) in enumerate(messages):
            writer.write(channels[topic], data, 2_000_000_000 + i * 10_000_000)
    return folder


def cycles(samples: Any, *batches: list[tuple[int, int]]) -> list[tuple[str, str, bytes]]:
    """Make messages of /timing/cycle from batches of (epoch, n)."""
    return [('/timing/cycle', CYCLES, samples.cycles(batch)) for batch in batches]


def test_everything_is_described(tmp_path: Path, samples: Any) -> None:
    """Counts, times, rates, game and cycles are those that were recorded."""
    folder = record(tmp_path / 'run', samples, [
        ('/scenario/game', STRING, samples.string(json.dumps(GAME))),
        *(('/a', STRING, samples.string('x')) for _ in range(200)),
        *cycles(samples, [(2, 0), (2, 1)], [(2, 2)])])
    info = describe(folder)
    assert (info.storage, info.complete, info.message_count) == ('mcap', True, 203)
    assert (info.start_ns, info.end_ns, info.duration_s) == (2_000_000_000, 4_020_000_000, 2.02)
    assert info.size_bytes == (folder / 'run_0.mcap').stat().st_size
    rates = {topic.name: info.rate_hz(topic) for topic in info.topics}
    assert rates['/a'] == pytest.approx(199 / 2.02)
    assert rates['/scenario/game'] is None
    assert info.game is not None and info.game.benchmark_id == 'ZAM_CutIn-1_1_T-1'
    assert [(item.id, item.driver) for item in info.game.humans] == [('hv0', 'keys:cut_in.yaml')]
    assert [(item.id, item.planner) for item in info.game.avs] == [
        ('av0', 'idm'), ('av1', 'reactive')]
    assert info.cycles is not None and (info.cycles.recorded, info.cycles.missing) == (3, 0)


def test_missing_cycles_are_found(tmp_path: Path, samples: Any) -> None:
    """Gaps inside a batch, between batches, in a later epoch; late and double ones are none."""
    folder = record(tmp_path / 'run', samples, cycles(
        samples, [(0, 5), (0, 6), (0, 9)], [(0, 12), (0, 11), (0, 12)], [(1, 0), (1, 100)],
        [(1, 101)]))
    found = describe(folder).cycles
    assert found is not None
    assert found.gaps == (Gap(0, 7, 8), Gap(0, 10, 10), Gap(1, 1, 99))
    assert found.missing == 2 + 1 + 99
    text = format_info(describe(folder))
    assert '102 missing' in text
    assert 'epoch 1: n = 1 to 99 missing' in text


def test_text_is_a_table(tmp_path: Path, samples: Any) -> None:
    """The columns line up and the rate is (messages - 1) / duration."""
    folder = record(tmp_path / 'run', samples, [
        ('/scenario/game', STRING, samples.string(json.dumps(GAME))),
        *(('/long/name', STRING, samples.string('x')) for _ in range(101))])
    lines = format_info(describe(folder)).splitlines()
    assert 'duration   1.01 s, from 2.000 s to 3.010 s' in lines
    assert 'humans     hv0 (keys:cut_in.yaml)' in lines
    assert 'avs        av0 (idm), av1 (reactive)' in lines
    assert 'complete   yes' in lines
    header, first, second = lines[-3:]
    assert first.split() == ['/long/name', STRING, '101', '99.0', 'reliable', 'volatile', '1']
    assert second.split()[:4] == ['/scenario/game', STRING, '1', '-']
    assert header.index('type') == first.index(STRING) == second.index(STRING)
    assert len({line.index('reliable') for line in (first, second)}) == 1


def test_unfinished_recording_says_so(tmp_path: Path, samples: Any) -> None:
    """A file without its end is described, with the remedy."""
    folder = record(tmp_path / 'run', samples, [('/a', STRING, samples.string('x'))])
    file = folder / 'run_0.mcap'
    file.write_bytes(file.read_bytes()[:-10])
    info = describe(folder)
    assert (info.complete, info.message_count, info.duration_s) == (False, 1, 0.0)
    text = format_info(info)
    assert 'complete   no' in text
    assert '`crgame recover` finishes it' in text


def test_recording_without_game_and_cycles(tmp_path: Path, samples: Any) -> None:
    """Topics of the same names but other types, as in foreign recordings, are no game."""
    folder = record(tmp_path / 'run', samples, [
        ('/scenario/game', 'rosgraph_msgs/msg/Clock', samples.clock(5)),
        ('/timing/cycle', STRING, samples.string('x'))])
    info = describe(folder)
    assert (info.game, info.cycles) == (None, None)
    assert 'cycles' not in format_info(info)


def test_empty_recording(tmp_path: Path, samples: Any) -> None:
    """No message is no error."""
    folder = record(tmp_path / 'run', samples, [])
    assert 'messages   0' in format_info(describe(folder))


@pytest.mark.parametrize('text', ['no JSON', '[]', '{}', '{"benchmark_id": "a", "humans": 5}'])
def test_game_of_another_make_is_refused(tmp_path: Path, samples: Any, text: str) -> None:
    """The message names the topic instead of a traceback."""
    folder = record(tmp_path / 'run', samples, [('/scenario/game', STRING, samples.string(text))])
    with pytest.raises(InputError, match='/scenario/game: is no game of this program'):
        describe(folder)


@pytest.mark.parametrize('label', ['epoch,k,m', 'n,k,epochs'])
def test_cycles_of_another_make_are_refused(tmp_path: Path, samples: Any, label: str) -> None:
    """Columns are found by their names, so they have to be there."""
    folder = record(tmp_path / 'run', samples, [
        ('/timing/cycle', CYCLES, samples.cycles([(0, 1)], label))])
    with pytest.raises(InputError, match='/timing/cycle is not as the contract has it'):
        describe(folder)
