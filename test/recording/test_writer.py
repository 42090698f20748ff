# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings as other programs read them, on full disks, and over a long time."""

from collections.abc import Iterator
from contextlib import contextmanager
import json
import os
from pathlib import Path
import subprocess
import sys
import time
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.paths import share_directory
from crgame_ros.recording.exceptions import RecordingError
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.schemas import type_schema
from crgame_ros.recording.writer import BagWriter, FLUSH_INTERVAL_NS, TopicQos
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_types_from_msg
import yaml

TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
STRING = 'std_msgs/msg/String'
LATCHED = TopicQos(1, 'reliable', 'transient_local')
STREAM = TopicQos(10)


def recorded_types() -> list[str]:
    """List the types of all topics that the contract wants recorded."""
    contract = yaml.safe_load((share_directory() / 'msg_defs' / 'interfaces.yaml').read_text())
    return sorted({topic['type'] for topic in contract['topics'].values() if topic['record']})


def record(folder: Path, samples: Any) -> None:
    """Record a latched text and 50 trajectories, 10 ms apart, from 5 s on."""
    with BagWriter(folder, now_ns=time.monotonic_ns) as writer:
        text = writer.add_topic('/scenario/xml', STRING, LATCHED)
        states = writer.add_topic('/vehicles/state', TRAJECTORY, STREAM)
        writer.add_topic('/silent', STRING, STREAM)
        writer.write(text, samples.string('<xml/>'), 5_000_000_000)
        for i in range(50):
            writer.write(states, samples.trajectory(16, 1, i), 5_000_000_000 + i * 10_000_000)


def test_rosbags_reads_the_folder(tmp_path: Path, samples: Any) -> None:
    """Another library finds our topics, QoS, times and values."""
    record(tmp_path / 'run', samples)
    with Reader(tmp_path / 'run') as reader:
        assert reader.message_count == 51
        assert reader.start_time == 5_000_000_000
        assert reader.ros_distro == 'jazzy'
        offered = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
        assert offered['/scenario/xml'].durability.name == 'TRANSIENT_LOCAL'
        assert (offered['/vehicles/state'].durability.name, offered['/vehicles/state'].depth) == (
            'VOLATILE', 10)
        assert {c.topic: c.msgcount for c in reader.connections} == {
            '/scenario/xml': 1, '/vehicles/state': 50, '/silent': 0}
        last = list(reader.messages())[-1]
        message = samples.store.deserialize_cdr(last[2], last[0].msgtype)
    assert last[1] == 5_490_000_000
    assert list(message.points[0].positions) == [49.0 + i for i in range(16)]


def test_metadata_is_that_of_rosbag2_version_9(tmp_path: Path, samples: Any) -> None:
    """Field by field, as rosbag2 of Jazzy writes it."""
    record(tmp_path / 'run', samples)
    assert sorted(path.name for path in (tmp_path / 'run').iterdir()) == [
        'metadata.yaml', 'run_0.mcap']
    content = yaml.safe_load((tmp_path / 'run' / 'metadata.yaml').read_text())
    info = content['rosbag2_bagfile_information']
    assert (info['version'], info['storage_identifier'], info['custom_data']) == (9, 'mcap', {})
    assert info['starting_time']['nanoseconds_since_epoch'] == 5_000_000_000
    assert info['duration']['nanoseconds'] == 490_000_000
    assert info['files'] == [{
        'path': 'run_0.mcap', 'message_count': 51,
        'starting_time': {'nanoseconds_since_epoch': 5_000_000_000},
        'duration': {'nanoseconds': 490_000_000}}]
    topic = info['topics_with_message_count'][0]['topic_metadata']
    assert topic['type_description_hash'] == type_schema(STRING)[1]
    infinite = {'sec': 9223372036, 'nsec': 854775807}
    assert topic['offered_qos_profiles'] == [{
        'history': 'keep_last', 'depth': 1, 'reliability': 'reliable',
        'durability': 'transient_local', 'deadline': infinite, 'lifespan': infinite,
        'liveliness': 'automatic', 'liveliness_lease_duration': infinite,
        'avoid_ros_namespace_conventions': False}]


def test_mcap_and_its_ros2_decoder_read_the_file(tmp_path: Path, samples: Any) -> None:
    """The schema text is enough to decode by."""
    record(tmp_path / 'run', samples)
    with (tmp_path / 'run' / 'run_0.mcap').open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary is not None
        assert reader.get_header().profile == 'ros2'
        assert all(index.message_index_length > 0 for index in summary.chunk_indexes)
        assert {index.compression for index in summary.chunk_indexes} == {'zstd'}
        found = [(schema.name, channel.message_encoding, message.publish_time, decoded)
                 for schema, channel, message, decoded in reader.iter_decoded_messages()
                 if schema is not None]
    assert len(found) == 51
    name, encoding, publish_time_ns, decoded = found[-1]
    assert (name, encoding, publish_time_ns) == (TRAJECTORY, 'cdr', 5_490_000_000)
    assert decoded.header.frame_id == 'map'
    assert decoded.joint_names[15] == 'av15/x'
    assert list(decoded.points[0].positions) == [49.0 + i for i in range(16)]


@pytest.mark.parametrize('type_name', recorded_types())
def test_schema_and_hash_agree_with_the_installed_packages(type_name: str, samples: Any) -> None:
    """The text holds the type's own definitions, the hash is that in ROS's own files."""
    text, digest = type_schema(type_name)
    found = get_types_from_msg(text, type_name)
    assert type_name in found
    for name, (constants, fields) in found.items():
        assert fields == samples.store.fielddefs[name][1]
        assert len(constants) == len(samples.store.fielddefs[name][0])
    package, name = type_name.split('/msg/')
    places = [Path(prefix) / 'share' / package / 'msg' / f'{name}.json' for prefix in (
        *filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)), sys.prefix)]
    path = next(place for place in places if place.is_file())
    hashes = {entry['type_name']: entry['hash_string']
              for entry in json.loads(path.read_text('utf-8'))['type_hashes']}
    assert digest == hashes[type_name]


@pytest.mark.parametrize('type_name', [
    'no_such_msgs/msg/Thing', 'std_msgs/msg/NoSuchType', 'std_msgs/String', '../msg/Secret'])
def test_unknown_type_is_refused(tmp_path: Path, type_name: str) -> None:
    """The message names the type."""
    with BagWriter(tmp_path / 'run', now_ns=time.monotonic_ns) as writer:
        with pytest.raises(InputError, match=type_name):
            writer.add_topic('/x', type_name, STREAM)


def test_chosen_publish_time_is_kept(tmp_path: Path, samples: Any) -> None:
    """Log time, publish time and sequence are separate."""
    with BagWriter(tmp_path / 'run', now_ns=time.monotonic_ns) as writer:
        channel = writer.add_topic('/clock', 'rosgraph_msgs/msg/Clock', STREAM)
        for i in range(3):
            writer.write(channel, samples.clock(i), 100 + i, 90 + i)
        # As of a sender whose clock stands before 1970.
        writer.write(channel, samples.clock(3), 103, -5)
    with writer.path.open('rb') as stream:
        found = [(m.sequence, m.log_time, m.publish_time)
                 for _, _, m in make_reader(stream).iter_messages()]
    assert found == [(0, 100, 90), (1, 101, 91), (2, 102, 92), (3, 103, 0)]


def test_everything_older_than_a_second_is_on_disk(tmp_path: Path, samples: Any) -> None:
    """Seen from outside while the writer is open."""
    now = [0]
    writer = BagWriter(tmp_path / 'run', now_ns=lambda: now[0])
    channel = writer.add_topic('/clock', 'rosgraph_msgs/msg/Clock', STREAM)
    for i in range(250):
        now[0] = i * 10_000_000
        writer.write(channel, samples.clock(i), now[0])
        if i % 10 == 0:
            stored = list(BagReader(writer.path).messages())
            assert len(stored) >= i + 1 - 100
    now[0] += FLUSH_INTERVAL_NS
    writer.flush_if_due()
    assert len(list(BagReader(writer.path).messages())) == 250
    assert not BagReader(tmp_path / 'run').complete
    writer.close()
    assert BagReader(tmp_path / 'run').complete


def test_recording_twice_into_a_folder_is_refused(tmp_path: Path, samples: Any) -> None:
    """The first recording stays as it is."""
    record(tmp_path / 'run', samples)
    before = (tmp_path / 'run' / 'run_0.mcap').read_bytes()
    with pytest.raises(InputError, match='another folder'):
        BagWriter(tmp_path / 'run', now_ns=time.monotonic_ns)
    assert (tmp_path / 'run' / 'run_0.mcap').read_bytes() == before


def test_closed_writer_and_negative_times_are_refused(tmp_path: Path, samples: Any) -> None:
    """Neither leaves a trace in the file."""
    writer = BagWriter(tmp_path / 'run', now_ns=time.monotonic_ns)
    channel = writer.add_topic('/clock', 'rosgraph_msgs/msg/Clock', STREAM)
    with pytest.raises(ValueError, match='negative'):
        writer.write(channel, samples.clock(1), -1)
    writer.close()
    writer.close()
    with pytest.raises(ValueError, match='closed'):
        writer.write(channel, samples.clock(1), 1)
    assert BagReader(tmp_path / 'run').message_count == 0


def test_file_instead_of_a_folder(tmp_path: Path) -> None:
    """A refusal of the system is reported at once."""
    (tmp_path / 'file').write_text('')
    with pytest.raises(RecordingError, match='cannot record'):
        BagWriter(tmp_path / 'file' / 'run', now_ns=time.monotonic_ns)


FILL = """
import os, resource, sys
from pathlib import Path
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.writer import BagWriter, RecordingError, TopicQos
folder, limit = Path(sys.argv[1]), int(sys.argv[2])
if limit:
    import signal
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
now = [0]
writer = BagWriter(folder, now_ns=lambda: now[0])
channel = writer.add_topic('/x', 'std_msgs/msg/String', TopicQos(1))
taken = errors = 0
for second in range(200):
    now[0] += 10**9
    try:
        writer.write(channel, os.urandom(30_000), now[0])
        taken += writer.failed is None
    except RecordingError as error:
        errors += 1
        print(error)
writer.flush()
writer.close()
reader = BagReader(folder)
print(taken, errors, writer.refused, len(list(reader.messages())), reader.complete)
"""


@contextmanager
def small_disk(folder: Path) -> Iterator[int]:
    """Mount one megabyte of memory as a disk; yield 0, or a limit of the file size instead."""
    folder.mkdir()
    command = ['mount', '-t', 'tmpfs', '-o', 'size=1m', 'tmpfs', str(folder)]
    mounted = os.geteuid() == 0 and subprocess.run(command, capture_output=True).returncode == 0
    try:
        yield 0 if mounted else 1 << 20
    finally:
        if mounted:
            subprocess.run(['umount', str(folder)], check=True)


def fill(folder: Path, limit: int) -> list[str]:
    """Record into a disk that is too small, in a process of its own; return what it printed."""
    result = subprocess.run([sys.executable, '-c', FILL, str(folder), str(limit)],
                            capture_output=True, text=True, cwd=share_directory())
    assert result.returncode == 0, result.stderr
    return result.stdout.splitlines()


@pytest.mark.parametrize('by_limit', [False, True])
def test_full_disk_ends_the_recording_with_one_error(tmp_path: Path, by_limit: bool) -> None:
    """One error that names file and reason; later messages are counted; the file reads."""
    with small_disk(tmp_path / 'disk') as limit:
        error, numbers = fill(tmp_path / 'disk' / 'run', 1 << 19 if by_limit else limit)
    reason = 'File too large' if by_limit or limit else 'No space left on device'
    assert str(tmp_path / 'disk' / 'run' / 'run_0.mcap') in error
    assert reason in error
    taken, errors, refused, stored, complete = numbers.split()
    assert int(errors) == 1
    assert int(taken) + 1 + int(refused) == 200
    # Random bytes do not compress: a megabyte holds 34 of these messages, half of it 17.
    assert int(stored) == int(taken) >= (15 if by_limit else 30)
    assert complete == 'False'


MEMORY = """
import resource, sys
from pathlib import Path
from crgame_ros.recording.writer import BagWriter, TopicQos

def resident_bytes():
    return int(Path('/proc/self/statm').read_text().split()[1]) * resource.getpagesize()

now, count, after_first = [0], 0, 0
with BagWriter(Path(sys.argv[1]), now_ns=lambda: now[0]) as writer:
    channels = [writer.add_topic(f'/t{i}', 'std_msgs/msg/String', TopicQos(1)) for i in range(40)]
    for minute in range(10):
        for i in range(30_000):
            now[0] += 2_000_000
            writer.write(channels[i % 40], bytes(400), now[0])
        after_first = after_first or resident_bytes()
    print(resident_bytes() - after_first)
"""


@pytest.mark.exhaustive
@pytest.mark.skipif(not Path('/proc/self/statm').exists(), reason='needs /proc')
def test_memory_stays_flat_over_ten_minutes(tmp_path: Path) -> None:
    """Ten simulated minutes of 40 topics and 500 messages a second grow by less than 5 MB."""
    result = subprocess.run([sys.executable, '-c', MEMORY, str(tmp_path / 'run')],
                            capture_output=True, text=True, cwd=share_directory())
    assert result.returncode == 0, result.stderr
    assert int(result.stdout) < 5_000_000
    assert BagReader(tmp_path / 'run').message_count == 300_000
