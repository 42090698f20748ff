# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exported and converted motion through stalls: differences of positions are the speeds."""

from collections.abc import Callable, Sequence
from dataclasses import replace
import math
from pathlib import Path
from typing import Any

from commonroad.common.reader.file_reader_xml import XMLFileReader
from crgame_ros.driver.source import ReplayDriver
from crgame_ros.game.game import AvSpec, Game, HumanSpec, LaneletSpawn, load_game, TimingSpec
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.conversion import convert
from crgame_ros.recording.export import write_scenario
from crgame_ros.recording.resampling import lost_intervals, resample
from crgame_ros.recording.run_trajectories import RunTrajectories, trajectories_of
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.timing.cycle_rows import CycleTable, TIMING_COLUMNS
from crgame_ros.timing.time_controller import TimeController
import numpy as np
from numpy.typing import NDArray
import pytest

MS = 1_000_000
DT = 0.01
# By how much differences of positions may differ from speeds [m/s].
AGREES = 0.1
ROLLING = HumanSpec('hv0', 'idle', spawn=LaneletSpawn(13, 100.0, 0.0, 25.0))


def intervals_through(stalls_ms: dict[int, int], steps: int, **timing: Any) -> NDArray[np.float64]:
    """Return Delta t_eff of a loop that works 1 ms a cycle and stalls before some."""
    controller = TimeController(TimingSpec(**timing), DT)
    controller.start(0)
    now_ns, found = 0, []
    for n in range(1, steps + 1):
        now_ns = max(now_ns + MS, controller.deadline_ns()) + stalls_ms.get(n, 0) * MS
        found.append(controller.begin_cycle(now_ns).dt_eff_s)
    return np.array(found)


def drive(intervals_s: Any, commands: Sequence[float] = (0.3, 0.0, 0.02, 0.0),
          steps: int = 300) -> OfflineResult:
    """Drive a human on the motorway at 25 m/s with the pedal held, turning gently."""
    loaded = load_game(scenarios_directory() / 'cut_in.yaml').scenario
    game = Game(loaded, humans=(ROLLING,), avs=(AvSpec('av0', 'constant-velocity'),))
    return run_offline(
        build_setup(game), duration_s=steps * DT, intervals_s=intervals_s,
        drivers={'hv0': ReplayDriver(np.tile(commands, (steps, 1)))}, check_drivability=False)


def disagreement(positions: NDArray[np.float64], speeds: NDArray[np.float64]) -> float:
    """Compare speeds over 0.1 s from positions (K, 2) and from the speeds (K) themselves [m/s]."""
    moved = np.hypot(*np.diff(positions, axis=0).T) / 0.1
    return float(np.abs(moved - 0.5 * (speeds[1:] + speeds[:-1])).max())


def of_log(log: RunTrajectories, column: int = 0) -> float:
    """Compare the rear axle's positions and speeds of a vehicle."""
    states = log.vehicle_states[:, column]
    return disagreement(states[:, :2], states[:, 3])


def of_file(path: Path, number: int) -> float:
    """Compare an obstacle's positions and speeds in a scenario file."""
    scenario, _ = XMLFileReader(str(path)).open()
    obstacle = scenario.obstacle_by_id(number)
    states = [obstacle.initial_state, *obstacle.prediction.trajectory.state_list]
    return disagreement(np.array([state.position for state in states]),
                        np.array([state.velocity for state in states]))


def test_a_stall_of_110_ms_leaves_no_trace_in_the_export(tmp_path: Path) -> None:
    """By its stamps the car drives at 35 m/s for a tick and at 15 later; the export has 25."""
    stalled = drive(intervals_through({150: 110}, 300))
    raw = stalled.states_of('hv0')[::10]
    assert disagreement(raw[:, :2], raw[:, 3]) > 9.0
    log = trajectories_of(stalled)
    assert log.notices == ()
    assert len(log.ks) == 31
    assert of_log(log) < 0.02
    _, exported = write_scenario(log, tmp_path)
    assert of_file(next(tmp_path.glob('*.xml')), exported.obstacle_ids['hv0']) < AGREES
    # The AV is stepped by n, so that its states are unchanged to the last bit.
    assert np.array_equal(log.vehicle_states[:, 1], stalled.states_of('av0')[::10])


def test_the_motion_is_the_one_without_the_stall(tmp_path: Path) -> None:
    """With a pedal held still the car is where it would have been, but for longer steps' error."""
    smooth = trajectories_of(drive(None)).vehicle_states[:, 0]
    stalled = drive(intervals_through({150: 110}, 300))
    assert np.array_equal(smooth, drive(None).states_of('hv0')[::10])
    raw = stalled.states_of('hv0')[::10]
    assert np.hypot(*(raw - smooth)[:, :2].T).max() > 1.0
    found = trajectories_of(stalled).vehicle_states[:, 0]
    assert np.hypot(*(found - smooth)[:, :2].T).max() < 0.02
    np.testing.assert_allclose(found[:, 3], smooth[:, 3], atol=0.02)


@pytest.mark.parametrize('seed', range(3))
def test_any_stalls(seed: int) -> None:
    """Stalls of 20 to 240 ms, now and then one while the last is being caught up."""
    random = np.random.default_rng(seed)
    stalls = {int(n): int(random.integers(20, 240)) for n in random.integers(60, 290, 9)}
    log = trajectories_of(drive(intervals_through(stalls, 300)))
    assert len(log.ks) >= 30
    assert of_log(log) < AGREES


def test_a_reset_drops_nothing_of_the_motion() -> None:
    """400 ms exceed the threshold: the schedule moves, and the sum of the intervals stays n dt."""
    log = trajectories_of(drive(intervals_through({150: 400}, 300)))
    assert len(log.ks) == 31
    assert of_log(log) < AGREES


def test_what_the_paper_drops_is_missing_at_the_end() -> None:
    """`clip: drop` loses 150 of 200 ms: the last tick or two are before what the human drove."""
    log = trajectories_of(drive(intervals_through({150: 200}, 300, clip='drop')))
    assert of_log(log) < AGREES
    assert log.ks[-1] == 28
    assert len(log.object_poses) == len(log.ks)
    assert len(log.notices) == 1 and log.notices[0].startswith('2 scenario steps at the end')


def test_conversion_resamples_by_the_recorded_intervals(tmp_path: Path, recorder: Any) -> None:
    """The file made of a recording agrees with itself, and with the export of the run."""
    intervals_s = intervals_through({55: 110, 150: 60, 156: 110}, 300)
    result = drive(intervals_s)
    messages = recorder.messages(result, offset_ns=5_000_000_000, intervals_s=intervals_s)
    made, report = convert(recorder.ours(tmp_path / 'bag', messages))
    assert report.notices == ()
    assert of_file(made, report.obstacle_ids['hv0']) < AGREES
    (tmp_path / 'export').mkdir()
    write_scenario(trajectories_of(result), tmp_path / 'export')
    exported, _ = XMLFileReader(str(next((tmp_path / 'export').glob('*.xml')))).open()
    converted, _ = XMLFileReader(str(made)).open()
    number = report.obstacle_ids['hv0']
    for step in range(31):
        places = [scenario.obstacle_by_id(number).state_at_time(step).position
                  for scenario in (exported, converted)]
        assert math.dist(*places) < 1e-6


@pytest.mark.parametrize(('lost', 'notice'), [
    (lambda topic, n: topic == '/timing/cycle', 'no /timing/cycle in it'),
    (lambda topic, n: topic == '/timing/cycle' and 200 < n <= 205, '5 cycles were not recorded')])
def test_missing_intervals_are_told(tmp_path: Path, recorder: Any, notice: str,
                                    lost: Callable[[str, int], bool]) -> None:
    """Without its intervals motion can't be resampled; the conversion reports it."""
    result = drive(intervals_through({}, 300))
    messages = recorder.messages(result)
    counts: dict[str, int] = {}
    kept = []
    for message in messages:
        counts[message[0]] = counts.get(message[0], 0) + 1
        if not lost(message[0], counts[message[0]]):
            kept.append(message)
    _, report = convert(recorder.ours(tmp_path / 'bag', kept))
    assert len(report.notices) == 1 and notice in report.notices[0]
    assert report.time_steps == 31


def test_a_forged_cycle_is_no_longer_than_the_run() -> None:
    """Anybody may publish a row, of any n."""
    ns = np.array([-10.0 ** 12, *np.arange(1.0, 21.0), *np.arange(24.0, 31.0), 10.0 ** 12])
    rows = np.zeros((len(ns), len(TIMING_COLUMNS)))
    rows[:, TIMING_COLUMNS.index('n')] = ns
    rows[:, TIMING_COLUMNS.index('dt_eff_s')] = DT
    # The three lost intervals are 20 ms each.
    rows[ns > 20.0, TIMING_COLUMNS.index('cumulative_error_s')] = 0.03
    found = lost_intervals(CycleTable(TIMING_COLUMNS, rows), TimingSpec(), DT, 30)
    assert found is not None and found[21:24] == pytest.approx(0.02)
    assert len(found) == 31 and np.delete(found, [21, 22, 23]) == pytest.approx(DT)


def test_an_av_taken_over_moves_by_its_own_intervals() -> None:
    """Driven by hand through the stall it is resampled, too; on its plan it moves by n."""
    intervals_s = intervals_through({150: 110}, 300)
    game = load_game(scenarios_directory() / 'cut_in.yaml')
    setup = build_setup(replace(game, avs=(AvSpec('av0', 'constant-velocity'),)))
    held = np.tile((0.3, 0.0, 0.0, 0.0), (300, 1))
    held[:100] = held[220:] = np.nan
    result = run_offline(setup, duration_s=3.0, intervals_s=intervals_s,
                         drivers={'av0': ReplayDriver(held)}, check_drivability=False)
    raw = result.states_of('av0')[::10]
    assert disagreement(raw[:, :2], raw[:, 3]) > 5.0
    log = trajectories_of(result)
    assert of_log(log, 1) < AGREES
    assert np.array_equal(log.vehicle_states[:11, 1], raw[:11])


def test_circle_between_states_that_are_far_apart() -> None:
    """
    A quarter second between states at 20 m/s on R = 50 m: the cubic is off by micrometres.

    Its error is v^4 / R^3 h^4 / 384 = 0.01 mm.
    """
    times_s = np.array([0.0, 0.25, 0.5, 0.75])
    angle = 20.0 * times_s / 50.0
    states = np.zeros((4, 1, 8))
    states[:, 0, 0], states[:, 0, 1] = 50.0 * np.sin(angle), 50.0 - 50.0 * np.cos(angle)
    states[:, 0, 2], states[:, 0, 3], states[:, 0, 6] = angle, 20.0, 0.4
    intervals_s = np.full((4, 1), 0.25)
    found = resample(states, np.arange(4), intervals_s, 0.05, np.arange(16))[:, 0]
    way = 20.0 * 0.05 * np.arange(16) / 50.0
    np.testing.assert_allclose(found[:, 0], 50.0 * np.sin(way), atol=2e-5)
    np.testing.assert_allclose(found[:, 1], 50.0 - 50.0 * np.cos(way), atol=2e-5)
    np.testing.assert_allclose(found[:, 2], way, atol=1e-12)
    # One step beyond the last state it goes on straight; later states are unknown.
    beyond = resample(states, np.arange(4), intervals_s, 0.05, np.array([16, 17]))[:, 0]
    assert math.dist(beyond[0, :2], found[15, :2]) == pytest.approx(1.0)
    assert np.isnan(beyond[1]).all()
