# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of another type on a run's topics, and bad log times, cost only themselves."""

from collections.abc import Callable
from pathlib import Path
import struct
from typing import Any

from crgame_ros.cockpit.replay_index import index_run
from crgame_ros.game.game import AvSpec
from crgame_ros.recording.conversion import convert
from crgame_ros.recording.epochs import read_epoch
from crgame_ros.recording.info import describe
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.recorded_game import read_run_events
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.recording.timing_report import timing_report
from crgame_ros.simulation.offline import OfflineResult
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

POINT, STRING = 'geometry_msgs/msg/Point', 'std_msgs/msg/String'


@pytest.fixture(scope='module')
def result(drive: Callable[..., OfflineResult]) -> OfflineResult:
    """Drive a second."""
    return drive('ZAM_CutIn-1_1_T-1.xml', avs=(AvSpec('av0', 'constant-velocity'),))


def record(folder: Path, samples: Any, messages: Any, storage: StoragePlugin) -> Path:
    """Record messages; one topic may have several types, as in ROS."""
    connections: dict[tuple[str, str], Any] = {}
    with RosbagsWriter(folder, version=9, storage_plugin=storage) as writer:
        for topic, type_name, log_ns, data in messages:
            key = (topic, type_name)
            if key not in connections:
                connections[key] = writer.add_connection(topic, type_name,
                                                         typestore=samples.store)
            writer.write(connections[key], log_ns, data)
    return folder


@pytest.mark.parametrize('storage', [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_another_type_on_every_topic_of_a_run(
        storage: StoragePlugin, result: OfflineResult, recorder: Any, samples: Any,
        tmp_path: Path) -> None:
    """Before, among and after the run's own they change no output of the run."""
    own = recorder.messages(result)
    topics = sorted({topic for topic, *_ in own} | {
        '/av0/plan', '/av0/plan_request', '/scenario/events', '/diagnostics', '/seats',
        '/av0/drivability', '/scenario/signals'})
    strangers = [(topic, POINT, log_ns, samples.encode(POINT, 1.0, 2.0, 3.0))
                 for topic in topics for log_ns in (own[0][2] - 1, own[50][2], own[-1][2] + 1)]
    mixed = sorted([*own, *strangers], key=lambda message: message[2])
    sound = recorder.rosbag2(tmp_path / 'sound', own, storage)
    foreign = record(tmp_path / 'foreign', samples, mixed, storage)
    before, after = read_trajectories(sound), read_trajectories(foreign)
    assert np.array_equal(before.vehicle_states, after.vehicle_states)
    assert np.array_equal(before.object_poses, after.object_poses, equal_nan=True)
    assert '3 messages of /vehicles/state are not of this run: left out' in after.notices
    assert describe(foreign).cycles == describe(sound).cycles
    assert describe(foreign).game == describe(sound).game
    assert read_run_events(foreign) == read_run_events(sound)
    reports = [timing_report(bag) for bag in (sound, foreign)]
    for report in reports:
        report.pop('notices')
    assert reports[0] == reports[1]
    steps = []
    for bag in (sound, foreign):
        with BagReader(bag) as reader:
            index = index_run(reader, read_epoch(reader))
            steps.append((index.first_n, index.last_n))
    assert steps[0] == steps[1] == (0, 100)


@pytest.mark.parametrize('log_ns', [2 ** 63 - 1, 2 ** 63, 2 ** 64 - 1])
def test_log_times_that_no_clock_gives(log_ns: int, result: OfflineResult, recorder: Any,
                                       samples: Any, tmp_path: Path) -> None:
    """MCAP holds unsigned times, ROS and indices signed ones: the latest possible counts."""
    own = recorder.messages(result)
    bag = recorder.ours(tmp_path / 'bag', [
        *own, (own[-1][0], own[-1][1], 2 ** 63 - 1, own[-1][3]),
        ('/diagnostics', STRING, 2 ** 63 - 1, samples.string('x'))])
    file = next(bag.glob('*.mcap'))
    # In the chunk, its head and the summary alike; without checksums this is not noticed.
    _unpack(file, struct.pack('<Q', 2 ** 63 - 1), struct.pack('<Q', log_ns))
    with BagReader(bag) as reader:
        assert reader.end_ns == 2 ** 63 - 1
        index = index_run(reader, read_epoch(reader))
        assert (index.first_n, index.last_n) == (0, 100)
    assert describe(bag).cycles is not None
    assert np.array_equal(read_trajectories(bag).ks, np.arange(11))
    assert convert(bag, tmp_path / 'run.xml')[1].time_steps == 11


def _unpack(file: Path, old: bytes, new: bytes) -> None:
    """Write a file anew without compression and checksums, with some bytes replaced."""
    from mcap.reader import make_reader
    from mcap.writer import CompressionType, Writer
    with file.open('rb') as stream:
        found = list(make_reader(stream).iter_messages(log_time_order=False))
    with file.open('wb') as stream:
        writer = Writer(stream, compression=CompressionType.NONE, enable_crcs=False,
                        enable_data_crcs=False)
        writer.start('ros2', 'test')
        channels: dict[int, int] = {}
        for schema, channel, message in found:
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, writer.register_schema(
                        schema.name, schema.encoding, schema.data), channel.metadata)
            writer.add_message(channels[channel.id], message.log_time, message.data,
                               message.publish_time, message.sequence)
        writer.finish()
    file.write_bytes(file.read_bytes().replace(old, new))
