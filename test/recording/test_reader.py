# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading recordings of every kind, finished or not, and refusing other files."""

from pathlib import Path
import random
import re
import time
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.recording.mcap_file import McapFile
from crgame_ros.recording.metadata import TopicQos
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.writer import BagWriter
from mcap.writer import CompressionType, IndexType, Writer
import numpy as np
import pytest
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

STRING = 'std_msgs/msg/String'
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'


def record_ours(folder: Path, samples: Any) -> list[tuple[str, str, int, bytes]]:
    """Record 30 messages on two topics; return the expected output of a reader."""
    expected = [('/b' if i % 3 else '/a', STRING, 1_000 + i, samples.string(f'message {i}'))
                for i in range(30)]
    with BagWriter(folder, now_ns=time.monotonic_ns) as writer:
        channels = {'/a': writer.add_topic('/a', STRING, TopicQos(1, 'reliable',
                                                                  'transient_local')),
                    '/b': writer.add_topic('/b', STRING, TopicQos(5, 'best_effort'))}
        for topic, _, log_time_ns, data in expected:
            writer.write(channels[topic], data, log_time_ns)
    return expected


def record_others(folder: Path, samples: Any, storage: StoragePlugin, version: Any,
                  mode: CompressionMode = CompressionMode.NONE) -> list[Any]:
    """Record the same with the writer of rosbags."""
    infinite = QosTime(9223372036, 854775807)
    latched = Qos(QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL,
                  infinite, infinite, QosLiveliness.AUTOMATIC, infinite, False)
    expected = [('/b' if i % 3 else '/a', STRING, 1_000 + i, samples.string(f'message {i}'))
                for i in range(30)]
    writer = RosbagsWriter(folder, version=version, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {name: writer.add_connection(
            name, STRING, typestore=samples.store,
            offered_qos_profiles=[latched] if name == '/a' else []) for name in ('/a', '/b')}
        for topic, _, log_time_ns, data in expected:
            writer.write(connections[topic], log_time_ns, data)
    return expected


def test_our_own_folder(tmp_path: Path, samples: Any) -> None:
    """Messages, filter, QoS and latched topics of our own writer."""
    expected = record_ours(tmp_path / 'run', samples)
    with BagReader(tmp_path / 'run') as reader:
        assert (reader.storage, reader.complete, reader.message_count) == ('mcap', True, 30)
        assert (reader.start_ns, reader.end_ns) == (1_000, 1_029)
        assert list(reader.messages()) == expected
        assert list(reader.messages(['/a', '/none'])) == [e for e in expected if e[0] == '/a']
        assert reader.topics['/a'].qos == (TopicQos(1, 'reliable', 'transient_local'),)
        assert reader.topics['/b'].qos == (TopicQos(5, 'best_effort', 'volatile'),)
        assert [m.message.data for m in reader.decoded(['/a'])] == [
            f'message {i}' for i in range(0, 30, 3)]
        latched = reader.latched('/a')
        assert latched is not None and latched.message.data == 'message 27'
        assert reader.latched('/none') is None


@pytest.mark.parametrize('storage', [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize('version', [8, 9])
def test_folders_of_rosbag2(tmp_path: Path, samples: Any, storage: StoragePlugin,
                            version: int) -> None:
    """Both storages, and QoS as text (version 8) and as lists (version 9)."""
    expected = record_others(tmp_path / 'bag', samples, storage, version)
    with BagReader(tmp_path / 'bag') as reader:
        assert (reader.storage, reader.complete) == (storage.name.lower(), True)
        assert (reader.start_ns, reader.end_ns, reader.message_count) == (1_000, 1_029, 30)
        assert reader.topics['/a'].qos == (TopicQos(1, 'reliable', 'transient_local'),)
        assert list(reader.messages()) == expected
        assert list(reader.messages(['/b'])) == [e for e in expected if e[0] == '/b']
        assert list(reader.messages(['/none'])) == []
        assert next(reader.decoded(['/b'])).message.data == 'message 1'


@pytest.mark.parametrize('kind', ['ours', 'mcap', 'sqlite3'])
def test_a_span_of_time(tmp_path: Path, samples: Any, kind: str) -> None:
    """From the first limit on and before the second, of all topics or of one, in every storage."""
    expected = record_ours(tmp_path / 'bag', samples) if kind == 'ours' else record_others(
        tmp_path / 'bag', samples, StoragePlugin[kind.upper()], 9)
    with BagReader(tmp_path / 'bag') as reader:
        for start, end in ((1_005, 1_012), (None, 1_003), (1_027, None), (1_005, 1_005),
                           (0, 900), (2_000, 3_000)):
            inside = [e for e in expected if (start is None or e[2] >= start)
                      and (end is None or e[2] < end)]
            assert list(reader.messages(None, start, end)) == inside
            assert [m.log_time_ns for m in reader.decoded(['/a'], start, end)] == [
                e[2] for e in inside if e[0] == '/a']


@pytest.mark.parametrize('cut', [False, True], ids=['whole', 'cut'])
def test_only_what_may_hold_the_answer_is_read(tmp_path: Path, samples: Any, cut: bool,
                                               monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten chunks a second long, the rare topic in one of them: the others stay unread."""
    times = iter(range(0, 10**13, 10**9))
    with BagWriter(tmp_path / 'bag', now_ns=lambda: next(times)) as writer:
        rare, often = (writer.add_topic(name, STRING, TopicQos(1)) for name in ('/rare', '/often'))
        for i in range(10):
            # Each reading of the clock is a second after the one before, so each writes a chunk.
            writer.write(rare if i == 3 else often, samples.string('x'), 1_000 + i)
    file = tmp_path / 'bag' / 'bag_0.mcap'
    if cut:
        (tmp_path / 'bag' / 'metadata.yaml').unlink()
        whole = McapFile(file)
        # Behind the last chunk, before its index.
        last = whole.segments[-1]
        file.write_bytes(file.read_bytes()[:last.offset + last.size])
    read: list[int] = []
    content = McapFile._content
    with BagReader(tmp_path / 'bag') as reader:
        assert reader.complete != cut
        monkeypatch.setattr(McapFile, '_content', lambda self, segment: read.append(
            segment.offset) or content(self, segment))
        assert [m.log_time_ns for m in reader.messages(['/rare'])] == [1_003]
        assert len(read) == 1
        read.clear()
        assert [m.log_time_ns for m in reader.messages(None, 1_004, 1_006)] == [1_004, 1_005]
        assert len(read) == 2


@pytest.mark.exhaustive
def test_a_damage_anywhere_is_told_or_harmless(tmp_path: Path, samples: Any) -> None:
    """Four changed bytes are refused, reported, or harmless to each topic, one by one too."""
    times = iter(range(0, 10**13, 10**9))
    with BagWriter(tmp_path / 'bag', now_ns=lambda: next(times)) as writer:
        channels = [writer.add_topic(name, STRING, TopicQos(1)) for name in ('/a', '/b', '/c')]
        for i in range(12):
            writer.write(channels[(i // 2) % 3], samples.string(f'message {i}'), 1_000 + i)
    sound, damaged = tmp_path / 'bag' / 'bag_0.mcap', tmp_path / 'damaged.mcap'
    data = sound.read_bytes()

    def read(file: Path) -> tuple[bool, list[Any]]:
        with BagReader(file) as reader:
            found = [list(reader.messages(topics, start))
                     for topics in (None, ['/a'], ['/b'], ['/c']) for start in (None, 1_006)]
            return reader.complete, found

    (_, expected), dice = read(sound), random.Random(3)
    told = refused = 0
    for place in range(len(data) - 4):
        damaged.write_bytes(data[:place] + dice.randbytes(4) + data[place + 4:])
        try:
            complete, found = read(damaged)
        except InputError:
            refused += 1
            continue
        told += not complete
        assert found == expected or not complete, place
    assert told > len(data) // 4 and refused > 100


@pytest.mark.parametrize('storage', [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_bare_files(tmp_path: Path, samples: Any, storage: StoragePlugin) -> None:
    """A file needs no metadata; a folder with one file and none reads, but is not complete."""
    expected = record_others(tmp_path / 'bag', samples, storage, 9)
    (file,) = (p for p in (tmp_path / 'bag').iterdir() if p.name != 'metadata.yaml')
    with BagReader(file) as reader:
        assert reader.complete
        assert list(reader.messages()) == expected
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    with BagReader(tmp_path / 'bag') as reader:
        assert reader.notices == ('metadata.yaml is missing; `crgame recover` writes it',)
        assert list(reader.messages()) == expected


@pytest.mark.parametrize('storage', [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize('mode', [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_recordings_compressed_by_rosbag2(tmp_path: Path, samples: Any, storage: StoragePlugin,
                                          mode: CompressionMode) -> None:
    """Compression of rosbag2 itself, on top of the storage."""
    expected = record_others(tmp_path / 'bag', samples, storage, 9, mode)
    with BagReader(tmp_path / 'bag') as reader:
        assert list(reader.messages()) == expected


@pytest.mark.parametrize('storage', [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_metadata_that_do_not_name_the_storage(tmp_path: Path, samples: Any,
                                               storage: StoragePlugin) -> None:
    """As `ros2 bag reindex` writes them: MCAP is read, other files need one line."""
    expected = record_others(tmp_path / 'bag', samples, storage, 9)
    metadata = tmp_path / 'bag' / 'metadata.yaml'
    text = metadata.read_text()
    metadata.write_text(re.sub('storage_identifier: .*', "storage_identifier: ''", text))
    assert metadata.read_text() != text
    if storage is StoragePlugin.SQLITE3:
        with pytest.raises(InputError, match='does not name the storage'):
            BagReader(tmp_path / 'bag')
        return
    with BagReader(tmp_path / 'bag') as reader:
        assert (list(reader.messages()), reader.storage) == (expected, 'mcap')


def test_chunk_indexes_without_message_indexes(tmp_path: Path, samples: Any) -> None:
    """Nothing says which channels are in a chunk, so that all are read."""
    file, sent = tmp_path / 'a.mcap', [f'message {i}' for i in range(30)]
    with file.open('wb') as stream:
        writer = Writer(stream, chunk_size=200, index_types=IndexType.CHUNK)
        writer.start('ros2')
        schema = writer.register_schema(STRING, 'ros2msg', b'string data')
        channels = [writer.register_channel(name, 'cdr', schema) for name in ('/a', '/b')]
        for i, text in enumerate(sent):
            writer.add_message(channels[i % 2], i, samples.string(text), i)
        writer.finish()
    with BagReader(file) as reader:
        assert reader.complete and reader.message_count == 30
        assert [item.message.data for item in reader.decoded(['/b'])] == sent[1::2]


@pytest.mark.parametrize('compression', list(CompressionType))
@pytest.mark.parametrize('chunked', [True, False])
@pytest.mark.parametrize('summary', [True, False])
def test_every_kind_of_mcap_in_the_order_of_log_time(
        tmp_path: Path, samples: Any, compression: CompressionType, chunked: bool,
        summary: bool) -> None:
    """Small chunks whose times overlap, as buffering recorders write them, come out sorted."""
    times = list(range(500))
    generator = random.Random(7)
    times.sort(key=lambda i: i + generator.uniform(0, 40))
    with (tmp_path / 'other.mcap').open('wb') as stream:
        writer = Writer(stream, chunk_size=1_000, compression=compression, use_chunking=chunked,
                        use_statistics=summary, repeat_channels=summary, repeat_schemas=summary)
        writer.start('ros2')
        schema = writer.register_schema(STRING, 'ros2msg', b'string data\n')
        channel = writer.register_channel('/a', 'cdr', schema)
        for time_ns in times:
            writer.add_message(channel, time_ns, samples.string(str(time_ns)), time_ns)
        writer.finish()
    with BagReader(tmp_path / 'other.mcap') as reader:
        assert (reader.complete, reader.message_count) == (True, 500)
        assert (reader.start_ns, reader.end_ns) == (0, 499)
        found = [(m.log_time_ns, m.message.data) for m in reader.decoded()]
    assert found == [(i, str(i)) for i in range(500)]


def test_split_recording(tmp_path: Path, samples: Any) -> None:
    """Two files of one recording, as `ros2 bag record --max-bag-size` leaves them."""
    first = record_ours(tmp_path / 'one', samples)
    folder = tmp_path / 'one'
    with BagWriter(tmp_path / 'two', now_ns=time.monotonic_ns) as writer:
        channel = writer.add_topic('/a', STRING, TopicQos(1, 'reliable', 'transient_local'))
        writer.write(channel, samples.string('late'), 2_000)
    writer.path.rename(folder / 'one_1.mcap')
    text = (folder / 'metadata.yaml').read_text()
    (folder / 'metadata.yaml').write_text(text.replace(
        '  relative_file_paths:\n  - one_0.mcap\n',
        '  relative_file_paths:\n  - one_0.mcap\n  - one_1.mcap\n'))
    with BagReader(folder) as reader:
        assert list(reader.messages()) == [*first, ('/a', STRING, 2_000, samples.string('late'))]
        assert reader.topics['/a'].message_count == 11


def test_truncated_file_yields_what_is_whole_and_says_so(tmp_path: Path, samples: Any) -> None:
    """Half a file yields its first messages."""
    now = [0]
    writer = BagWriter(tmp_path / 'run', now_ns=lambda: now[0])
    channel = writer.add_topic('/a', STRING, TopicQos(1))
    for i in range(100):
        now[0] = i * 100_000_000
        writer.write(channel, samples.string(str(i)), i)
    writer.close()
    content = writer.path.read_bytes()
    writer.path.write_bytes(content[:len(content) // 2])
    with BagReader(writer.path) as reader:
        assert not reader.complete
        assert 'was not finished' in reader.notices[0]
        found = [m.message.data for m in reader.decoded()]
        assert reader.message_count == len(found)
    assert 0 < len(found) < 100
    assert found == [str(i) for i in range(len(found))]


def test_zeros_at_the_end_are_no_messages(tmp_path: Path, samples: Any) -> None:
    """After a power cut the end of a file, or of its last chunk, can be zeros."""
    expected = record_ours(tmp_path / 'run', samples)
    file = tmp_path / 'run' / 'run_0.mcap'
    content = file.read_bytes()
    file.write_bytes(content + bytes(500))
    with BagReader(file) as reader:
        assert not reader.complete
        assert list(reader.messages()) == expected
    file.write_bytes(content[:200] + bytes(len(content) - 200))
    with BagReader(file) as reader:
        assert (reader.complete, list(reader.messages())) == (False, [])


def test_a_message_too_short_for_its_head_is_damage(tmp_path: Path) -> None:
    """It is left out, as other damaged records are."""
    path = tmp_path / 'a.mcap'
    path.write_bytes(b'\x89MCAP0\r\n\x05' + bytes(8))
    with BagReader(path) as reader:
        assert not reader.complete and reader.message_count == 0


def test_damage_inside_is_named(tmp_path: Path, samples: Any) -> None:
    """A flipped bit fails the checksum; the message says where."""
    record_ours(tmp_path / 'run', samples)
    file = tmp_path / 'run' / 'run_0.mcap'
    content = bytearray(file.read_bytes())
    content[300] ^= 0xFF
    file.write_bytes(content)
    with BagReader(file) as reader:
        with pytest.raises(InputError, match=r'run_0.mcap: the data at byte \d+ is damaged'):
            list(reader.messages())


def test_checksum_is_compared(tmp_path: Path, samples: Any) -> None:
    """Without compression a changed letter would read well; only the checksum tells."""
    file = tmp_path / 'plain.mcap'
    with file.open('wb') as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start('ros2')
        schema = writer.register_schema(STRING, 'ros2msg', b'string data\n')
        channel = writer.register_channel('/a', 'cdr', schema)
        writer.add_message(channel, 1, samples.string('faithful'), 1)
        writer.finish()
    file.write_bytes(file.read_bytes().replace(b'faithful', b'faithfuI'))
    with BagReader(file) as reader:
        with pytest.raises(InputError, match='checksum'):
            list(reader.messages())


@pytest.mark.parametrize('change', ['', 'cut', 'longer', 'padded', 'encoding'])
@pytest.mark.parametrize('type_name', [STRING, TRAJECTORY])
def test_message_that_does_not_fit_its_type(tmp_path: Path, samples: Any, type_name: str,
                                            change: str) -> None:
    """A message must not be short; the middleware may leave anything behind it."""
    whole = samples.string('text' * 9) if type_name == STRING else samples.trajectory(16, 1)
    data = {'': whole, 'cut': whole[:-10], 'longer': whole + b'1234', 'padded': whole + bytes(99),
            'encoding': b'\x00\x07' + whole[2:]}[change]
    with BagWriter(tmp_path / 'run', now_ns=time.monotonic_ns) as writer:
        writer.write(writer.add_topic('/a', type_name, TopicQos(1)), data, 1)
    with BagReader(tmp_path / 'run') as reader:
        if change in ('', 'padded', 'longer'):
            assert len(list(reader.decoded())) == 1
        else:
            with pytest.raises(InputError, match=f'a message of /a is no {type_name}'):
                list(reader.decoded())


def test_type_that_only_the_recording_knows(tmp_path: Path) -> None:
    """Its definition is taken from the recording."""
    with (tmp_path / 'own.mcap').open('wb') as stream:
        writer = Writer(stream)
        writer.start('ros2')
        schema = writer.register_schema('own_msgs/msg/Pair', 'ros2msg',
                                        b'std_msgs/Bool first\nuint8 second\n' + b'=' * 80
                                        + b'\nMSG: std_msgs/Bool\nbool data\n')
        channel = writer.register_channel('/pair', 'cdr', schema)
        writer.add_message(channel, 5, b'\x00\x01\x00\x00\x01\x07', 5)
        unknown = writer.register_schema('own_msgs/msg/Secret', '', b'')
        writer.add_message(writer.register_channel('/secret', 'cdr', unknown), 6, b'', 6)
        writer.finish()
    with BagReader(tmp_path / 'own.mcap') as reader:
        pair = next(reader.decoded(['/pair'])).message
        assert (pair.first.data, pair.second) == (True, 7)
        with pytest.raises(InputError, match='/secret has the type own_msgs/msg/Secret'):
            list(reader.decoded(['/secret']))


def make_refused(folder: Path, kind: str, samples: Any) -> Path:
    """Make a file or folder that is no recording; return its path."""
    folder.mkdir()
    if kind == 'missing':
        return folder / 'absent'
    if kind == 'several files':
        for name in ('a.mcap', 'b.mcap'):
            (folder / name).write_bytes(b'')
    elif kind == 'text':
        (folder / 'notes.txt').write_text('hello')
        return folder / 'notes.txt'
    elif kind in ('no mcap', 'no sqlite', 'empty file', 'packed'):
        name = {'no sqlite': 'a.db3', 'packed': 'a.mcap.zstd'}.get(kind, 'a.mcap')
        (folder / name).write_text('' if kind == 'empty file' else 'hello' * 1000)
    elif kind == 'broken metadata':
        (folder / 'metadata.yaml').write_text('rosbag2_bagfile_information: [}')
    elif kind == 'nested metadata':
        (folder / 'metadata.yaml').write_text('[' * 5000 + ']' * 5000)
    elif kind == 'other metadata':
        (folder / 'metadata.yaml').write_text('a: b')
    elif kind != 'empty folder':
        record_ours(folder / 'run', samples)
        metadata = folder / 'run' / 'metadata.yaml'
        if kind == 'unknown storage':
            metadata.write_text(metadata.read_text().replace(': mcap', ': tape'))
        else:
            (folder / 'run' / 'run_0.mcap').unlink()
        return folder / 'run'
    return folder


@pytest.mark.parametrize(('kind', 'message'), [
    ('missing', 'no such file or folder'), ('empty folder', 'no recording in this folder'),
    ('several files', '2 files but no metadata.yaml'), ('text', 'not a recording'),
    ('packed', 'is compressed, and metadata.yaml is missing'),
    ('no mcap', 'no MCAP file'), ('no sqlite', 'cannot be read'),
    ('empty file', 'the file is empty'), ('broken metadata', 'is no YAML'),
    ('other metadata', 'not the metadata of a recording'),
    ('nested metadata', 'nested deeper than 20 levels'),
    ('unknown storage', "unknown storage 'tape'"), ('missing file', 'the file is missing')])
def test_what_is_no_recording_gets_one_clear_line(tmp_path: Path, samples: Any, kind: str,
                                                  message: str) -> None:
    """The line has the fault, its place and the remedy."""
    path = make_refused(tmp_path / 'place', kind, samples)
    with pytest.raises(InputError) as caught:
        BagReader(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert '\n' not in str(caught.value)
    assert caught.value.remedy


def test_metadata_cannot_lead_outside_of_its_folder(tmp_path: Path, samples: Any) -> None:
    """Only names of files in the folder are accepted."""
    record_ours(tmp_path / 'secret', samples)
    record_ours(tmp_path / 'run', samples)
    metadata = tmp_path / 'run' / 'metadata.yaml'
    metadata.write_text(metadata.read_text().replace('run_0.mcap', '../secret/secret_0.mcap'))
    with pytest.raises(InputError, match='the file is missing'):
        BagReader(tmp_path / 'run')


def test_messages_of_the_ros_middleware_decode_right(tmp_path: Path) -> None:
    """Serialised by rclpy itself, recorded raw, decoded without it: every field agrees."""
    serialization = pytest.importorskip('rclpy.serialization')
    sent = ros_messages()
    with BagWriter(tmp_path / 'run', now_ns=time.monotonic_ns) as writer:
        for i, (type_name, message) in enumerate(sent):
            channel = writer.add_topic(f'/t{i}', type_name, TopicQos(1))
            writer.write(channel, serialization.serialize_message(message), i)
    with BagReader(tmp_path / 'run') as reader:
        received = list(reader.decoded())
    assert len(received) == len(sent)
    for (_, message), decoded in zip(sent, received, strict=True):
        assert_same(message, decoded.message)


def ros_messages() -> list[tuple[str, Any]]:
    """Make one message of each type on a hot path with rclpy's own classes."""
    from builtin_interfaces.msg import Duration, Time
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from rosgraph_msgs.msg import Clock
    from sensor_msgs.msg import Joy
    from std_msgs.msg import (
        Float64MultiArray,
        Header,
        MultiArrayDimension,
        MultiArrayLayout,
        String,
    )
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
    header = Header(stamp=Time(sec=12, nanosec=345), frame_id='map')
    values = [float(i) / 3 for i in range(240)]
    points = [JointTrajectoryPoint(positions=values, velocities=values[::-1],
                                   accelerations=[float('nan')] * 240,
                                   time_from_start=Duration(sec=-1, nanosec=i)) for i in range(31)]
    status = DiagnosticStatus(level=b'\x02', name='av0/drivability', message='Zusammenstoß',
                              hardware_id='', values=[KeyValue(key='n', value='17')])
    return [
        ('trajectory_msgs/msg/JointTrajectory', JointTrajectory(
            header=header, joint_names=[f'object {i}/x' for i in range(240)], points=points)),
        ('std_msgs/msg/String', String(data='Größe ≤ 5 m')),
        ('std_msgs/msg/Float64MultiArray', Float64MultiArray(
            layout=MultiArrayLayout(dim=[MultiArrayDimension(label='n', size=3, stride=3)]),
            data=[1.0, -2.5, 1e300])),
        ('diagnostic_msgs/msg/DiagnosticArray', DiagnosticArray(header=header, status=[status])),
        ('sensor_msgs/msg/Joy', Joy(header=header, axes=[0.5, -1.0], buttons=[1, 0, 7])),
        ('rosgraph_msgs/msg/Clock', Clock(clock=Time(sec=2**31 - 1, nanosec=999_999_999)))]


def assert_same(sent: Any, decoded: Any) -> None:
    """Compare a message of rclpy with one of rosbags, field by field."""
    if hasattr(sent, 'get_fields_and_field_types'):
        for name in sent.get_fields_and_field_types():
            assert_same(getattr(sent, name), getattr(decoded, name))
    elif isinstance(sent, str | int | float):
        assert decoded == sent
    elif isinstance(sent, bytes):
        assert decoded == sent[0]
    elif len(sent) and not isinstance(sent[0], float | int):
        assert len(sent) == len(decoded)
        for one, other in zip(sent, decoded, strict=True):
            assert_same(one, other)
    else:
        np.testing.assert_array_equal(np.asarray(decoded), np.asarray(sent))
