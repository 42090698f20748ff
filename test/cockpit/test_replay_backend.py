# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings as the page gets them: every state to the last bit, in chunks, with events."""

import asyncio
from collections.abc import Iterator
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any
from urllib.request import urlopen

import aiohttp
from crgame_ros.cockpit import replay_chunks
from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.replay_backend import CHUNKS_KEPT, open_replay, ReplayBackend
from crgame_ros.cockpit.server import create_app, listen
from crgame_ros.errors import InputError
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.joints import vehicles_from_joints
from crgame_ros.recording.mcap_file import McapFile
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.simulation.offline import OfflineResult
import numpy as np
import pytest
from replay_support import (
    CUT_IN,
    drive,
    happenings,
    LATENCY,
    N,
    PARKED,
    plans,
    read_frames,
    record,
    recorder,
    samples,
    START,
    TRAJECTORY,
)
from rosbags.rosbag2 import StoragePlugin

DURATION_S, STEPS = 12.0, 1200


@pytest.fixture(scope='module')
def parked() -> OfflineResult:
    """Drive past parked cars for 12 s: three chunks."""
    return drive(PARKED, DURATION_S)


@pytest.fixture(scope='module')
def bag(parked: OfflineResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record the run with all its events."""
    return record(tmp_path_factory.mktemp('replay') / 'bag',
                  [*recorder.messages(parked), *plans(parked), *happenings()])


@pytest.fixture(scope='module')
def backend(bag: Path) -> Iterator[ReplayBackend]:
    """Open the recording."""
    opened = ReplayBackend(bag)
    yield opened
    opened.close()


def _states(bag: Path) -> dict[int, Any]:
    """Read the raw messages of /vehicles/state by n, without the code under test."""
    with BagReader(bag) as reader:
        return {stamp_of(item.message) // 10_000_000: item.message.points[0]
                for item in reader.decoded(['/vehicles/state'])}


def test_every_state_is_that_of_the_message(bag: Path, backend: ReplayBackend,
                                            parked: OfflineResult) -> None:
    """Positions agree to the last bit at each of the 1201 steps; commands are those consumed."""
    info = backend.info()
    assert (info['chunks'], info['chunk_s'], info['duration_s']) == (3, 5.0, DURATION_S)
    frames = read_frames(*map(backend.chunk, range(3)))
    raw = _states(bag)
    assert [int(head[2]) for _, head, _ in frames.states] == list(range(STEPS + 1)) == sorted(raw)
    for _, head, body in frames.states:
        n = int(head[2])
        assert head.tolist() == [1, 0, n, n // N, n * 0.01]
        rows = body[1:].reshape(2, 13)
        joints = [np.array(values).reshape(2, 4) for values in (
            raw[n].positions, raw[n].velocities, raw[n].accelerations)]
        np.testing.assert_array_equal(rows[:, :3], joints[0][:, :3])
        np.testing.assert_array_equal(rows[:, :8], vehicles_from_joints(*joints))
    commands = np.array([body[1:].reshape(2, 13)[:, 8:] for _, _, body in frames.states])
    # An AV's row has no command but the lights that its plans set.
    assert np.isnan(commands[0]).all() and np.isnan(commands[:, 1, :4]).all()
    assert np.all(commands[1:, 1, 4] == 0.0)
    # The flag that asks to put a vehicle back is no part of a frame.
    np.testing.assert_array_equal(commands[1:, 0], parked.commands[1:, 0, :5])


def test_ticks_are_those_of_the_run_log(bag: Path, backend: ReplayBackend) -> None:
    """Vehicles and objects at each scenario step agree with the reader of conversions."""
    log = read_trajectories(bag)
    frames = read_frames(*map(backend.chunk, range(3)))
    at_ticks = np.array([body[1:].reshape(2, 13)[:, :8] for _, head, body in frames.states
                         if head[2] % N == 0])
    np.testing.assert_array_equal(at_ticks, log.vehicle_states)
    objects = {int(head[3]): body[1:].reshape(-1, 6) for _, head, body in frames.objects}
    assert sorted(objects) == log.ks.tolist() == list(range(121))
    for k, rows in objects.items():
        np.testing.assert_array_equal(rows[:, :3], log.object_poses[k])
        np.testing.assert_array_equal(rows[:, 3:], log.object_velocities[k])


def test_plans_come_when_they_arrived(backend: ReplayBackend, parked: OfflineResult) -> None:
    """A plan made for tick n follows the state n + 3 and has the poses that were sent."""
    frames = read_frames(backend.chunk(0))
    steps = {place: int(head[2]) for place, head, _ in frames.states}
    assert len(frames.plans) == 50
    for place, head, body in frames.plans:
        before = max(n for at, n in steps.items() if at < place)
        assert before == head[2] + LATENCY
        assert body[:2].tolist() == [1, 4]
        points = body[2:].reshape(4, 5)
        av = parked.vehicle_states[int(head[2]), 1]
        np.testing.assert_allclose(points[0, :3], av[:3], rtol=0, atol=1e-12)
        np.testing.assert_allclose(points[:, 3], 10.0, rtol=1e-12)
        np.testing.assert_allclose(points[:, 4], [0.0, 0.1, 0.2, 0.3], rtol=0, atol=1e-15)


def test_predictions_are_of_the_others(backend: ReplayBackend, parked: OfflineResult) -> None:
    """A prediction holds all present vehicles but the requesting AV, by the scene's columns."""
    _, head, body = read_frames(backend.chunk(0)).predictions[7]
    assert head[2] == 70
    asking, length, count = body[:3].astype(int)
    entries = body[3:].reshape(count, 1 + 3 * length)
    assert (asking, length) == (1, 3)
    poses = parked.setup.obstacles.states_at(7).poses
    there = [0, *(2 + index for index in np.flatnonzero(np.isfinite(poses[:, 0])))]
    assert entries[:, 0].astype(int).tolist() == there
    np.testing.assert_array_equal(entries[1:, 1:4], poses[np.isfinite(poses[:, 0])])


def test_a_chunk_can_be_shown_alone(backend: ReplayBackend) -> None:
    """It begins with the previous objects, prediction and plan, then the first state."""
    frames = read_frames(backend.chunk(1))
    assert frames.states[0][1][2] == 500
    first = frames.states[0][0]
    assert [int(head[2]) for place, head, _ in frames.objects if place < first] == [490, 500]
    assert [int(head[2]) for place, head, _ in frames.predictions if place < first] == [490, 500]
    assert [int(head[2]) for place, head, _ in frames.plans if place < first] == [490]


def test_chunks_are_built_when_asked_for(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Few chunks are kept, a rebuilt one is equal, and only its part of the file is read."""
    monkeypatch.setattr(replay_chunks, 'CHUNK_S', 0.5)
    backend = ReplayBackend(bag)
    try:
        info = backend.info()
        assert (info['chunks'], info['chunk_s']) == (25, 0.5)
        run = backend._run(0)
        first = [backend.chunk(i) for i in range(25)]
        assert run.chunk.cache_info().currsize == CHUNKS_KEPT
        read: list[int] = []
        content = McapFile._content
        monkeypatch.setattr(McapFile, '_content', lambda self, segment: read.append(
            segment.offset) or content(self, segment))
        assert backend.chunk(3) == first[3]
        # Segments hold 100 messages, a third of a second; there are some 40 of them.
        assert 0 < len(set(read)) <= 8
        read.clear()
        assert backend.chunk(3) == first[3]
        assert read == []
        assert [int(head[2]) for _, head, _ in read_frames(first[24]).states] == [1200]
    finally:
        backend.close()


@pytest.mark.exhaustive
@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_recordings_of_ros2_bag(tmp_path: Path, parked: OfflineResult, backend: ReplayBackend,
                                storage: str) -> None:
    """Recordings written by `ros2 bag record` give the same frames."""
    messages = [*recorder.messages(parked), *plans(parked), *happenings()]
    messages.sort(key=lambda message: message[2])
    other = ReplayBackend(recorder.rosbag2(tmp_path / 'bag', messages,
                                           StoragePlugin[storage.upper()]))
    try:
        assert [other.chunk(i) for i in range(3)] == [backend.chunk(i) for i in range(3)]
        assert other.info()['events'] == backend.info()['events']
    finally:
        other.close()


def test_recording_that_was_cut_off(tmp_path: Path, parked: OfflineResult, bag: Path) -> None:
    """The intact part is shown, up to its last state, and a notice says so."""
    folder = record(tmp_path / 'bag', [*recorder.messages(parked), *plans(parked)])
    (folder / 'metadata.yaml').unlink()
    file = folder / 'bag_0.mcap'
    file.write_bytes(file.read_bytes()[:-file.stat().st_size // 3])
    with BagReader(folder) as reader:
        last = [stamp_of(item.message) for item in reader.decoded(['/vehicles/state'])][-1]
    for path in (folder, file):
        backend = ReplayBackend(path)
        try:
            info = backend.info()
            assert 300 < info['last_n'] == last // 10_000_000 < STEPS
            assert any('was not finished' in notice for notice in info['notices'])
            frames = read_frames(*map(backend.chunk, range(info['chunks'])))
            assert [int(head[2]) for _, head, _ in frames.states] == list(
                range(info['last_n'] + 1))
        finally:
            backend.close()


def test_each_run_of_a_recording(tmp_path: Path, parked: OfflineResult) -> None:
    """Two runs between resets have their own scenes, times and states; the last is first."""
    second = drive(CUT_IN, 1.5, seed=2)
    offset_ns = 50_000_000_000
    folder = record(tmp_path / 'bag', [
        *recorder.messages(parked), *happenings(),
        *recorder.messages(second, epoch=1, offset_ns=offset_ns, log_ns=START + offset_ns),
        *plans(second, offset_ns, START + offset_ns)])
    backend = ReplayBackend(folder)
    try:
        assert backend.epochs == (0, 1)
        infos = [backend.info(epoch) for epoch in (None, 0, 1)]
        assert [info['epoch'] for info in infos] == [1, 0, 1]
        assert [info['duration_s'] for info in infos] == [1.5, DURATION_S, 1.5]
        assert [info['scene']['benchmark_id'] for info in infos[1:]] == [
            'ZAM_ParkedCars-1_1_T-1', 'ZAM_CutIn-1_1_T-1']
        assert [len(info['events']) for info in infos[1:]] == [4, 0]
        for epoch, result in ((0, parked), (1, second)):
            frames = read_frames(backend.chunk(0, epoch))
            poses = np.array([body[1:].reshape(2, 13)[:, :3] for _, _, body in frames.states])
            assert [head[1] for _, head, _ in frames.states] == [epoch] * len(poses)
            np.testing.assert_array_equal(poses, result.vehicle_states[:500, :, :3])
        assert len(read_frames(backend.chunk(0, 1)).plans) == 16
    finally:
        backend.close()
    with pytest.raises(InputError, match='no epoch 5 in it; it has 0, 1'):
        ReplayBackend(folder, 5)


def test_what_happened(backend: ReplayBackend) -> None:
    """Marks are at the steps that the messages name; a flood of refusals makes one mark."""
    events = [(e['n'], e['k'], e['kind'], e['subject'], e['count'])
              for e in backend.info()['events']]
    assert events == [(453, 45, 'collision', 'hv0', 1), (610, 61, 'trigger', 'barrier', 1),
                      (700, 70, 'refused_plan', 'av0', 3), (800, 80, 'stale_plan', 'av0', 1)]
    refused = backend.info()['events'][2]
    assert (refused['t'], refused['until_t']) == (7.0, 7.4)
    assert 'speed 99 m/s' in refused['text']


def test_documents_hold_from_their_step_on(backend: ReplayBackend) -> None:
    """Each entry is complete, so the page can use any time on its own."""
    documents = backend.info()['documents']
    assert documents['signals'] == [[0.0, {'k': 0, 'states': {'7': 'red'}, 'objects': {}}],
                                    [3.0, {'k': 30, 'states': {'7': 'green'}, 'objects': {}}]]
    assert [t for t, _ in documents['events']] == [0.0, 610 * 0.01]
    assert documents['events'][1][1]['fired'][0]['name'] == 'barrier'
    alarms = [(t, [alarm['id'] for alarm in content['active']])
              for t, content in documents['alarms']]
    assert alarms == [(4.53, ['collision:hv0']), (5.2, []), (8.0, ['stale_plan:av0']), (9.0, [])]
    assert [(t, content['hv0']['hit']) for t, content in documents['drivability']] == [
        (2.0, []), (4.53, ['o1']), (5.2, [])]
    assert [(t, content['av0']['stale']) for t, content in documents['planners']] == [
        (8.0, True), (9.0, False)]
    assert documents['seats'] == [[t, {'seats': {'hv0': {
        'source': source, 'driver': 'idle', 'holder': None, 'holder_name': name}}}]
        for t, source, name in ((0.0, 'game', None), (9.5, 'cockpit', 'Ada'))]


def test_outline_is_every_fifth_state(backend: ReplayBackend) -> None:
    """Plots get the whole run at once, every 0.05 s, with the same values."""
    outline = read_frames(backend.outline()).states
    assert [int(head[2]) for _, head, _ in outline] == list(range(0, STEPS + 1, 5))
    states = {int(head[2]): body for _, head, body in read_frames(
        *map(backend.chunk, range(3))).states}
    for _, head, body in outline:
        np.testing.assert_array_equal(body, states[int(head[2])])


def test_lost_states_are_marked(tmp_path: Path, parked: OfflineResult) -> None:
    """A gap is not filled, and the time line shows it."""
    lost = range(START + 3_001_000_000, START + 3_401_000_000)
    folder = record(tmp_path / 'bag', [
        m for m in recorder.messages(parked) if m[0] != '/vehicles/state' or m[2] not in lost])
    backend = ReplayBackend(folder)
    try:
        gaps = [e for e in backend.info()['events'] if e['kind'] == 'gap']
        assert [(e['n'], e['text']) for e in gaps] == [(299, '40 states were not recorded')]
        steps = [int(head[2]) for _, head, _ in read_frames(backend.chunk(0)).states]
        assert steps == [*range(300), *range(340, 500)]
    finally:
        backend.close()


def test_recorder_that_was_restarted(tmp_path: Path, parked: OfflineResult) -> None:
    """What it wrote after its restart is shown, too; a chunk in the gap has no states."""
    messages = recorder.messages(parked)
    record(tmp_path / 'bag', [m for m in messages if m[2] < START + 3_000_000_000])
    record(tmp_path / 'bag_part2', [m for m in messages if m[2] >= START + 11_000_000_000])
    backend = ReplayBackend(tmp_path)
    try:
        assert backend.info()['duration_s'] == DURATION_S
        chunks = [backend.chunk(number) for number in range(3)]
        assert not read_frames(chunks[1]).states
        assert [int(head[2]) for _, head, _ in read_frames(*chunks).states] == [
            *range(300), *range(1100, STEPS + 1)]
    finally:
        backend.close()


def test_plans_that_are_none_are_passed_over(tmp_path: Path, parked: OfflineResult) -> None:
    """A run with malformed plans can still be shown."""
    broken = [('/av0/plan', TRAJECTORY, START + 205_000_000, recorder.joints(
        200_000_000, ['x'], [1.0], [1.0], [1.0]))]
    backend = ReplayBackend(record(tmp_path / 'bag', [
        *recorder.messages(parked), *plans(parked)[:2], *broken]))
    try:
        assert [int(head[2]) for _, head, _ in read_frames(backend.chunk(0)).plans] == [0]
    finally:
        backend.close()


def test_messages_that_cannot_be_read_are_passed_over(
        tmp_path: Path, parked: OfflineResult) -> None:
    """Any node may publish on a run's topics: its messages cost none of the chunk's frames."""
    own = [*recorder.messages(parked), *plans(parked)]
    floats = 'std_msgs/msg/Float64MultiArray'
    strange = [('/timing/cycle', floats, START + 205_000_000, samples.cycles([(0, 20)], 'n,x')),
               ('/timing/cycle', floats, START + 206_000_000, b'\x00\x01\x00\x00'),
               # It is the last plan before the second chunk, too.
               ('/av0/plan', TRAJECTORY, START + 4_990_000_000, recorder.joints(
                   4_900_000_000, ['x'], [1.0], [1.0], [1.0])[:70])]
    sound, odd = (ReplayBackend(record(tmp_path / name, messages)) for name, messages in (
        ('sound', own), ('odd', [*own, *strange])))
    try:
        for number in range(3):
            found, expected = (read_frames(backend.chunk(number)) for backend in (odd, sound))
            assert [head.tolist() for _, head, _ in found.states] \
                == [head.tolist() for _, head, _ in expected.states]
            assert len(found.objects) == len(expected.objects)
    finally:
        sound.close()
        odd.close()


def test_progress_is_told_when_it_takes_long(bag: Path) -> None:
    """With a clock of one second per read, every third read gives a line with the share done."""
    times = iter(range(1000))
    said: list[str] = []
    backend = open_replay(bag, said.append, lambda: float(next(times)))
    backend.close()
    assert said and all(line.startswith(f'reading {bag}: ') for line in said)
    quiet: list[str] = []
    open_replay(bag, quiet.append, lambda: 0.0).close()
    assert quiet == []


@pytest.mark.matrix
@pytest.mark.parametrize(('name', 'message'), [
    ('nowhere', 'no such file or folder'), ('text.mcap', 'no MCAP file'),
    ('empty', 'no recording in this folder')])
def test_what_is_no_recording(tmp_path: Path, name: str, message: str) -> None:
    """The command prints one line, exits with code 2 and starts nothing."""
    (tmp_path / 'text.mcap').write_text('hello')
    (tmp_path / 'empty').mkdir()
    done = subprocess.run(
        [sys.executable, '-m', 'crgame_ros.launcher.main', '--replay', str(tmp_path / name)],
        capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stdout == ''
    assert message in done.stderr and len(done.stderr.splitlines()) == 1


def test_replay_goes_with_no_game() -> None:
    """Options that a replay would ignore are refused."""
    done = subprocess.run([sys.executable, '-m', 'crgame_ros.launcher.main', '--replay', 'bag',
                           '--duration', '3'], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr.startswith('error: --replay: shows a recording')


@pytest.mark.matrix
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM], ids=['int', 'term'])
def test_command_serves_until_it_is_told_to_stop(bag: Path, tmp_path: Path,
                                                 number: signal.Signals) -> None:
    """A run's folder is enough; the command prints a working address and ends with 0."""
    (tmp_path / 'run').mkdir()
    (tmp_path / 'run' / 'bag').symlink_to(bag)
    process = subprocess.Popen(
        [sys.executable, '-m', 'crgame_ros.launcher.main', '--replay', str(tmp_path / 'run'),
         '--port', '18466'], stdout=subprocess.PIPE, text=True, env=os.environ)
    try:
        assert process.stdout is not None
        # On a busy machine its progress comes first.
        address = next(word for line in process.stdout for word in line.split()
                       if word.startswith('http://'))
        with urlopen(f'{address}api/replay/info', timeout=30) as answer:
            assert json.load(answer)['chunks'] == 3
        process.send_signal(number)
        assert process.wait(20) == 0
    finally:
        process.kill()
        process.wait()


def test_requests(bag: Path) -> None:
    """A missing resource gives 404; a page cannot control a recording."""
    async def ask() -> None:
        access = Access('127.0.0.1', 0)
        runner, port = await listen(create_app(ReplayBackend(bag), access, None), '127.0.0.1', 0)
        base = f'http://127.0.0.1:{port}'
        try:
            async with aiohttp.ClientSession() as session:
                for query in ('i=3', 'i=-1', 'i=', 'i=x', 'i=1e0', 'i=%C2%B2', f'i={10**30}',
                              'j=0', 'i=0&epoch=1', 'i=0&epoch=x'):
                    async with session.get(f'{base}/api/replay/chunk?{query}') as answer:
                        assert answer.status == 404, query
                        assert 'error' in await answer.json()
                async with session.get(f'{base}/api/replay/info?epoch=9') as answer:
                    assert answer.status == 404
                async with session.get(f'{base}/api/replay/chunk?i=2&epoch=0') as answer:
                    frames = read_frames(await answer.read())
                    assert frames.states[-1][1][2] == STEPS
                async with session.ws_connect(f'{base}/ws') as socket:
                    assert (await socket.receive_json())['mode'] == 'replay'
                    scene = await socket.receive_json()
                    assert (scene['type'], scene['benchmark_id']) == (
                        'scene', 'ZAM_ParkedCars-1_1_T-1')
                    await socket.send_json({'type': 'control', 'action': 'reset', 'id': 4})
                    reply = await socket.receive_json()
                    assert (reply['to'], reply['ok']) == (4, False)
                    assert 'recording' in reply['text']
        finally:
            await runner.cleanup()

    asyncio.run(ask())


def test_recording_without_states(tmp_path: Path, parked: OfflineResult) -> None:
    """Such a recording is refused, and the message says what is missing."""
    folder = record(tmp_path / 'bag', [m for m in recorder.messages(parked)
                                       if m[0] != '/vehicles/state'])
    with pytest.raises(InputError, match='no state of the run is in it'):
        ReplayBackend(folder)
