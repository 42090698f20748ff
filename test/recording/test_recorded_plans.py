# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plans of a recorded run: the request that each answers, its time and its states."""

import math
from pathlib import Path
from typing import Any

from crgame_ros.game.game import AvSpec
from crgame_ros.messages.joints import plan_to_joints, vehicle_joint_names, vehicle_to_joints
from crgame_ros.messages.plan import Plan
from crgame_ros.recording.recorded_plans import read_plans
from crgame_ros.vehicle.state import STATE_WIDTH, VehicleState
import numpy as np
import pytest

START = 1_700_000_000_000_000_000
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
TICK_NS = 100_000_000
Message = tuple[str, str, int, bytes]


def state_at(tick: int, step: int = 0) -> VehicleState:
    """Drive along x at 10 m/s."""
    return VehicleState(float(tick + step), 2.0, 0.0, 10.0, 0.0, 0.5)


def request(recorder: Any, tick: int, after_ms: float = 0.0) -> Message:
    """Make a request of av0 at a tick, with an object beside it."""
    joints = [np.append(row, (9.0, 9.0, 0.0)) for row in vehicle_to_joints(state_at(tick))]
    return ('/av0/plan_request', TRAJECTORY, START + tick * TICK_NS + round(after_ms * 1e6),
            recorder.joints(tick * TICK_NS, [*vehicle_joint_names('av0'), 'o1/x', 'o1/y',
                                             'o1/yaw'], *joints))


def answer(samples: Any, tick: int, after_ms: float, points: int = 4) -> Message:
    """Make the answer to a request, so much later."""
    states = np.array([state_at(tick, step) for step in range(points)]).reshape(-1, STATE_WIDTH)
    series = plan_to_joints(Plan(tick * TICK_NS, states), 'av0', TICK_NS)
    header = samples.make('std_msgs/msg/Header', samples.make(
        'builtin_interfaces/msg/Time', *divmod(tick * TICK_NS, 1_000_000_000)), 'map')
    columns = [np.ascontiguousarray(values) for values in (
        series.positions, series.velocities, series.accelerations)]
    rows = [samples.make(
        'trajectory_msgs/msg/JointTrajectoryPoint', *(values[i] for values in columns),
        np.zeros(0),
        samples.make('builtin_interfaces/msg/Duration', *divmod(
            int(series.times_ns[i]), 1_000_000_000))) for i in range(points)]
    return ('/av0/plan', TRAJECTORY, START + tick * TICK_NS + round(after_ms * 1e6),
            samples.encode(TRAJECTORY, header, list(series.names), rows))


def documents(recorder: Any, drive: Any) -> list[Message]:
    result = drive('ZAM_CutIn-1_1_T-1.xml', duration_s=0.5,
                   avs=(AvSpec('av0', 'constant-velocity'),))
    found: list[Message] = recorder.messages(result, log_ns=START)
    return [message for message in found if message[0].startswith('/scenario/')]


def test_each_plan_has_its_request(tmp_path: Path, recorder: Any, samples: Any,
                                   drive: Any) -> None:
    """A repeated request counts from its second time; repeated or stray answers have no time."""
    messages = [
        *documents(recorder, drive), request(recorder, 0), request(recorder, 0, 500.0),
        answer(samples, 0, 520.0), answer(samples, 0, 530.0), request(recorder, 6),
        answer(samples, 7, 3.0), answer(samples, 6, 140.0, points=2)]
    plans = list(read_plans(recorder.ours(tmp_path / 'bag', messages)))
    assert [(plan.av, plan.k) for plan in plans] == [('av0', 0), ('av0', 0), ('av0', 7),
                                                     ('av0', 6)]
    assert np.array_equal(np.isnan([plan.latency_s for plan in plans]),
                          [False, True, True, False])
    assert plans[0].latency_s == pytest.approx(0.02, abs=1e-9)
    assert plans[3].latency_s == pytest.approx(0.14, abs=1e-9)
    for plan, tick, points in zip(plans, (0, 0, 7, 6), (4, 4, 4, 2), strict=True):
        assert plan.plan is not None
        assert plan.fault == ''
        assert plan.plan.stamp_ns == plan.stamp_ns == tick * TICK_NS
        expected = np.array([state_at(tick, step) for step in range(points)])
        assert np.allclose(plan.plan.states, expected, rtol=0.0, atol=1e-12)
    assert [plan.told for plan in plans] == [state_at(0), state_at(0), None, state_at(6)]


def test_what_is_no_plan_is_told_as_such(tmp_path: Path, recorder: Any, samples: Any,
                                         drive: Any) -> None:
    """Other joints, bad bytes, a stamp of no tick: each is reported, and the next one is read."""
    other = recorder.joints(0, ['av9/x'], [0.0], [0.0], [0.0])
    kind, at_ns, data = answer(samples, 2, 1.0)[1:]
    messages = [*documents(recorder, drive), ('/av0/plan', TRAJECTORY, START + 1, other),
                ('/av0/plan', TRAJECTORY, START + 2, data[:20]),
                ('/av0/plan', TRAJECTORY, START + 3, recorder.joints(
                    7_000_000, vehicle_joint_names('av0'), *np.zeros((3, 4)))),
                ('/av0/plan', kind, at_ns, data)]
    plans = list(read_plans(recorder.ours(tmp_path / 'bag', messages)))
    assert [plan.plan is None for plan in plans] == [True, True, False, False]
    assert 'joint_names are av9/x' in plans[0].fault
    assert 'is no trajectory_msgs' in plans[1].fault
    assert plans[2].k is None
    assert plans[3].k == 2
    assert all(math.isnan(plan.latency_s) for plan in plans)


def test_plans_of_other_runs_are_not_read(tmp_path: Path, recorder: Any, samples: Any,
                                          drive: Any) -> None:
    """A reset begins another epoch, distinguished by its stamps."""
    result = drive('ZAM_CutIn-1_1_T-1.xml', duration_s=0.5,
                   avs=(AvSpec('av0', 'constant-velocity'),))
    later = [message for message in recorder.messages(
        result, epoch=1, offset_ns=10 * TICK_NS, log_ns=START + 10 * TICK_NS)
        if message[0].startswith('/scenario/')]
    messages = [*documents(recorder, drive), request(recorder, 3), answer(samples, 3, 4.0),
                *later, request(recorder, 12), answer(samples, 12, 6.0)]
    bag = recorder.ours(tmp_path / 'bag', messages)
    for epoch, k, latency_s in ((0, 3, 0.004), (1, 2, 0.006)):
        plan, = read_plans(bag, epoch)
        assert plan.k == k
        assert plan.latency_s == pytest.approx(latency_s, abs=1e-9)
