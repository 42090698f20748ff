# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Killed recorders and cut files: all stored data comes back, and nothing is ever lost."""

from pathlib import Path
import random
import re
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.paths import share_directory
from crgame_ros.recording.metadata import TopicQos
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.recover import recover
from crgame_ros.recording.writer import BagWriter
from mcap.reader import make_reader
from mcap.writer import Writer
import pytest
from rosbags.rosbag2 import Reader, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

STRING = 'std_msgs/msg/String'
LATCHED = TopicQos(1, 'reliable', 'transient_local')


def record(folder: Path, samples: Any, count: int = 600) -> list[tuple[str, str, int, bytes]]:
    """Record texts that do not compress, 20 ms apart in chunks of 0.4 s."""
    generator = random.Random(3)
    expected = [('/a', STRING, 5_000_000_000 + i * 20_000_000,
                 samples.string(f'{i} {generator.randbytes(100).hex()}')) for i in range(count)]
    now = [0]
    with BagWriter(folder, now_ns=lambda: now[0]) as writer:
        channel = writer.add_topic('/a', STRING, LATCHED)
        for _, _, log_time_ns, data in expected:
            now[0] = log_time_ns
            writer.write(channel, data, log_time_ns)
    return expected


def contents(folder: Path) -> dict[str, tuple[bytes, int]]:
    """Return the bytes and the time of change of each file, hidden ones included."""
    return {path.name: (path.read_bytes(), path.stat().st_mtime_ns)
            for path in sorted(folder.iterdir())}


KILLED = """
import os, sys, time
from pathlib import Path
from crgame_ros.recording.writer import BagWriter, TopicQos
with BagWriter(Path(sys.argv[1]), now_ns=time.monotonic_ns) as writer:
    channel = writer.add_topic('/a', 'std_msgs/msg/String',
                               TopicQos(1, 'reliable', 'transient_local'))
    while True:
        now_ns = time.time_ns()
        writer.write(channel, bytes.fromhex('0001000001000000') + bytes(1), now_ns)
        os.write(1, b'%d\\n' % now_ns)
        time.sleep(0.002)
"""


@pytest.mark.slow
def test_killed_recorder_loses_at_most_its_last_second(tmp_path: Path) -> None:
    """A real process, killed with SIGKILL between two flushes, some way into a second."""
    folder = tmp_path / 'run'
    with subprocess.Popen([sys.executable, '-c', KILLED, str(folder)], stdout=subprocess.PIPE,
                          cwd=share_directory()) as process:
        assert process.stdout is not None
        first_ns = int(process.stdout.readline())
        written = [first_ns]
        while written[-1] - first_ns < 2_600_000_000:
            written.append(int(process.stdout.readline()))
        process.send_signal(signal.SIGKILL)
        written += [int(line) for line in process.stdout.read().split(b'\n') if line]
    with BagReader(folder) as reader:
        assert not reader.complete
        stored = [message.log_time_ns for message in reader.messages()]
    report = recover(folder)
    assert (report.messages, report.rewritten, report.metadata_written) == (
        len(stored), ('run_0.mcap',), True)
    # The process may die between storing a message and reporting it.
    assert stored[:len(written)] == written[:len(stored)]
    assert written[-1] - stored[-1] < 1_000_000_000
    with Reader(folder) as other:
        assert [time_ns for _, time_ns, _ in other.messages()] == stored
        assert other.connections[0].ext.offered_qos_profiles[0].durability.name == (
            'TRANSIENT_LOCAL')


def test_cut_anywhere_a_prefix_comes_back(tmp_path: Path, samples: Any) -> None:
    """Twenty cuts: always a prefix, longer the later the cut, complete for every other reader."""
    expected = record(tmp_path / 'run', samples)
    content = (tmp_path / 'run' / 'run_0.mcap').read_bytes()
    found = []
    for cut in sorted(random.Random(11).sample(range(100, len(content)), 20)):
        folder = tmp_path / f'cut_{cut}'
        folder.mkdir()
        (folder / 'run_0.mcap').write_bytes(content[:cut])
        report = recover(folder)
        assert 0 <= report.bytes_dropped < cut
        with BagReader(folder) as reader:
            assert reader.complete
            messages = list(reader.messages())
        assert messages == expected[:len(messages)]
        # A chunk of 45 messages is lost at most, of 100 random bytes in hexadecimal each.
        assert len(messages) >= cut / len(content) * 600 - 2 * 46
        assert report.messages == len(messages)
        assert report.duration_s == pytest.approx(max(len(messages) - 1, 0) * 0.02)
        with Reader(folder) as other:
            assert other.message_count == len(messages)
        with (folder / 'run_0.mcap').open('rb') as stream:
            summary = make_reader(stream, validate_crcs=True).get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == len(messages)
        found.append(len(messages))
    assert found == sorted(found)
    assert found[0] < 100 and found[-1] > 500


def test_recovering_twice_changes_nothing_more(tmp_path: Path, samples: Any) -> None:
    """The second time finds a finished recording."""
    record(tmp_path / 'run', samples)
    file = tmp_path / 'run' / 'run_0.mcap'
    file.write_bytes(file.read_bytes()[:-1000])
    cut = file.read_bytes()
    with file.open('rb') as held:
        assert recover(tmp_path / 'run').changed
        # The old file was replaced in one step, not written over: its bytes are unchanged.
        assert held.read() == cut
    before = contents(tmp_path / 'run')
    assert sorted(before) == ['metadata.yaml', 'run_0.mcap']
    report = recover(tmp_path / 'run')
    assert (report.changed, report.messages, report.bytes_dropped) == (False, 600, 0)
    assert contents(tmp_path / 'run') == before


def test_finished_recording_is_left_untouched(tmp_path: Path, samples: Any) -> None:
    """Neither bytes nor times of its files change."""
    record(tmp_path / 'run', samples)
    before = contents(tmp_path / 'run')
    report = recover(tmp_path / 'run')
    assert not report.changed
    assert (report.messages, report.duration_s) == (600, pytest.approx(11.98))
    assert contents(tmp_path / 'run') == before


@pytest.mark.parametrize('damage', ['missing', 'broken', 'of another file'])
def test_metadata_is_written_again(tmp_path: Path, samples: Any, damage: str) -> None:
    """It comes out exactly as the recorder wrote it."""
    record(tmp_path / 'run', samples)
    metadata = tmp_path / 'run' / 'metadata.yaml'
    right = metadata.read_text()
    if damage == 'missing':
        metadata.unlink()
    else:
        metadata.write_text('{' if damage == 'broken' else right.replace('run_0', 'walk_0'))
    report = recover(tmp_path / 'run')
    assert (report.rewritten, report.metadata_written) == ((), True)
    assert metadata.read_text() == right


def test_bare_file_is_finished_alone(tmp_path: Path, samples: Any) -> None:
    """No metadata appears beside a file that had none."""
    record(tmp_path / 'run', samples)
    file = tmp_path / 'alone.mcap'
    file.write_bytes((tmp_path / 'run' / 'run_0.mcap').read_bytes()[:-1000])
    report = recover(file)
    assert (report.rewritten, report.metadata_written) == (('alone.mcap',), False)
    assert BagReader(file).complete
    assert sorted(path.name for path in tmp_path.iterdir()) == ['alone.mcap', 'run']


def test_damaged_chunk_costs_only_itself(tmp_path: Path, samples: Any) -> None:
    """A flipped bit drops the chunk around it, nothing more."""
    expected = record(tmp_path / 'run', samples)
    file = tmp_path / 'run' / 'run_0.mcap'
    with file.open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[5]
    content = bytearray(file.read_bytes())
    content[chunk.chunk_start_offset + 100] ^= 0xFF
    file.write_bytes(content)
    report = recover(tmp_path / 'run')
    assert report.bytes_dropped == chunk.chunk_length
    with BagReader(tmp_path / 'run') as reader:
        assert list(reader.messages()) == [
            message for message in expected
            if not chunk.message_start_time <= message[2] <= chunk.message_end_time]


def test_damaged_definitions_cost_only_what_they_define(tmp_path: Path, samples: Any) -> None:
    """Outside of chunks there is no checksum: a channel and the header are unreadable text."""
    file = tmp_path / 'foreign.mcap'
    with file.open('wb') as stream:
        writer = Writer(stream, use_chunking=False, repeat_channels=False)
        writer.start('profile')
        schema = writer.register_schema(STRING, 'ros2msg', b'string data\n')
        channels = [writer.register_channel(topic, 'cdr', schema) for topic in ('/good', '/lost')]
        for i in range(10):
            writer.add_message(channels[i % 2], i, samples.string(str(i)), i)
        writer.finish()
    content = file.read_bytes()
    file.write_bytes(content.replace(b'/lost', b'/\xff\xff\xff\xff')
                     .replace(b'profile', b'\xff' * 7))
    with BagReader(file) as reader:
        assert not reader.complete
    report = recover(file)
    assert report.messages == 5
    assert report.bytes_dropped > 5 * len(samples.string('1'))
    with BagReader(file) as reader:
        assert reader.complete
        assert [m.message.data for m in reader.decoded()] == ['0', '2', '4', '6', '8']


def test_split_recording_is_finished_whole(tmp_path: Path, samples: Any) -> None:
    """The last of two files was cut, and there is no metadata."""
    record(tmp_path / 'run', samples)
    with BagWriter(tmp_path / 'more', now_ns=time.monotonic_ns) as writer:
        channel = writer.add_topic('/b', STRING, LATCHED)
        writer.write(channel, samples.string('late'), 99_000_000_000)
    (tmp_path / 'run' / 'run_1.mcap').write_bytes(writer.path.read_bytes()[:-20])
    (tmp_path / 'run' / 'metadata.yaml').unlink()
    report = recover(tmp_path / 'run')
    assert (report.messages, report.rewritten) == (601, ('run_1.mcap',))
    with Reader(tmp_path / 'run') as other:
        assert (other.message_count, other.start_time) == (601, 5_000_000_000)


def test_everything_of_a_foreign_file_is_kept(tmp_path: Path, samples: Any) -> None:
    """Publish times, sequences, metadata, attachments and channel metadata survive."""
    file = tmp_path / 'foreign.mcap'
    with file.open('wb') as stream:
        writer = Writer(stream, use_chunking=False)
        writer.start('ros2', 'a recorder')
        writer.add_metadata('rosbag2', {'serialized_metadata': 'x: 1'})
        writer.add_attachment(7, 8, 'notes.txt', 'text/plain', b'hello')
        writer.register_schema('unused/msg/Type', 'ros2msg', b'bool data\n')
        schema = writer.register_schema(STRING, 'ros2msg', b'string data\n')
        writer.register_channel('/silent', 'cdr', schema, {'key': 'value'})
        channel = writer.register_channel('/a', 'cdr', schema, {'topic_type_hash': 'RIHS01_x'})
        for i in range(5):
            writer.add_message(channel, 100 + i, samples.string(str(i)), 90 + i, 40 + i)
        writer.finish()
    file.write_bytes(file.read_bytes()[:-30])
    assert recover(file).messages == 5
    with file.open('rb') as stream:
        reader = make_reader(stream)
        assert (reader.get_header().profile, reader.get_header().library) == ('ros2', 'a recorder')
        found = [(channel.topic, channel.metadata, message.log_time, message.publish_time,
                  message.sequence) for _, channel, message in reader.iter_messages()]
        assert found == [('/a', {'topic_type_hash': 'RIHS01_x'}, 100 + i, 90 + i, 40 + i)
                         for i in range(5)]
        (metadata,), (attachment,) = reader.iter_metadata(), reader.iter_attachments()
        summary = reader.get_summary()
    assert metadata.metadata == {'serialized_metadata': 'x: 1'}
    assert (attachment.name, attachment.data, attachment.log_time) == ('notes.txt', b'hello', 8)
    assert summary is not None
    assert {c.topic: c.metadata for c in summary.channels.values()}['/silent'] == {'key': 'value'}


FULL = """
import resource, signal, sys
from pathlib import Path
from crgame_ros.errors import CrgameError
from crgame_ros.recording.recover import recover
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), int(sys.argv[2])))
try:
    recover(Path(sys.argv[1]))
except CrgameError as error:
    print(type(error).__name__, error)
"""


@pytest.mark.parametrize(('limit', 'cut'), [(100, 0), (100, 1000), (30_000, 1000), (60_000, 1000)])
def test_full_disk_leaves_the_recording_as_it_was(tmp_path: Path, samples: Any, limit: int,
                                                  cut: int) -> None:
    """The system refuses to write past a limit: the file (75 kB), or else only the metadata."""
    record(tmp_path / 'run', samples)
    file = tmp_path / 'run' / 'run_0.mcap'
    content = file.read_bytes()
    file.write_bytes(content[:len(content) - cut])
    (tmp_path / 'run' / 'metadata.yaml').unlink()
    before = contents(tmp_path / 'run')
    result = subprocess.run([sys.executable, '-c', FULL, str(tmp_path / 'run'), str(limit)],
                            capture_output=True, text=True, cwd=share_directory())
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith('RecordingError')
    assert 'File too large' in result.stdout
    assert str(tmp_path / 'run') in result.stdout
    assert contents(tmp_path / 'run') == before


def test_leftover_of_a_killed_recovery_does_no_harm(tmp_path: Path, samples: Any) -> None:
    """It is not read, and replaced next time."""
    record(tmp_path / 'run', samples)
    file = tmp_path / 'run' / 'run_0.mcap'
    file.write_bytes(file.read_bytes()[:-1000])
    (tmp_path / 'run' / '.run_0.mcap.999999999.part').write_bytes(b'half a copy')
    assert BagReader(file).message_count == 600
    assert recover(tmp_path / 'run').messages == 600
    assert sorted(contents(tmp_path / 'run')) == ['metadata.yaml', 'run_0.mcap']


@pytest.mark.parametrize('kind', ['missing', 'empty folder', 'empty file', 'text'])
def test_nothing_to_recover(tmp_path: Path, kind: str) -> None:
    """One message that names the path."""
    path = {'missing': tmp_path / 'absent', 'empty folder': tmp_path,
            'empty file': tmp_path / 'a.mcap', 'text': tmp_path / 'a.txt'}[kind]
    if kind in ('empty file', 'text'):
        path.write_text('' if kind == 'empty file' else 'hello')
    with pytest.raises(InputError) as caught:
        recover(path)
    assert str(path) in str(caught.value)


def test_sqlite_recordings(tmp_path: Path, samples: Any) -> None:
    """A finished one is left alone; metadata that is missing or broken is written, once."""
    with RosbagsWriter(tmp_path / 'bag', version=9,
                       storage_plugin=StoragePlugin.SQLITE3) as writer:
        for topic, times in (('/a', (7, 9)), ('/b', (8,))):
            connection = writer.add_connection(topic, STRING, typestore=samples.store)
            for log_ns in times:
                writer.write(connection, log_ns, samples.string(f'{topic} {log_ns}'))
    before = contents(tmp_path / 'bag')
    assert not recover(tmp_path / 'bag').changed
    assert contents(tmp_path / 'bag') == before
    with BagReader(tmp_path / 'bag') as reader:
        topics, messages = reader.topics, list(reader.messages())
    for name, metadata in (('missing', None), ('broken', '['), ('other', 'x: 1'), (
            'wrong', re.sub(r'(duration:\s+nanoseconds: )\d+', r'\1[1]',
                            (tmp_path / 'bag' / 'metadata.yaml').read_text()))):
        folder = Path(shutil.copytree(tmp_path / 'bag', tmp_path / name))
        (folder / 'metadata.yaml').unlink()
        if metadata is not None:
            (folder / 'metadata.yaml').write_text(metadata)
        report = recover(folder)
        assert report.metadata_written and report.messages == 3 and report.duration_s == 2e-9
        with BagReader(folder) as reader:
            assert reader.complete and reader.topics == topics
            assert list(reader.messages()) == messages
        assert not recover(folder).changed


def test_a_killed_sqlite_recorder(tmp_path: Path, samples: Any) -> None:
    """Uncommitted data is rolled back, the rest is there; a damaged file is refused."""
    with RosbagsWriter(tmp_path / 'bag', version=9,
                       storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection('/a', STRING, typestore=samples.store)
        for log_ns in range(1000):
            writer.write(connection, log_ns, samples.string('x' * 100))
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    database = tmp_path / 'bag' / 'bag.db3'
    killed = subprocess.run([sys.executable, '-c', textwrap.dedent(f"""
        import os, sqlite3
        connection = sqlite3.connect({str(database)!r})
        connection.execute('PRAGMA cache_size = 1')
        connection.execute('UPDATE messages SET data = ?', (b'y' * 100,))
        os._exit(0)
    """)], check=False)
    assert killed.returncode == 0 and database.with_name('bag.db3-journal').stat().st_size
    assert recover(tmp_path / 'bag').messages == 1000
    with BagReader(tmp_path / 'bag') as reader:
        assert {message.data[8:108] for message in reader.messages()} == {b'x' * 100}
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    data = database.read_bytes()
    database.write_bytes(data[:len(data) // 2])
    with pytest.raises(InputError, match=r'bag\.db3: the database is damaged'):
        recover(tmp_path / 'bag')
