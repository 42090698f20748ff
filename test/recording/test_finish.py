# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Results of runs that ended before they began, and of recorders that were started again."""

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any

from commonroad.common.reader.file_reader_xml import XMLFileReader
from crgame_ros.cli import main
from crgame_ros.recording.finish import EMPTY, finish_run, OK
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_folder import bags_of, parts_of
from crgame_ros.recording.run_trajectories import read_trajectories, trajectories_of
from crgame_ros.simulation.offline import OfflineResult
import numpy as np
import pytest

Drive = Callable[..., OfflineResult]
Message = tuple[str, str, int, bytes]
TRAFFIC = 'ZAM_Traffic-1_1_T-1.xml'
START_NS = 1_700_000_000_000_000_000


@pytest.fixture(scope='module')
def result(drive: Drive) -> OfflineResult:
    """Drive for 6 s."""
    return drive(TRAFFIC, duration_s=6.0)


def _between(messages: list[Message], from_s: float, until_s: float) -> list[Message]:
    """Return the documents, which every recorder gets, and the messages logged in between."""
    first_ns = START_NS + round(from_s * 1e9)
    return [(*m[:2], first_ns, m[3]) if m[0].startswith('/scenario/') else m for m in messages
            if m[0].startswith('/scenario/') or first_ns <= m[2] < START_NS + round(until_s * 1e9)]


def _killed(folder: Path) -> None:
    """Write the file of a killed recorder: it has no end."""
    (folder / 'metadata.yaml').unlink()
    file = next(folder.glob('*.mcap'))
    file.write_bytes(file.read_bytes()[:-200])


@pytest.mark.parametrize('until_s', [0.0005, 0.0115, 0.095])
def test_a_run_that_ended_before_it_began_is_no_error(tmp_path: Path, recorder: Any,
                                                      result: OfflineResult,
                                                      until_s: float) -> None:
    """A reset at once, after one cycle, or just before the second scenario step: one line."""
    messages = _between(recorder.messages(result), 0.0, until_s)
    recorder.ours(tmp_path / 'bag', messages)
    said: list[str] = []
    assert finish_run(tmp_path, said.append) == EMPTY
    assert not any('error' in line or 'record this topic' in line for line in said)
    assert sum('ended before' in line for line in said) == 1
    assert not list(tmp_path.glob('*.xml')) and not list(tmp_path.glob('timing*.json'))


@pytest.mark.exhaustive
def test_two_quick_resets_in_one_recording(tmp_path: Path, recorder: Any, drive: Drive,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    """By `ros2 bag record -a`: the last run that began becomes the scenario; a note has others."""
    first = drive(TRAFFIC, duration_s=1.0)
    messages = recorder.messages(first)
    for epoch in (1, 2):
        later = recorder.messages(first, epoch=epoch, offset_ns=epoch * 2_000_000_000,
                                  log_ns=START_NS + epoch * 2_000_000_000)
        messages += [m for m in later
                     if m[2] <= START_NS + epoch * 2_000_000_000 + (20_000_000, 0)[epoch - 1]]
    folder = recorder.ours(tmp_path / 'bag', messages)
    assert main(['convert', str(folder)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith('note: run 3 ended before it began')
    assert said[1].startswith('note: run 2 ended before it began')
    scenario, _ = XMLFileReader((tmp_path / 'ZAM_Traffic-1_1_T-1.xml').read_bytes()).open()
    assert max(obstacle.prediction.final_time_step
               for obstacle in scenario.dynamic_obstacles) == 10
    (tmp_path / 'ZAM_Traffic-1_1_T-1.xml').unlink()
    assert finish_run(tmp_path, said.append) == OK
    assert json.loads((tmp_path / 'timing.json').read_text())['epoch'] == 0


def test_a_recorder_that_was_started_again(tmp_path: Path, recorder: Any,
                                           result: OfflineResult) -> None:
    """Killed 0.7 s before the end of the run: both parts together are the whole run."""
    messages = recorder.messages(result)
    recorder.ours(tmp_path / 'bag', _between(messages, 0.0, 5.3))
    recorder.ours(tmp_path / 'bag_part2', _between(messages, 5.65, 9.0))
    _killed(tmp_path / 'bag')
    # Once more, and killed at once.
    (tmp_path / 'bag_part3').mkdir()
    (tmp_path / 'bag_part3' / 'bag_part3_0.mcap').touch()
    said: list[str] = []
    assert finish_run(tmp_path, said.append) == OK
    assert [path.name for path in tmp_path.glob('*.xml')] == ['ZAM_Traffic-1_1_T-1.xml']
    assert [path.name for path in tmp_path.glob('timing*.json')] == ['timing.json']
    report = json.loads((tmp_path / 'timing.json').read_text())
    assert report['scenario_steps'] == {'first': 0, 'last': 60}
    assert 30 < report['gaps'] < 140
    assert any('interpolated between states' in notice for notice in report['notices'])
    log, whole = read_trajectories(tmp_path / 'bag'), trajectories_of(result)
    np.testing.assert_array_equal(log.ks, whole.ks)
    # A change of acceleration of 8 m/s^2 over less than 1.4 s without a state: a T^2 / 32.
    assert np.abs(log.vehicle_states[:, :, :2] - whole.vehicle_states[:, :, :2]).max() < 0.5
    with BagReader(tmp_path / 'bag_part2') as part:
        assert part.complete and part.start_ns == START_NS + 5_650_000_000


def test_a_recorder_that_lost_more_than_is_bridged(tmp_path: Path, recorder: Any,
                                                   result: OfflineResult) -> None:
    """The longer part becomes the scenario, and the notice names the gap."""
    messages = recorder.messages(result)
    recorder.ours(tmp_path / 'bag', _between(messages, 0.0, 1.0))
    recorder.ours(tmp_path / 'bag_part2', _between(messages, 3.0, 9.0))
    assert finish_run(tmp_path, lambda _: None) == OK
    report = json.loads((tmp_path / 'timing.json').read_text())
    assert report['scenario_steps'] == {'first': 30, 'last': 60}
    assert any('/vehicles/state for 2.0 s after scenario step 9' in notice
               for notice in report['notices'])


def test_parts_belong_to_the_first_of_them(tmp_path: Path) -> None:
    """In the order of their numbers; another run of a simulation started again is none of them."""
    names = ['bag', 'bag_2', 'bag_part2', 'bag_part10', 'bag_part2_2']
    for name in names:
        (tmp_path / name).mkdir()
    assert [path.name for path in bags_of(tmp_path)] == [
        'bag', 'bag_part2', 'bag_part10', 'bag_2', 'bag_part2_2']
    assert [path.name for path in parts_of(tmp_path / 'bag')] == [
        'bag', 'bag_part2', 'bag_part10']
    for name in names[1:]:
        assert parts_of(tmp_path / name) == [tmp_path / name]
