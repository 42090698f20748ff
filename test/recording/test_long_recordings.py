# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Long recordings: little work for each message, and reports of progress."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from crgame_ros.game.game import AvSpec
from crgame_ros.recording.progress import PERIOD_S, Progress
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.recording.run_trajectories import read_trajectories, trajectories_of
from crgame_ros.recording.timing_report import timing_report
from crgame_ros.simulation.offline import OfflineResult
import numpy as np
import pytest

TRAFFIC = 'ZAM_Traffic-1_1_T-1.xml'


@pytest.fixture(scope='module')
def result(drive: Callable[..., OfflineResult]) -> OfflineResult:
    """Drive for 6 s, which are 600 states and cycles."""
    return drive(TRAFFIC, duration_s=6.0, avs=(AvSpec('av0', 'constant-velocity'),))


def test_what_differs_in_its_numbers_alone_is_decoded_once(
        tmp_path: Path, recorder: Any, result: OfflineResult,
        monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 1,262 messages a dozen are decoded, and the results are the same to the last bit."""
    messages = recorder.messages(result)
    folder = recorder.ours(tmp_path / 'bag', messages)
    decoded: list[str] = []
    decode = BagReader.decode

    def counted(reader: BagReader, message: Any) -> Any:
        decoded.append(message.topic)
        return decode(reader, message)

    monkeypatch.setattr(BagReader, 'decode', counted)
    log = read_trajectories(folder)
    timing_report(folder, log=log)
    assert len(messages) == 3 + 61 + 601 + 600
    assert len(decoded) < 15
    whole = trajectories_of(result)
    np.testing.assert_array_equal(log.vehicle_states[:, :, :3], whole.vehicle_states[:, :, :3])
    np.testing.assert_array_equal(log.object_poses, whole.object_poses)
    np.testing.assert_array_equal(read_cycles(folder).rows, recorder.rows)


def test_messages_of_another_layout_among_the_others(tmp_path: Path, recorder: Any, samples: Any,
                                                     result: OfflineResult) -> None:
    """Big-endian, of other joints, cut short: each is read, or left out and counted."""
    messages = recorder.messages(result)
    states = [index for index, message in enumerate(messages) if message[0] == '/vehicles/state']
    for index in states[50:60]:
        topic, type_name, log_ns, data = messages[index]
        message = samples.store.deserialize_cdr(data, type_name)
        messages[index] = (topic, type_name, log_ns, bytes(
            samples.store.serialize_cdr(message, type_name, little_endian=False)))
    for index in states[75:78]:
        messages[index] = (*messages[index][:3], messages[index][3][:-40])
    log = read_trajectories(recorder.ours(tmp_path / 'bag', messages))
    np.testing.assert_array_equal(log.vehicle_states[:, :, :3],
                                  trajectories_of(result).vehicle_states[:, :, :3])
    assert log.notices == ('3 messages of /vehicles/state are not of this run: left out',)


def test_progress_is_told_where_it_takes_long(tmp_path: Path, recorder: Any,
                                              result: OfflineResult) -> None:
    """It goes from nothing to all, for states and for cycles, first after two seconds."""
    folder = recorder.ours(tmp_path / 'bag', recorder.messages(result))
    shares: list[float] = []
    read_trajectories(folder, progress=shares.append)
    assert len(shares) >= 3 and 0.0 <= min(shares) < 0.01 and max(shares) <= 1.0
    now_s, said = [0.0], list[str]()
    progress = Progress(said.append, 'reading bag', lambda: now_s[0])
    for second in np.arange(0.0, 5.0, 0.1).tolist():
        now_s[0] = second
        progress(second / 5.0)
    assert said == ['reading bag: 40 %', 'reading bag: 80 %'] and PERIOD_S == 2.0
