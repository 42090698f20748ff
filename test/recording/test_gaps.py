# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of a busy recorder: gaps are bridged or cut the run, and are reported."""

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any, NamedTuple

from commonroad.common.reader.file_reader_xml import XMLFileReader
from crgame_ros.game.game import AvSpec
from crgame_ros.recording.finish import finish_run, OK
from crgame_ros.recording.resampling import bridge_objects, LONGEST_GAP_S
from crgame_ros.recording.run_trajectories import (
    read_trajectories,
    RunTrajectories,
    trajectories_of,
)
from crgame_ros.simulation.offline import OfflineResult
import numpy as np
import pytest

Message = tuple[str, str, int, bytes]
TRAFFIC = 'ZAM_Traffic-1_1_T-1.xml'
START_NS = 1_700_000_000_000_000_000
STATES, TICK_STATES, OBJECTS, CYCLES = (
    '/vehicles/state', '/vehicles/tick_state', '/traffic/objects', '/timing/cycle')
# The stall, and from 2 s later the catching up: the human is 0.2 s ahead in between.
STALL_N, STALL_S = 700, 0.2


class Whole(NamedTuple):
    """A run of 20 s, its messages as of `ros2 bag record -a`, and their contents."""

    result: OfflineResult
    messages: list[Message]
    log: RunTrajectories


@pytest.fixture(scope='module')
def whole(recorder: Any, drive: Callable[..., OfflineResult]) -> Whole:
    """Drive for 20 s at uneven intervals, with a stall of 0.2 s that is caught up with."""
    intervals_s = np.random.default_rng(5).uniform(0.008, 0.012, 2000)
    intervals_s[STALL_N:STALL_N + 5] = 0.01 + STALL_S / 5
    intervals_s[STALL_N + 200:STALL_N + 400] -= STALL_S / 200
    intervals_s += 0.01 - intervals_s.mean()
    result = drive(TRAFFIC, duration_s=20.0, intervals_s=intervals_s,
                   avs=(AvSpec('av0', 'constant-velocity'),))
    messages = recorder.messages(result, offset_ns=3_000_000_000, intervals_s=intervals_s,
                                 tick_states=True)
    return Whole(result, messages, trajectories_of(result))


def _time_s(message: Message) -> float:
    return (message[2] - START_NS) * 1e-9


def _worst_m(log: RunTrajectories, whole: RunTrajectories) -> tuple[float, float]:
    """Return the largest distances of vehicles and objects from the whole run's."""
    rows = log.ks - whole.ks[0]
    vehicles = log.vehicle_states[:, :, :2] - whole.vehicle_states[rows, :, :2]
    objects = log.object_poses[:, :, :2] - whole.object_poses[rows, :, :2]
    assert np.isnan(objects).sum() == np.isnan(whole.object_poses[rows, :, :2]).sum()
    return (float(np.hypot(*np.moveaxis(vehicles, 2, 0)).max()),
            float(np.nanmax(np.hypot(*np.moveaxis(objects, 2, 0)))))


@pytest.mark.parametrize('seed', range(3))
def test_one_percent_of_all_messages_is_missing(tmp_path: Path, recorder: Any, whole: Whole,
                                                seed: int) -> None:
    """Every step is there, and within a millimetre: 8 m/s^2 over 10 ms are 0.8 mm."""
    kept = np.random.default_rng(seed).random(len(whole.messages)) > 0.01
    messages = [message for message, keep in zip(whole.messages, kept, strict=True)
                if keep or message[0].startswith('/scenario/')]
    log = read_trajectories(recorder.ours(tmp_path / 'bag', messages))
    np.testing.assert_array_equal(log.ks, np.arange(201))
    vehicles_m, objects_m = _worst_m(log, whole.log)
    assert vehicles_m < 1e-3
    # Recorded cars brake with up to 8 m/s^2 from one tick to the next: over 0.1 s.
    assert objects_m < 0.08
    assert any('cycles were not recorded: their intervals are those that the lag' in notice
               for notice in log.notices)
    assert all('\n' not in notice and len(notice) < 250 for notice in log.notices)


@pytest.mark.parametrize('topic', [STATES, OBJECTS, CYCLES, TICK_STATES])
def test_single_ticks_of_a_topic_are_missing(tmp_path: Path, recorder: Any, whole: Whole,
                                             topic: str) -> None:
    """Ticks 23, 100 and 199 of each topic in turn; states are those of the other topic."""
    lost = {START_NS + 1_000_000 + k * 100_000_000 for k in (23, 100, 199)}
    messages = [m for m in whole.messages if m[0] != topic or m[2] not in lost]
    assert len(whole.messages) - len(messages) == 3
    log = read_trajectories(recorder.ours(tmp_path / 'bag', messages))
    np.testing.assert_array_equal(log.ks, np.arange(201))
    vehicles_m, objects_m = _worst_m(log, whole.log)
    # States that another topic holds to the last bit differ by roundings only.
    assert vehicles_m < 1e-9
    assert objects_m < (0.08 if topic == OBJECTS else 1e-12)
    assert len(log.notices) == (0 if topic == TICK_STATES else 1)
    if topic == STATES:
        assert log.notices == ('3 scenario steps of /vehicles/state are those of '
                               '/vehicles/tick_state',)


@pytest.mark.parametrize('at_s', [4.03, 6.9])
def test_a_third_of_a_second_of_everything_is_missing(tmp_path: Path, recorder: Any,
                                                      whole: Whole, at_s: float) -> None:
    """It is bridged, also with a stall in it: the lag of the cycles after it shows the stall."""
    messages = [m for m in whole.messages if not at_s <= _time_s(m) < at_s + 0.3]
    log = read_trajectories(recorder.ours(tmp_path / 'bag', messages))
    np.testing.assert_array_equal(log.ks, np.arange(201))
    vehicles_m, objects_m = _worst_m(log, whole.log)
    # A cubic between states that are T apart misses a change of acceleration a by a T^2 / 32 at
    # most; the human's command is another one every 10 ms, so that little is left on average.
    assert vehicles_m < 8.0 * 0.5**2 / 32
    assert objects_m < 8.0 * 0.4**2 / 32 + 0.08
    assert sum('interpolated between states' in notice for notice in log.notices) == 2
    # All else is unchanged.
    rows = (np.arange(201) * 0.1 < at_s) | (np.arange(201) * 0.1 > at_s + 0.6)
    np.testing.assert_allclose(log.vehicle_states[rows, :, :3],
                               whole.log.vehicle_states[rows, :, :3], atol=1e-6)


def test_five_seconds_of_everything_are_missing(tmp_path: Path, recorder: Any,
                                                whole: Whole) -> None:
    """The longest piece becomes the scenario; one line says so, and timing.json agrees."""
    messages = [m for m in whole.messages if not 3.0 <= _time_s(m) < 8.0]
    folder = recorder.ours(tmp_path / 'bag', messages)
    log = read_trajectories(folder)
    # At 8 s the human is where it should be at 8.2 s.
    np.testing.assert_array_equal(log.ks, np.arange(82, 201))
    assert any(notice.startswith('2 scenario steps at the start are left out')
               for notice in log.notices)
    assert max(_worst_m(log, whole.log)) < 1e-6
    told = [notice for notice in log.notices if 'longest piece' in notice]
    assert told == [
        'nothing was recorded of /traffic/objects for 5.1 s after scenario step 29, of '
        '/vehicles/state for 5.0 s after scenario step 29, and up to 1 s are bridged: the run is '
        'its longest piece, scenario steps 80 to 200 of 0 to 200']
    said: list[str] = []
    assert finish_run(tmp_path, said.append) == OK
    report = json.loads((tmp_path / 'timing.json').read_text())
    assert report['scenario_steps'] == {'first': 82, 'last': 200}
    assert report['gaps'] == 500
    assert told[0] in report['notices']
    scenario, _ = XMLFileReader((tmp_path / 'C-ZAM_Traffic-1_1_T-1.xml').read_bytes()).open()
    assert max(obstacle.prediction.final_time_step
               for obstacle in scenario.dynamic_obstacles) == 200 - 82


def test_gaps_longer_than_the_limit_are_never_bridged(tmp_path: Path, recorder: Any,
                                                      whole: Whole) -> None:
    """Just under it all steps are there, just over it they are not."""
    counts = []
    for length_s in (LONGEST_GAP_S - 0.02, LONGEST_GAP_S + 0.22):
        messages = [m for m in whole.messages if not 12.005 <= _time_s(m) < 12.005 + length_s]
        counts.append(len(read_trajectories(recorder.ours(
            tmp_path / f'{length_s:.2f}', messages)).ks))
    assert counts == [201, 121]


def test_documents_that_come_late(tmp_path: Path, recorder: Any, whole: Whole) -> None:
    """Discovered after ten seconds, they hold for the run from its first step on."""
    late = [(*m[:2], m[2] + 10_000_000_000, m[3]) if m[0].startswith('/scenario/') else m
            for m in whole.messages]
    log = read_trajectories(recorder.ours(tmp_path / 'bag', sorted(late, key=lambda m: m[2])))
    np.testing.assert_array_equal(log.ks, np.arange(201))
    assert max(_worst_m(log, whole.log)) < 1e-9 and log.notices == ()


def test_a_recording_that_begins_in_the_middle_of_a_stall(tmp_path: Path, recorder: Any,
                                                          whole: Whole) -> None:
    """The lag of the first cycle determines the human's own time."""
    messages = [m for m in whole.messages
                if _time_s(m) > 8.0 or m[0].startswith('/scenario/')]
    log = read_trajectories(recorder.ours(tmp_path / 'bag', messages))
    assert log.ks[0] == 82 and log.ks[-1] == 200
    assert max(_worst_m(log, whole.log)) < 1e-6
    assert 'the recording begins at scenario step 80 of a run that began at 0' in log.notices


def test_the_states_of_a_run_whose_game_is_missing_are_not_those_of_the_run_before(
        tmp_path: Path, recorder: Any, drive: Callable[..., OfflineResult]) -> None:
    """The cycles show that there was another run."""
    first, second = drive(TRAFFIC, duration_s=1.0), drive(TRAFFIC, duration_s=2.0, seed=2)
    messages = recorder.messages(first)
    messages += [m for m in recorder.messages(second, epoch=1, offset_ns=1_500_000_000,
                                              log_ns=START_NS + 1_500_000_000)
                 if m[0] != '/scenario/game']
    log = read_trajectories(recorder.ours(tmp_path / 'bag', messages))
    np.testing.assert_array_equal(log.ks, np.arange(11))
    assert any('is of another run, whose /scenario/game was not recorded' in notice
               for notice in log.notices)


def test_objects_that_are_not_the_same_at_both_ends_of_a_gap_are_absent_in_it() -> None:
    """One drives on, one appears, one is another of the same name 80 m farther on."""
    def point(*objects: tuple[float, float, float]) -> Any:
        """Return objects by x, speed and yaw rate (NaN where absent)."""
        rows = [[value for x, _, _ in objects for value in (x, 0.0 * x, 0.0 * x)],
                [value for _, speed, rate in objects for value in (speed, 0.0 * speed, rate)]]
        return np.array([*rows, rows[1]])

    nan = np.nan
    points = {0: point((0.0, 10.0, 0.0), (nan, nan, nan), (0.0, 10.0, 0.0)),
              50: point((5.0, 10.0, 0.0), (3.0, 1.0, 0.0), (80.0, 10.0, 0.0))}
    found = bridge_objects(np.array([0, 10, 40, 50]), points, 0.01, 9)
    np.testing.assert_allclose(found[:, 0, 0], [0.0, 1.0, 4.0, 5.0], atol=1e-12)
    np.testing.assert_allclose(found[:, 1, 0], 10.0)
    assert np.isnan(found[1:3, :, 3:]).all()
    assert found[3, 0, 3] == 3.0 and found[3, 0, 6] == 80.0
