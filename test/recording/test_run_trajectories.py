# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs read back from recordings: every storage, several runs, gaps, cuts, and exact replay."""

from collections.abc import Callable
import os
from pathlib import Path
from typing import Any

from crgame_ros.driver.source import ReplayDriver
from crgame_ros.errors import InputError
from crgame_ros.game.game import AvSpec
from crgame_ros.recording.run_cycles import read_cycles, replay_inputs
from crgame_ros.recording.run_trajectories import (
    read_trajectories,
    RunTrajectories,
    trajectories_of,
)
from crgame_ros.simulation.offline import OfflineResult, run_offline
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

Drive = Callable[..., OfflineResult]
PARKED, TRAFFIC, CUT_IN = ('ZAM_ParkedCars-1_1_T-1.xml', 'ZAM_Traffic-1_1_T-1.xml',
                           'ZAM_CutIn-1_1_T-1.xml')
# Joint velocities hold speed times cos and sin of the heading: a few roundings each.
ROUNDING = 1e-12


def assert_same_run(read: RunTrajectories, expected: RunTrajectories) -> None:
    """Compare the data that messages can hold; velocities of driven vehicles are rounded."""
    assert read.descriptions == expected.descriptions
    assert read.xml_text == expected.xml_text
    np.testing.assert_array_equal(read.ks, expected.ks)
    np.testing.assert_array_equal(read.object_poses, expected.object_poses)
    np.testing.assert_array_equal(read.object_velocities, expected.object_velocities)
    np.testing.assert_array_equal(read.vehicle_states[:, :, (0, 1, 2, 4, 6, 7)],
                                  expected.vehicle_states[:, :, (0, 1, 2, 4, 6, 7)])
    np.testing.assert_allclose(read.vehicle_states, expected.vehicle_states, atol=ROUNDING,
                               rtol=ROUNDING)


def test_offline_run_is_sampled_at_the_ticks(drive: Drive) -> None:
    """N = 10: states 0, 10, 20, …; the objects are those of the scenario at each k."""
    result = drive(PARKED, avs=(AvSpec('av0', 'constant-velocity'),))
    log = trajectories_of(result)
    np.testing.assert_array_equal(log.ks, np.arange(11))
    np.testing.assert_array_equal(log.vehicle_states, result.vehicle_states[::10])
    assert [item.id for item in log.vehicles] == ['hv0', 'av0']
    obstacles = result.setup.obstacles
    assert len(log.objects) == len(obstacles.ids) == 17
    for k in log.ks.tolist():
        np.testing.assert_array_equal(log.object_poses[k], obstacles.states_at(k).poses)
        np.testing.assert_array_equal(log.object_velocities[k], obstacles.states_at(k).velocities)
    assert log.notices == ()


@pytest.mark.parametrize('kind', ['ours', 'mcap', 'sqlite3'])
@pytest.mark.parametrize('name', [PARKED, CUT_IN])
def test_recording_holds_the_run(tmp_path: Path, recorder: Any, drive: Drive, kind: str,
                                 name: str) -> None:
    """Each storage gives back the run that was recorded, with and without objects in it."""
    result = drive(name, avs=(AvSpec('av0', 'constant-velocity'),))
    messages = recorder.messages(result, offset_ns=7_000_000_123)
    folder = recorder.ours(tmp_path / 'bag', messages) if kind == 'ours' else recorder.rosbag2(
        tmp_path / 'bag', messages, StoragePlugin[kind.upper()])
    log = read_trajectories(folder)
    assert log.notices == ()
    assert log.game.scheduler.clock_offset_ns == 7_000_000_123
    assert_same_run(log, trajectories_of(result))


def test_joints_are_taken_by_name(tmp_path: Path, recorder: Any, samples: Any,
                                  drive: Drive) -> None:
    """The order of the joints in a message has no meaning."""
    result = drive(CUT_IN, duration_s=0.1, avs=(AvSpec('av0', 'constant-velocity'),))
    messages = recorder.messages(result)
    for index, (topic, type_name, log_ns, data) in enumerate(messages):
        if topic == '/vehicles/state':
            message = samples.store.deserialize_cdr(data, type_name)
            point = message.points[0]
            messages[index] = (topic, type_name, log_ns, recorder.joints(
                int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec),
                message.joint_names[::-1], point.positions[::-1], point.velocities[::-1],
                point.accelerations[::-1]))
    assert_same_run(read_trajectories(recorder.ours(tmp_path / 'bag', messages)),
                    trajectories_of(result))


def test_each_run_of_a_recording_can_be_chosen(tmp_path: Path, recorder: Any,
                                               drive: Drive) -> None:
    """Two runs between resets: clock offsets tell them apart, and the last is the default."""
    first, second = drive(CUT_IN, seed=1), drive(TRAFFIC, duration_s=0.5, seed=2)
    start = 1_700_000_000_000_000_000
    messages = recorder.messages(first, epoch=0, log_ns=start)
    messages += recorder.messages(second, epoch=1, offset_ns=5_000_000_000,
                                  log_ns=start + 5_000_000_000)
    folder = recorder.ours(tmp_path / 'bag', messages)
    assert_same_run(read_trajectories(folder, 0), trajectories_of(first))
    assert_same_run(read_trajectories(folder, 1), trajectories_of(second))
    assert_same_run(read_trajectories(folder), trajectories_of(second))
    np.testing.assert_array_equal(read_cycles(folder, 0).column('n'), np.arange(1, 101))
    np.testing.assert_array_equal(replay_inputs(folder).commands['hv0'],
                                  second.commands[1:, 0])
    for read in (read_trajectories, read_cycles):
        with pytest.raises(InputError, match='epoch 2 in it; it has 0, 1'):
            read(folder, 2)


def test_simulation_that_was_restarted(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """Epoch and clock begin anew; the messages after the restart count."""
    first, second = drive(CUT_IN, seed=1), drive(CUT_IN, duration_s=0.5, seed=2)
    start = 1_700_000_000_000_000_000
    messages = recorder.messages(first, log_ns=start)
    for message in recorder.messages(second, log_ns=start + 9_000_000_000):
        # The game is the same text: mark it as another one by a later wall-clock entry.
        messages.append(message if message[0] != '/scenario/game' else (
            *message[:3], recorder.messages(second, offset_ns=0)[2][3].replace(
                b'"real_time_factor": 1.0', b'"real_time_factor": 1.5')))
    folder = recorder.ours(tmp_path / 'bag', messages)
    assert_same_run(read_trajectories(folder), trajectories_of(second))
    np.testing.assert_array_equal(replay_inputs(folder).commands['hv0'], second.commands[1:, 0])


def test_a_few_cycles_of_the_next_round_are_no_run(tmp_path: Path, recorder: Any,
                                                   drive: Drive) -> None:
    """When a recording was played once more, its first cycles arrived late."""
    messages = recorder.messages(drive(CUT_IN, duration_s=0.5))
    first = [(*m[:2], m[2] + 1_000_000_000, m[3]) for m in messages if m[0] == '/timing/cycle'][:4]
    folder = recorder.ours(tmp_path / 'bag', [*messages, *first])
    np.testing.assert_array_equal(read_cycles(folder).column('n'), np.arange(1, 51))


@pytest.mark.parametrize(('topic', 'lost', 'ks', 'notice'), [
    ('/vehicles/state', range(3, 5), range(11), '2 scenario steps of /vehicles/state were not '
     'recorded (3, 4): interpolated between states that are at most 0.02 s apart'),
    ('/traffic/objects', range(3, 4), range(11), '1 scenario steps of /traffic/objects were not '
     'recorded (3): interpolated between states that are at most 0.20 s apart'),
    ('/vehicles/state', range(1), range(11), '1 scenario steps of /vehicles/state are those of '
     '/scenario/game'),
    ('/traffic/objects', range(4), range(4, 11), 'the recording begins at scenario step 4 of a '
     'run that began at 0'),
    ('/traffic/objects', range(10, 11), range(10), '')])
def test_missing_steps(tmp_path: Path, recorder: Any, drive: Drive, topic: str, lost: range,
                       ks: range, notice: str) -> None:
    """Other states stand in for a few, and the notice says which and how."""
    result = drive(PARKED)
    stamps = {k * 100_000_000 + 1_700_000_000_001_000_000 for k in lost}
    messages = [m for m in recorder.messages(result) if m[0] != topic or m[2] not in stamps]
    log = read_trajectories(recorder.ours(tmp_path / 'bag', messages))
    np.testing.assert_array_equal(log.ks, ks)
    # Parked objects stand still; between states 20 ms apart a vehicle that brakes or steers anew
    # every 10 ms, with up to 8 m/s^2, is within 8 * 0.01^2 m.
    np.testing.assert_allclose(log.vehicle_states[:, :, :3],
                               result.vehicle_states[::10][ks.start:ks.stop, :, :3], atol=8e-4)
    np.testing.assert_allclose(
        log.object_poses, result.object_poses[ks.start:ks.stop].reshape(log.object_poses.shape),
        atol=1e-12)
    assert log.notices == ((notice,) if notice else ())


def test_states_between_the_ticks_may_be_lost(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """Only the states at the ticks are used."""
    result = drive(CUT_IN, duration_s=0.3)
    messages = [m for m in recorder.messages(result)
                if m[0] != '/vehicles/state' or (m[2] - 1_000_000) % 100_000_000 == 0]
    assert_same_run(read_trajectories(recorder.ours(tmp_path / 'bag', messages)),
                    trajectories_of(result))


def test_recording_that_was_cut_off(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """The whole part of a killed recorder's file is read, and a notice says it is unfinished."""
    result = drive(TRAFFIC)
    folder = recorder.ours(tmp_path / 'bag', recorder.messages(result))
    (folder / 'metadata.yaml').unlink()
    file = folder / 'bag_0.mcap'
    os.truncate(file, file.stat().st_size * 13 // 20)
    log = read_trajectories(folder)
    whole = trajectories_of(result)
    assert 2 < len(log.ks) < 11
    np.testing.assert_array_equal(log.vehicle_states[:, :, :3],
                                  whole.vehicle_states[:len(log.ks), :, :3])
    assert 'was not finished' in log.notices[0]
    rows = read_cycles(folder).rows
    np.testing.assert_array_equal(rows, recorder.rows[:len(rows)])
    assert len(rows) // 10 in (len(log.ks) - 1, len(log.ks) - 2)


@pytest.mark.parametrize(('missing', 'message'), [
    ('/scenario/xml', 'no /scenario/xml in it'), ('/scenario/game', 'no /scenario/game in it'),
    ('/scenario/objects', 'no /scenario/objects in it'),
    ('/vehicles/state', 'no /vehicles/state in it'),
    ('/traffic/objects', 'no /traffic/objects in it')])
def test_recording_that_lacks_a_topic(tmp_path: Path, recorder: Any, drive: Drive, missing: str,
                                      message: str) -> None:
    """One line that names the topic and the recording."""
    messages = [m for m in recorder.messages(drive(TRAFFIC, duration_s=0.1)) if m[0] != missing]
    folder = recorder.ours(tmp_path / 'bag', messages)
    with pytest.raises(InputError) as caught:
        read_trajectories(folder)
    assert message in str(caught.value) and str(folder) in str(caught.value)
    assert caught.value.remedy


def test_recordings_that_do_not_fit_together(tmp_path: Path, recorder: Any, samples: Any,
                                             drive: Drive) -> None:
    """A scenario of another run, joints of other vehicles, and states from before the run."""
    messages = recorder.messages(drive(CUT_IN, duration_s=0.1))
    cases: dict[str, Callable[[Any], Any]] = {
        '/scenario/xml is that of another run': lambda m: (
            *m[:3], samples.string('<commonRoad/>')) if m[0] == '/scenario/xml' else m,
        '/scenario/objects is that of another run': lambda m: (
            *m[:3], samples.string('[]')) if m[0] == '/scenario/objects' else m,
        '/vehicles/state: does not name the joint hv0/x': lambda m: (
            *m[:3], m[3].replace(b'hv0/', b'hv7/')) if m[0] == '/vehicles/state' else m,
        'no scenario step of the run is in it': lambda m: (
            *m[:3], recorder.joints(1, ['hv0/x'], [0.0], [0.0], [0.0])
        ) if m[0] == '/vehicles/state' else m,
        '/vehicles/state: a point does not give every joint': lambda m: (
            *m[:3], recorder.joints(0, [f'hv0/{j}' for j in ('x', 'y', 'yaw', 'steering')],
                                    [0.0], [0.0], [0.0])) if m[0] == '/vehicles/state' else m}
    for number, (text, change) in enumerate(cases.items()):
        folder = recorder.ours(tmp_path / str(number), [change(m) for m in messages])
        with pytest.raises(InputError, match=text):
            read_trajectories(folder)


def test_recorded_human_is_reproduced_to_the_last_bit(tmp_path: Path, recorder: Any,
                                                      drive: Drive) -> None:
    """Commands and measured intervals from the recording give equal states at every step."""
    intervals = np.random.default_rng(3).uniform(0.004, 0.02, 150)
    result = drive(CUT_IN, duration_s=1.5, intervals_s=intervals,
                   avs=(AvSpec('av0', 'constant-velocity'),))
    folder = recorder.ours(tmp_path / 'bag', recorder.messages(result, intervals_s=intervals))
    inputs = replay_inputs(folder)
    np.testing.assert_array_equal(inputs.dt_eff_s, intervals)
    again = run_offline(result.setup, duration_s=1.5, intervals_s=inputs.dt_eff_s,
                        drivers={'hv0': ReplayDriver(inputs.commands['hv0'])})
    np.testing.assert_array_equal(again.states_of('hv0'), result.states_of('hv0'))
    assert again.state_hash == result.state_hash
    # Shifted by one cycle the commands would lead elsewhere.
    other = run_offline(result.setup, duration_s=1.5, intervals_s=inputs.dt_eff_s,
                        drivers={'hv0': ReplayDriver(inputs.commands['hv0'][1:])})
    assert other.state_hash != result.state_hash


def test_lights_that_an_av_shows_by_itself_are_no_input(tmp_path: Path, recorder: Any,
                                                        drive: Drive) -> None:
    """An AV has commands only if and while it was driven by hand."""
    result = drive(CUT_IN, duration_s=0.3, avs=(AvSpec('av0', 'constant-velocity'),))
    result.commands[:, 1, 4] = 2.0
    alone = replay_inputs(recorder.ours(tmp_path / 'alone', recorder.messages(result)))
    assert [*alone.commands] == ['hv0']
    result.commands[11:21, 1] = (0.5, 0.0, 0.1, 0.0, 1.0, 0.0)
    driven = replay_inputs(recorder.ours(tmp_path / 'driven', recorder.messages(result)))
    expected = np.full((30, 6), np.nan)
    expected[10:20] = result.commands[11:21, 1]
    np.testing.assert_array_equal(driven.commands['av0'], expected)


def test_replay_needs_every_cycle(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """A lost cycle, also the first, is named; the rest can still be read as a table."""
    messages = recorder.messages(drive(CUT_IN, duration_s=0.3))
    cycles = [index for index, m in enumerate(messages) if m[0] == '/timing/cycle']
    for lost in (1, 18):
        kept = [m for index, m in enumerate(messages) if index != cycles[lost - 1]]
        folder = recorder.ours(tmp_path / str(lost), kept)
        with pytest.raises(InputError, match=f'cycle n = {lost} was not recorded'):
            replay_inputs(folder)
        assert len(read_cycles(folder).rows) == 29
    with pytest.raises(InputError, match='no /timing/cycle in it'):
        read_cycles(recorder.ours(tmp_path / 'none', [
            m for m in messages if m[0] != '/timing/cycle']))
