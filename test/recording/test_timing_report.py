# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Timing reports of recordings whose cycles, plans and verdicts are known."""

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.game import AvSpec
from crgame_ros.recording.timing_report import timing_report, write_timing_report
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.timing.cycle_rows import TIMING_COLUMNS
import numpy as np
import pytest

Drive = Callable[..., OfflineResult]
Message = tuple[str, str, int, bytes]
CUT_IN, TWO_AVS = 'ZAM_CutIn-1_1_T-1.xml', 'C-ZAM_TwoAvs-1_1_T-1.xml'
START = 1_700_000_000_000_000_000
ARRAY, DIAGNOSTICS = 'std_msgs/msg/Float64MultiArray', 'diagnostic_msgs/msg/DiagnosticArray'
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
TABLE_1 = ['final_error_ms', 'mean_step_error_ms', 'max_cumulative_error_ms', 'timeout_ratio',
           'real_time_ratio', 'time_efficiency', 'precision_ratio']


def documents(recorder: Any, result: OfflineResult, **options: Any) -> list[Message]:
    """Return the documents of a run."""
    found: list[Message] = recorder.messages(result, log_ns=START, **options)
    return [m for m in found if m[0].startswith('/scenario/')]


def cycles(recorder: Any, errors_s: dict[int, float], busy_s: dict[int, float], steps: int,
           epoch: int = 0) -> list[Message]:
    """Make cycles 1, 2, … that start late by the given errors, each in a message of its own."""
    messages = []
    for n in range(1, steps + 1):
        row = dict.fromkeys(TIMING_COLUMNS, 0.0) | {
            'epoch': epoch, 'n': n, 'k': n // 10, 'ideal_s': n * 0.01,
            'actual_s': n * 0.01 + errors_s.get(n, 0.0), 'busy_s': busy_s.get(n, 0.002),
            'dt_eff_s': 0.01}
        messages.append(('/timing/cycle', ARRAY, START + n * 10_000_000, recorder.cycle_rows(
            list(row), np.array([list(row.values())]))))
    return messages


def test_table_1(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """Twenty cycles of 10 ms, the 8th 4 ms late, the 20th 1 ms: every figure by hand."""
    messages = documents(recorder, drive(CUT_IN, duration_s=0.1))
    messages += cycles(recorder, {8: 0.004, 20: 0.001}, {8: 0.014, 11: 0.011}, 20)
    report = timing_report(recorder.ours(tmp_path / 'bag', messages))
    assert list(report)[:7] == TABLE_1
    assert list(report['real_time_ratio']) == ['final', 'mean', 'min']
    assert report['final_error_ms'] == pytest.approx(1.0)
    assert report['mean_step_error_ms'] == pytest.approx((4.0 + 4.0 + 1.0) / 19.0)
    assert report['max_cumulative_error_ms'] == pytest.approx(4.0)
    assert report['timeout_ratio'] == 2 / 20
    assert report['real_time_ratio']['final'] == pytest.approx(0.19 / 0.191)
    assert report['real_time_ratio']['min'] == pytest.approx(10.0 / 14.0)
    assert report['time_efficiency'] == report['real_time_ratio']['final']
    assert report['precision_ratio'] == pytest.approx(0.001 / 0.191)
    assert (report['cycles'], report['gaps'], report['epoch']) == (20, 0, 0)
    assert report['benchmark_id'] == 'ZAM_CutIn-1_1_T-1'
    assert report['planners'] == {}
    assert report['drivability'] == {'violations': 0, 'list': []}
    assert report['notices'] == []
    # These cycles are of a version without causes.
    assert report['late_steps'] is None


def test_lost_cycles_are_counted(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """Cycles that are missing, the first of the run among them, are gaps in n."""
    messages = documents(recorder, drive(CUT_IN, duration_s=0.1))
    rows = cycles(recorder, {}, {}, 30)
    report = timing_report(recorder.ours(tmp_path / 'bag', messages + rows[1:9] + rows[12:]))
    assert (report['cycles'], report['gaps']) == (26, 1 + 3)


def test_a_run_among_several(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """Cycles and messages of the other runs don't count."""
    result = drive(CUT_IN, duration_s=0.1, avs=(AvSpec('av0', 'constant-velocity'),))
    messages = documents(recorder, result, epoch=0)
    messages += cycles(recorder, {8: 0.004}, {}, 20, epoch=0)
    later = documents(recorder, result, epoch=1, offset_ns=5_000_000_000)
    messages += [(topic, kind, START + 5_000_000_000, data) for topic, kind, _, data in later]
    messages += [(topic, kind, log_ns + 5_000_000_000, data) for topic, kind, log_ns, data
                 in cycles(recorder, {3: 0.001}, {}, 30, epoch=1)]
    for stamp_ns, requests in ((200_000_000, 7), (5_200_000_000, 9)):
        messages.append(('/diagnostics', DIAGNOSTICS, START + stamp_ns, recorder.status(
            stamp_ns, 'sim_node: av0 plans', '', requests=requests)))
    folder = recorder.ours(tmp_path / 'bag', messages)
    first, last = timing_report(folder, 0), timing_report(folder)
    assert (first['cycles'], first['epoch'], last['cycles'], last['epoch']) == (20, 0, 30, 1)
    assert first['max_cumulative_error_ms'] == pytest.approx(4.0)
    assert last['max_cumulative_error_ms'] == pytest.approx(1.0)
    assert first['planners']['av0']['requests'] == 7
    assert last['planners']['av0']['requests'] == 9


def planner_messages(recorder: Any, latencies_ms: dict[int, float]) -> list[Message]:
    """Make requests of av0 at ticks and its plans so much later."""
    messages = []
    for tick, latency_ms in latencies_ms.items():
        stamp_ns = tick * 100_000_000
        series = recorder.joints(stamp_ns, ['av0/x'], [0.0], [0.0], [0.0])
        asked = START + stamp_ns
        messages += [('/av0/plan_request', TRAJECTORY, asked, series),
                     ('/av0/plan', TRAJECTORY, asked + round(latency_ms * 1e6), series)]
    return messages


def test_planners(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """Counts are the last reported ones; latencies are those of the recording itself."""
    result = drive(TWO_AVS, duration_s=0.1, avs=tuple(
        AvSpec(f'av{i}', 'constant-velocity') for i in range(2)))
    messages = documents(recorder, result) + cycles(recorder, {}, {}, 20)
    messages += planner_messages(recorder, {0: 300.0, 1: 5.0, 2: 4.0, 3: 40.0, 4: 3.0})
    series = recorder.joints(0, ['av0/x'], [0.0], [0.0], [0.0])
    # The first request was sent twice before it was answered; the second time counts.
    messages += [('/av0/plan_request', TRAJECTORY, START - 500_000_000, series),
                 ('/av0/plan', TRAJECTORY, START + 450_000_000,
                  recorder.joints(77, ['av0/x'], [0.0], [0.0], [0.0]))]
    counts = {'requests': 9, 'accepted': 6, 'refused': 1, 'skipped': 2, 'timed_out': 1,
              'realigned': 3, 'steps_without_plan': 12}
    for second, factor in ((1, 1), (2, 2)):
        stamp_ns = second * 1_000_000_000
        messages.append(('/diagnostics', DIAGNOSTICS, START + stamp_ns, recorder.status(
            stamp_ns, 'sim_node: av0 plans', 'following its plan', age_ms=20.0 * factor,
            worst_lane_error=0.1 * factor, lane_error=7.0,
            **{key: factor * value for key, value in counts.items()})))
    for plans, fallbacks, time_ms in ((1, 1, 8.0), (10, 1, 2.0), (17, 2, 3.0)):
        stamp_ns = plans * 100_000_000
        messages.append(('/diagnostics', DIAGNOSTICS, START + stamp_ns, recorder.status(
            stamp_ns, 'planner_node: av0',
            'planning' if plans == 10 else f'braking: {plans} m short', k=plans, plans=plans,
            fallbacks=fallbacks, plan_time_ms=f'{time_ms:.3f}')))
    # Another program's statuses by the same names.
    for text in ('x', 'nan', 'inf', '-1', '9' * 5000):
        messages += [('/diagnostics', DIAGNOSTICS, START + 90_000_000, recorder.status(
            90_000_000, name, '', **{value: text})) for name, value in (
                ('planner_node: av0', 'plan_time_ms'), ('sim_node: av0 plans', 'age_ms'),
                ('sim_node: av1 plans', 'worst_lane_error'), ('planner_node: av1', 'plans'))]
    report = timing_report(recorder.ours(
        tmp_path / 'bag', sorted(messages, key=lambda message: message[2])))
    av0 = report['planners']['av0']
    assert {key: av0[key] for key in counts} == {key: 2 * n for key, n in counts.items()}
    assert (av0['plans'], av0['fallback']) == (17, 2)
    # numpy's quantiles of 3, 4, 5, 40: (4 + 5) / 2 and 5 + 0.97 * 35.
    assert av0['latency_ms'] == pytest.approx({'p50': 4.5, 'p99': 38.95, 'max': 40.0})
    assert av0['plan_time_ms'] == pytest.approx({'p50': 3.0, 'p99': 7.9, 'max': 8.0})
    # The run waits for the first plan: the planner's time to start is reported separately.
    assert av0['first_latency_ms'] == pytest.approx(300.0)
    # Numbers differ from fallback to fallback, reasons do not.
    assert av0['fallback_reasons'] == {'1 m short': 2}
    assert av0['age_ms'] == pytest.approx({'p50': 30.0, 'p99': 39.8, 'max': 40.0})
    assert av0['worst_tracking_errors'] == {'lane': 0.2}
    silent = report['planners']['av1']
    assert silent == dict.fromkeys(av0) | {'plans': 0}


def test_violations_begin_once(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """Heartbeats repeat a violation that lasts; one that returns, or another, is a new one."""
    messages = documents(recorder, drive(CUT_IN, duration_s=0.1))
    messages += cycles(recorder, {}, {}, 20)
    for n, level, text in ((5, 0, 'valid'), (12, 2, 'collision with o1'),
                           (30, 2, 'collision with o1'),
                           (31, 2, 'collision with o1; off the road'),
                           (40, 0, 'valid'), (50, 2, 'off the road')):
        stamp_ns = n * 10_000_000
        messages.append(('/hv0/drivability', DIAGNOSTICS, START + stamp_ns, recorder.status(
            stamp_ns, 'hv0/drivability', text, level, n=n)))
    report = timing_report(recorder.ours(tmp_path / 'bag', messages))
    assert report['drivability'] == {'violations': 3, 'list': [
        {'n': 12, 'vehicle': 'hv0', 'what': 'collision with o1'},
        {'n': 31, 'vehicle': 'hv0', 'what': 'off the road'},
        {'n': 50, 'vehicle': 'hv0', 'what': 'off the road'}]}


def test_file_and_recording_that_was_cut_off(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """The file is the report as JSON; for a killed recorder's bag it says so."""
    folder = recorder.ours(tmp_path / 'bag', recorder.messages(drive(CUT_IN, duration_s=2.0)))
    written = write_timing_report(folder, tmp_path / 'timing.json')
    assert json.loads((tmp_path / 'timing.json').read_text()) == written
    assert (written['cycles'], written['gaps'], written['final_error_ms']) == (200, 0, 0.0)
    (folder / 'metadata.yaml').unlink()
    file = folder / 'bag_0.mcap'
    content = file.read_bytes()
    file.write_bytes(content[:len(content) // 2])
    report = write_timing_report(folder, tmp_path / 'timing.json')
    assert 20 < report['cycles'] < 200
    assert report['gaps'] == 0
    assert 'was not finished' in report['notices'][0]
    assert sorted(path.name for path in tmp_path.iterdir()) == ['bag', 'timing.json']
    with pytest.raises(InputError, match='cannot be written'):
        write_timing_report(folder, tmp_path / 'absent' / 'timing.json')


def test_recordings_without_timing(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """No cycles, one cycle: an error that says so, and no file."""
    messages = documents(recorder, drive(CUT_IN, duration_s=0.1))
    with pytest.raises(InputError, match='no /timing/cycle in it'):
        timing_report(recorder.ours(tmp_path / 'none', messages))
    one = recorder.ours(tmp_path / 'one', messages + cycles(recorder, {}, {}, 1))
    with pytest.raises(CrgameError, match='too few to measure'):
        write_timing_report(one, tmp_path / 'timing.json')
    assert not (tmp_path / 'timing.json').exists()


def test_the_sound_of_seats(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """It has the time with sound on and the volume then; unreadable values are skipped."""
    messages = documents(recorder, drive(CUT_IN, duration_s=0.1)) + cycles(recorder, {}, {}, 30)
    quiet = timing_report(recorder.ours(tmp_path / 'quiet', messages))
    assert quiet['sound'] == {}
    told = [('hv0', 'true', '0.60', '0.50'), ('hv0', 'true', '0.80', '0.50'),
            ('hv0', 'true', '0.80', '0.50'), ('hv0', 'false', '0.10', '0.50'),
            ('av0', 'false', '0.70', '0.00'), ('hv0', 'true', 'loud', '0.50'),
            ('hv0', 'true', '1.50', '0.50'), ('nobody', 'true', '1.00', '1.00')]
    for number, (seat, on, volume, rumble) in enumerate(told):
        stamp_ns = 10_000_000 * (number + 1)
        messages.append(('/diagnostics', DIAGNOSTICS, START + stamp_ns, recorder.status(
            stamp_ns, f'cockpit_node: {seat} sound', '', on=on, volume=volume, rumble=rumble)))
    assert timing_report(recorder.ours(tmp_path / 'bag', messages))['sound'] == {
        'hv0': {'on_share': 0.75, 'volume': 0.8, 'rumble': 0.5},
        'av0': {'on_share': 0.0, 'volume': None, 'rumble': 0.0}}


def test_the_views_of_seats(tmp_path: Path, recorder: Any, drive: Drive) -> None:
    """Each choice has a period up to the next one; unreadable values are skipped."""
    messages = documents(recorder, drive(CUT_IN, duration_s=0.1)) + cycles(recorder, {}, {}, 30)
    map_view = {'shown': 'map', 'plans': 'true', 'ratio': '1', 'rate_hz': '', 'width_px': '900'}
    driver = {'shown': 'driver', 'across_deg': '75.0', 'plans': 'false', 'ratio': '0.5',
              'renderer': 'SwiftShader', 'software': 'true', 'screen_width_m': '0.6',
              'eye_distance_m': '0.7', 'inset': 'true'}
    told = [('hv0', {'shown': ''}), ('hv0', map_view), ('hv0', map_view | {'rate_hz': '60'}),
            ('hv0', driver | {'rate_hz': '20'}), ('hv0', driver | {'rate_hz': '30'}),
            ('nobody', map_view), ('hv0', {'shown': 'moon'}),
            ('hv0', driver | {'rate_hz': 'nan', 'inset': 'false'})]
    for number, (seat, values) in enumerate(told):
        stamp_ns = 10_000_000 * (number + 1)
        messages.append(('/diagnostics', DIAGNOSTICS, START + stamp_ns, recorder.status(
            stamp_ns, f'cockpit_node: {seat} view', '', **values)))
    seen = timing_report(recorder.ours(tmp_path / 'bag', messages))['view']
    assert list(seen) == ['hv0']
    assert [(item['from_s'], item['to_s'], item['shown'], item['inset'], item['plans'],
             item['rate_hz']) for item in seen['hv0']] == [
        (0.02, 0.04, 'map', False, True, 60.0), (0.04, 0.08, 'driver', True, False, 25.0),
        (0.08, 0.08, 'driver', False, False, None)]
    assert seen['hv0'][1] == {
        'from_s': 0.04, 'to_s': 0.08, 'shown': 'driver', 'inset': True, 'plans': False,
        'mirrors': False, 'bare': False, 'software': True, 'across_deg': 75.0,
        'screen_width_m': 0.6, 'eye_distance_m': 0.7, 'width_px': None, 'height_px': None,
        'renderer': 'SwiftShader', 'ratio': 0.5, 'rate_hz': 25.0}
    assert seen['hv0'][0]['width_px'] == 900.0
