# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Planners freeze, die and send bad plans: the AV follows its last good plan, then brakes."""

from collections.abc import Callable

from crgame_ros.messages.joints import from_joint_trajectory, plan_from_joints, plan_to_joints
from crgame_ros.messages.plan import Plan
from crgame_ros.ros.messages import from_time, to_joint_trajectory
from crgame_ros.vehicle.state import VehicleState
from live_peer import Peer
from live_support import PATIENCE_S, wait_until
import numpy as np
from numpy.typing import NDArray
import pytest
from rclpy.duration import Duration as RosDuration
from rclpy.publisher import Publisher
from steady_game import Run, STEP_NS, STEP_S
from trajectory_msgs.msg import JointTrajectory

TICK_NS, STEPS_PER_TICK = 100_000_000, 10
# Deceleration of an AV whose plan is used up [m/s^2].
EXHAUSTED = 4.0


def _plans(peer: Peer) -> list[Plan]:
    return [plan_from_joints(from_joint_trajectory(message, 'plan'), 'av0', TICK_NS)
            for message in peer.messages['/<av>/plan']]


def _stands(peer: Peer, vehicle_id: str) -> bool:
    message = peer.messages['/vehicles/state'][-1]
    first = list(message.joint_names).index(f'{vehicle_id}/x')
    return bool(np.all(np.array(message.points[0].velocities[first:first + 2]) == 0.0))


def _followed(plan: Plan, rows: NDArray[np.float64]) -> int:
    """
    Check that an AV was where a plan has it at every tick but the first, without a gap in n.

    :return: at how many ticks.
    """
    since = np.rint((rows[:, 0] - plan.stamp_ns) / STEP_NS).astype(int)
    assert np.all(np.diff(since) == 1)
    ticks = [index for index, step in enumerate(since) if step % STEPS_PER_TICK == 0
             and STEPS_PER_TICK <= step <= STEPS_PER_TICK * (len(plan.states) - 1)]
    planned = plan.states[since[ticks] // STEPS_PER_TICK]
    assert np.abs(rows[ticks, 1:4] - planned[:, :3]).max() < 1e-9
    return len(ticks)


@pytest.mark.clock
def test_av_follows_its_last_plan_and_brakes_while_the_planner_is_frozen(run: Run) -> None:
    """
    It follows its last plan, then brakes straight on at 4 m/s^2 to a stop, then recovers.

    The steps without a plan are counted.

    The plan reaches 3 s; the stop needs v / 4 more seconds.
    """
    launcher, peer = run
    peer.set_parameter('real_time_factor', 4.0)
    run.wait_for_steps(20)
    launcher.freeze('planner_node_av0')
    peer.wait_until(lambda: _stands(peer, 'av0'), 'a stop of av0')
    peer.wait_until(lambda: peer.statuses('sim_node: av0 plans')[-1][0].message
                    == 'no plan: braking', 'the count of steps without a plan')
    plan, rows = _plans(peer)[-1], peer.states('av0')
    assert _followed(plan, rows) == len(plan.states) - 1
    after = rows[rows[:, 0] >= plan.stamp_ns + TICK_NS * (len(plan.states) - 1)]
    speed = after[0, 4]
    assert speed > 5.0
    fell = -np.diff(after[:, 4])
    braking = after[1:, 4] > 0.0
    assert fell[braking] == pytest.approx(EXHAUSTED * STEP_S, abs=1e-9)
    gone = np.hypot(*(after[-1, 1:3] - after[0, 1:3]))
    assert gone == pytest.approx(speed ** 2 / (2 * EXHAUSTED), abs=0.5 * speed * STEP_S)
    peer.wait_until(lambda: int(run.counters()['steps_without_plan'])
                    >= speed / EXHAUSTED / STEP_S, 'the count of every step without a plan')
    # It was asked again each second: the plan lasts three.
    assert int(run.counters()['timed_out']) >= 3
    accepted = int(run.counters()['accepted'])
    launcher.thaw('planner_node_av0')
    peer.wait_until(lambda: int(run.counters()['accepted']) > accepted, 'new plans')
    peer.wait_until(lambda: not _stands(peer, 'av0'), 'av0 on its way again')
    peer.wait_until(lambda: peer.statuses('sim_node: av0 plans')[-1][0].message
                    == 'following its plan', 'word of that')


def test_killed_planner_is_started_again_and_used(run: Run) -> None:
    """The launcher names the dead planner; its successor's plans are followed without a stop."""
    launcher, peer = run
    starts = len(launcher.started)
    launcher.kill('planner_node_av0')
    wait_until(lambda: len(launcher.started) > starts, 'another planner')
    assert launcher.says(r'planner_node_av0 died \(signal SIGKILL\); starting it again')
    peer.forget()
    peer.wait_until(lambda: peer.messages['/<av>/plan'], 'a plan of the successor')
    peer.wait_until(lambda: len(peer.statuses('sim_node: av0 plans')) > 1, 'two reports')
    # If each request is answered, no plan may be older than a tick and the time to answer.
    peer.wait_until(lambda: float(run.counters()['age_ms']) < 300.0, 'a fresh plan')
    assert launcher.says(r'\[planner_node_av0\] .*planner idm is ready')
    assert not _stands(peer, 'av0')


def _with_nan(states: NDArray[np.float64]) -> NDArray[np.float64]:
    states[3, VehicleState._fields.index('x')] = np.nan
    return states


def _elsewhere(states: NDArray[np.float64]) -> NDArray[np.float64]:
    states[:, VehicleState._fields.index('x')] += 5.0
    return states


def _with_jump(states: NDArray[np.float64]) -> NDArray[np.float64]:
    states[5:, VehicleState._fields.index('x')] += 3.0
    return states


def _too_fast(states: NDArray[np.float64]) -> NDArray[np.float64]:
    states[1:, VehicleState._fields.index('speed')] = 90.0
    return states


LIES: dict[str, Callable[[NDArray[np.float64]], NDArray[np.float64]]] = {
    'x of state 3 is nan': _with_nan,
    'the first state is 5.00 m from the vehicle': _elsewhere,
    'jump of 3.00 m from where its speed leads in 0.1 s at state 5': _with_jump,
    'm/s beyond the limit': _too_fast,
}


def _step(peer: Peer) -> int:
    """Go on by one tick in a pause; return the step n after it."""
    n = peer.n + STEPS_PER_TICK
    assert peer.call('/sim/step').success
    peer.wait_until(lambda: peer.n == n, f'n = {n}')
    return n


def _ask_again(peer: Peer) -> None:
    """Go on by one tick in a pause, and wait until av0's planner is asked at it."""
    n = _step(peer)
    step_of_stamp = peer.games[-1].scheduler.step_of_stamp
    peer.wait_until(lambda: step_of_stamp(from_time(
        peer.messages['/<av>/plan_request'][-1].header.stamp)) == n - n % STEPS_PER_TICK,
        f'the request of the tick before n = {n}')


def _take_over(peer: Peer, rogue: Publisher) -> None:
    """Answer two requests that the frozen planner leaves open: from then on it is the planner."""
    for asked in range(2):
        if asked:
            # A request that is not answered is repeated after a second.
            stamp = peer.messages['/<av>/plan_request'][-1].header.stamp
            while peer.messages['/<av>/plan_request'][-1].header.stamp == stamp:
                _step(peer)
                peer.listen_for(0.05)
        _answer(peer, rogue, lambda states: states)
    _ask_again(peer)
    assert 'of another planner: ' in peer.statuses('sim_node: av0 plan refused')[0][0].message


def _refusals(peer: Peer) -> list[str]:
    """Return why plans of the planner were refused."""
    return [status.message for status, _ in peer.statuses('sim_node: av0 plan refused')
            if 'of another planner' not in status.message]


def _answer(peer: Peer, rogue: Publisher,
            lie: Callable[[NDArray[np.float64]], NDArray[np.float64]], late_ns: int = 0) -> None:
    """Answer the last request for av0 with a plan at constant speed, distorted."""
    request: JointTrajectory = peer.messages['/<av>/plan_request'][-1]
    point = request.points[0]
    x, y, yaw, steering = point.positions[:4]
    vx, vy = point.velocities[:2]
    times = np.arange(31) * 0.1
    states = np.zeros((31, len(VehicleState._fields)))
    states[:, :3] = np.stack((x + times * vx, y + times * vy, np.full(31, yaw)), axis=1)
    states[:, 3], states[:, 4] = np.hypot(vx, vy), steering
    plan = Plan(from_time(request.header.stamp) + late_ns, lie(states))
    rogue.publish(to_joint_trajectory(plan_to_joints(plan, 'av0', TICK_NS)))
    assert rogue.wait_for_all_acked(RosDuration(seconds=PATIENCE_S))


def test_a_second_planner_is_told_of_and_not_followed(run: Run) -> None:
    """A program that was left over answers each request too: its plans are counted, no more."""
    launcher, peer = run
    other = peer.publisher('/<av>/plan', 'av0')
    sent: set[int] = set()

    def answer() -> bool:
        for message in peer.messages['/<av>/plan_request']:
            if from_time(message.header.stamp) not in sent:
                sent.add(from_time(message.header.stamp))
                _answer(peer, other, lambda states: states)
        return int(run.counters()['of_others']) >= 5
    peer.wait_until(lambda: peer.statuses('sim_node: av0 plans') and answer(), 'its answers')
    counted = run.counters()
    assert int(counted['accepted']) >= int(counted['requests']) - int(counted['refused']) - 2
    assert counted['refused'] == '0'
    name = f'{peer.node.get_namespace().rstrip("/")}/{peer.node.get_name()}'
    assert launcher.says(f'/av0/plan: of another planner: {name} answers besides '
                         '/planner_node_av0')
    peer.node.destroy_publisher(other)


@pytest.mark.exhaustive
def test_lies_of_a_planner_are_refused_with_the_reason(run: Run) -> None:
    """
    Each bad plan (NaN, another start, a jump, 90 m/s, a wrong stamp) is named; the good one stays.

    The real planner is frozen, so that the plans of another node answer the open requests. Its
    last plan reaches 3 s, so that the run goes on tick by tick: a refused request is repeated at
    the next one.
    """
    launcher, peer = run
    rogue = peer.publisher('/<av>/plan', 'av0')
    assert peer.call('/sim/pause').success
    try:
        peer.wait_for_pause()
        peer.wait_until(lambda: peer.messages['/<av>/plan'][-1].header.stamp
                        == peer.messages['/<av>/plan_request'][-1].header.stamp, 'the last answer')
        launcher.freeze('planner_node_av0')
        _ask_again(peer)
        _take_over(peer, rogue)
        good = _plans(peer)[-1]
        reasons = {**LIES, 'answers no request': lambda states: states}
        for count, (reason, lie) in enumerate(reasons.items(), 1):
            _answer(peer, rogue, lie, TICK_NS // 2 if reason == 'answers no request' else 0)
            # A plan that answers no request leaves the request open for a second.
            (_step if reason == 'answers no request' else _ask_again)(peer)
            peer.wait_until(lambda count=count: len(_refusals(peer)) >= count,
                            f'the refusal: {reason}')
            assert reason in _refusals(peer)[-1]
        assert len(_refusals(peer)) == len(reasons)
        # Each refusal took a tick, and the AV still follows the plan from before.
        assert _followed(good, peer.states('av0')) >= len(reasons)
        assert peer.states('av0')[-1, 4] > 5.0
    finally:
        launcher.thaw('planner_node_av0')
        assert peer.call('/sim/start').success
    peer.wait_until(lambda: int(run.counters()['refused']) >= len(reasons), 'the count')
    accepted = int(run.counters()['accepted'])
    peer.wait_until(lambda: int(run.counters()['accepted']) > accepted, 'good plans again')
    peer.node.destroy_publisher(rogue)
