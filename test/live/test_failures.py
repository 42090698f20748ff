# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Nodes are killed and frozen, planners lie and disks fill: what becomes of the run."""

from collections.abc import Callable, Iterator
from pathlib import Path
import resource
from typing import NamedTuple

from live_peer import Peer
from live_support import CUT_IN, is_node, Launcher, SCENARIOS, wait_until
import numpy as np
from numpy.typing import NDArray
import pytest
from rclpy.publisher import Publisher
from trajectory_msgs.msg import JointTrajectory

from crgame_ros.planner.interface import Plan
from crgame_ros.planner.joints import plan_from_joints, plan_to_joints
from crgame_ros.recording.reader import BagReader
from crgame_ros.ros.messages import from_joint_trajectory, from_time, to_joint_trajectory
from crgame_ros.timing.cycle_rows import CycleTable
from crgame_ros.vehicle.state import VehicleState

STEP_S, STEP_NS = 0.01, 10_000_000
TICK_NS, STEPS_PER_TICK = 100_000_000, 10
# A driver holds this pedal all the time; float32 represents it exactly.
THROTTLE = 0.375
# Of the watchdog: CRG's release rate of pedals [1/s], the gentle brake, the silence allowed [s].
RELEASE_RATE, GENTLE_BRAKE, SILENCE_S = 2.2, 0.15, 0.2
# Deceleration of an AV whose plan is used up [m/s^2].
EXHAUSTED = 4.0

GAME = f"""
scenario: {SCENARIOS / 'ZAM_CutIn-1_1_T-1.xml'}
duration: 3600
humans:
  - id: hv0
    driver: joy:steady.joy.yaml
    spawn: {{lanelet: 13, s: 234.0, d: 0.0, speed: 26.0}}
avs:
  - {{id: av0, planning_problem: 100, planner: idm}}
"""
TIMELINE = f"""
joy:
  axes: [throttle, brake, steering]
  points: [[0.0, {THROTTLE}, 0.0, 0.0], [3600.0, {THROTTLE}, 0.0, 0.0]]
"""
TOPICS = ('/clock', '/scenario/game', '/timing/cycle', '/vehicles/state', '/diagnostics',
          ('/<hv>/driver_command', 'hv0'), ('/<av>/plan', 'av0'), ('/<av>/plan_request', 'av0'),
          ('/<v>/drivability', 'hv0'))


class Run(NamedTuple):
    """A graph that runs and a node that listens to it."""

    launcher: Launcher
    peer: Peer

    def wait_for_steps(self, steps: int) -> None:
        """Wait until the simulation has gone so many steps on."""
        last = self.peer.n + steps
        self.peer.wait_until(lambda: self.peer.n >= last, f'n = {last}')

    def counters(self) -> dict[str, str]:
        """Give what sim_node said last of the plans of av0."""
        return self.peer.statuses('sim_node: av0 plans')[-1][1]


def _write_game(folder: Path) -> Path:
    (folder / 'steady.joy.yaml').write_text(TIMELINE)
    (folder / 'steady.yaml').write_text(GAME)
    return folder / 'steady.yaml'


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Keep one graph for the tests that leave it whole."""
    folder = tmp_path_factory.mktemp('failures')
    with Launcher([_write_game(folder)], folder / 'run') as launcher, \
            Peer(launcher.domain, *TOPICS) as peer:
        peer.wait_until(lambda: peer.n > 0, 'the first step')
        yield Run(launcher, peer)


@pytest.fixture
def run(graph: Run) -> Iterator[Run]:
    """Begin the game again, at the pace of the clock, and leave nobody frozen behind."""
    launcher, peer = graph
    assert peer.set_parameter('real_time_factor', 1.0).successful
    epoch = peer.games[-1].epoch
    assert peer.call('/sim/reset').success
    peer.wait_until(lambda: peer.games[-1].epoch > epoch and peer.n > 50, 'n = 50 of a new epoch')
    peer.forget()
    for topic in ('/vehicles/state', '/<av>/plan', '/<hv>/driver_command'):
        peer.wait_until(lambda topic=topic: peer.messages[topic], f'a message of {topic}')
    yield graph
    for name in dict(launcher.started):
        launcher.thaw(name)


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


def test_av_follows_its_last_plan_and_brakes_while_the_planner_is_frozen(run: Run) -> None:
    """
    Frozen: the last plan to its end, then 4 m/s^2 straight on to a stop, counted; then recovery.

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
    assert peer.statuses('sim_node: av0 plans')[-1][0].message == 'following its plan'


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
    # No plan may be older than a tick and its answer, where every one is answered.
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
    'jump of 3.00 m at state 5': _with_jump,
    'm/s beyond the limit': _too_fast,
}


def _answer(run: Run, rogue: Publisher, lie: Callable[[NDArray[np.float64]], NDArray[np.float64]],
            late_ns: int = 0) -> None:
    """Answer the next request for av0 with a plan at constant speed, distorted."""
    peer = run.peer
    seen = len(peer.messages['/<av>/plan_request'])
    peer.wait_until(lambda: len(peer.messages['/<av>/plan_request']) > seen, 'a request')
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


def test_lies_of_a_planner_are_refused_with_the_reason(run: Run) -> None:
    """
    NaN, a start elsewhere, a jump, 90 m/s, a wrong stamp: each is named, and the good plan stays.

    The real planner is frozen, so that the plans of another node answer the open requests. Its
    last plan reaches 3 s: the open request is repeated after 1 s, a refused one after 0.1 s.
    """
    launcher, peer = run
    peer.set_parameter('real_time_factor', 0.5)
    rogue = peer.publisher('/<av>/plan', 'av0')
    launcher.freeze('planner_node_av0')
    peer.listen_for(0.1)
    good = _plans(peer)[-1]
    reasons = {**LIES, 'answers no request': lambda states: states}
    for count, (reason, lie) in enumerate(reasons.items(), 1):
        _answer(run, rogue, lie, TICK_NS // 2 if reason == 'answers no request' else 0)
        peer.wait_until(lambda count=count: len(peer.statuses('sim_node: av0 plan refused'))
                        >= count, f'the refusal: {reason}')
        assert reason in peer.statuses('sim_node: av0 plan refused')[-1][0].message
    refusals = peer.statuses('sim_node: av0 plan refused')
    assert len(refusals) == len(reasons)
    # Each took a tick at least, and the AV is still on the plan from before.
    run.wait_for_steps(STEPS_PER_TICK)
    assert _followed(good, peer.states('av0')) >= len(reasons)
    assert peer.states('av0')[-1, 4] > 5.0
    peer.set_parameter('real_time_factor', 4.0)
    launcher.thaw('planner_node_av0')
    peer.wait_until(lambda: int(run.counters()['refused']) >= len(reasons), 'the count')
    accepted = int(run.counters()['accepted'])
    peer.wait_until(lambda: int(run.counters()['accepted']) > accepted, 'good plans again')
    peer.node.destroy_publisher(rogue)


def _check_loss(cycles: CycleTable, last_n: int) -> None:
    """Check how a seat lets go: after 0.2 s, at the release rate, then the gentle brake."""
    numbers, actual = cycles.column('n'), cycles.column('actual_s')
    throttle, brake, steering = cycles.commands('hv0')[:, :3].T
    falling = int(np.flatnonzero(throttle < THROTTLE)[0])
    heard = int(np.flatnonzero(numbers == last_n)[0])
    assert actual[falling] - actual[heard] > SILENCE_S
    # A command may take a while on a busy machine; it never counts for twice the silence more.
    assert actual[falling - 1] - actual[heard] < 3 * SILENCE_S
    assert np.all(throttle[heard:falling] == THROTTLE)
    released = falling + int(np.flatnonzero(throttle[falling:] == 0.0)[0])
    pressed = throttle[falling - 1:released]
    lengths = cycles.column('dt_eff_s')[falling:released]
    assert -np.diff(pressed) == pytest.approx(RELEASE_RATE * lengths, abs=1e-6)
    assert np.all(brake[:released] == 0.0)
    assert np.all(steering == 0.0)
    assert np.all(np.diff(brake[released:]) >= 0.0)
    assert brake[-1] == pytest.approx(GENTLE_BRAKE, abs=1e-7)


def test_seat_lets_go_while_the_driver_is_frozen(run: Run) -> None:
    """0.2 s of silence: the pedal is released, then braked gently; the driver then continues."""
    launcher, peer = run
    run.wait_for_steps(5)
    launcher.freeze('driver_node_hv0')
    peer.listen_for(0.1)
    last_n = peer.games[-1].scheduler.step_of_stamp(
        from_time(peer.messages['/<hv>/driver_command'][-1].header.stamp))
    peer.wait_until(lambda: peer.cycles().commands('hv0')[-1, 1] > 0.999 * GENTLE_BRAKE,
                    'the gentle brake')
    peer.wait_until(lambda: peer.statuses('sim_node: hv0 seat')
                    and peer.statuses('sim_node: hv0 seat')[-1][0].message == 'driver lost',
                    'word of the loss')
    _check_loss(peer.cycles(), last_n)
    speeds = peer.states('hv0')[:, 4]
    assert speeds[-1] < speeds.max()
    assert peer.statuses('sim_node: hv0 seat')[-1][1]['losses'] == '1'
    launcher.thaw('driver_node_hv0')
    peer.wait_until(lambda: peer.cycles().commands('hv0')[-1, 0] == THROTTLE, 'the driver again')
    peer.wait_until(lambda: peer.statuses('sim_node: hv0 seat')[-1][0].message == 'driven',
                    'word of the return')


def test_killed_driver_is_started_again_and_drives(run: Run) -> None:
    """The seat lets go meanwhile; the successor continues where the timeline is by then."""
    launcher, peer = run
    starts = len(launcher.started)
    launcher.kill('driver_node_hv0')
    peer.wait_until(lambda: peer.cycles().commands('hv0')[-1, 0] < THROTTLE, 'the release')
    wait_until(lambda: len(launcher.started) > starts, 'another driver')
    peer.wait_until(lambda: peer.cycles().commands('hv0')[-1, 0] == THROTTLE, 'the driver again')
    assert peer.cycles().commands('hv0')[-1, 1] == 0.0


def test_monitor_and_supervisor_are_started_again(run: Run) -> None:
    """Drivability and time-sync are killed: every cycle still happens, and both report again."""
    launcher, peer = run
    peer.wait_until(lambda: peer.messages['/<v>/drivability']
                    and peer.statuses('timesync_node: table I'), 'reports before')
    for name in ('drivability_node', 'timesync_node'):
        launcher.kill(name)
    for name in ('drivability_node', 'timesync_node'):
        launcher.wait_for_restart(name)
        assert launcher.says(rf'{name} died \(signal SIGKILL\); starting it again')
    verdicts, reports = peer.messages['/<v>/drivability'], 'timesync_node: table I'
    heard = (len(verdicts), len(peer.statuses(reports)))
    peer.wait_until(lambda: len(verdicts) > heard[0] and len(peer.statuses(reports)) > heard[1],
                    'reports of the successors')
    assert {item.key: item.value for item in verdicts[-1].status[0].values}['collision'] == 'false'
    numbers = peer.cycles().column('n')
    assert np.array_equal(numbers, np.arange(numbers[0], numbers[0] + len(numbers)))


def _recorded_steps(bag: Path, offset_ns: int) -> list[int]:
    """Give the steps of /vehicles/state in a recording, in its order."""
    with BagReader(bag) as reader:
        return [(from_time(item.message.header.stamp) - offset_ns) // STEP_NS
                for item in reader.decoded(['/vehicles/state'])]


def test_recorder_is_killed_then_its_disk_is_full(tmp_path: Path) -> None:
    """
    Killed, it loses no more than its last second, and continues in another folder.

    There its disk fills up: that is an error on /diagnostics, and the driving goes on. At the end
    both recordings are finished files, and the run has its scenario.
    """
    with Launcher([_write_game(tmp_path)], tmp_path / 'run') as launcher, \
            Peer(launcher.domain, *TOPICS) as peer:
        run = Run(launcher, peer)
        peer.wait_until(lambda: peer.n > 150, 'n = 150')
        killed_n = peer.n
        launcher.kill('recorder_node')
        offset_ns = peer.games[-1].scheduler.clock_offset_ns
        steps = _recorded_steps(tmp_path / 'run' / 'bag', offset_ns)
        # It hands over every 0.9 s what it has; 0.4 s more for a machine that is busy.
        assert steps == list(range(len(steps)))
        assert steps[-1] > killed_n - 130
        launcher.wait_for('recording into .*bag_part2')
        part = tmp_path / 'run' / 'bag_part2'
        file = part / 'bag_part2_0.mcap'
        wait_until(lambda: file.stat().st_size > 20_000, 'a part of the recording')
        limit = file.stat().st_size + 1000
        resource.prlimit(launcher.node('recorder_node'), resource.RLIMIT_FSIZE, (limit, limit))
        peer.wait_until(lambda: peer.statuses('recorder_node: recording'), 'word of the disk')
        status, _ = peer.statuses('recorder_node: recording')[0]
        assert status.level == status.ERROR
        assert 'recording stopped: File too large' in status.message
        run.wait_for_steps(50)
        assert peer.call('/sim/stop').success
        assert launcher.wait() == 0, launcher.text
        assert is_node(launcher.node('recorder_node')) is False
    for folder, first in ((tmp_path / 'run' / 'bag', 0), (part, killed_n)):
        with BagReader(folder) as reader:
            assert reader.complete
        steps = _recorded_steps(folder, offset_ns)
        assert steps[0] >= first
        assert steps == list(range(steps[0], steps[0] + len(steps)))
    assert (tmp_path / 'run' / 'C-ZAM_CutIn-1_1_T-1.xml').is_file()


def test_killed_simulation_ends_the_run(tmp_path: Path) -> None:
    """The launcher says so and fails; everything that was published by then is recorded."""
    with Launcher([CUT_IN], tmp_path / 'run') as launcher, Peer(launcher.domain, *TOPICS) as peer:
        peer.wait_until(lambda: peer.n > 60, 'n = 60')
        launcher.kill('sim_node')
        assert launcher.wait() == 1
        peer.listen_for(0.2)
        assert launcher.says(r'^sim_node died \(signal SIGKILL\); ending the others$')
        assert not any(is_node(pid) for _, pid in launcher.started)
        heard = peer.states('hv0')[:, 0]
        offset_ns = peer.games[-1].scheduler.clock_offset_ns
    steps = _recorded_steps(tmp_path / 'run' / 'bag', offset_ns)
    assert steps == list(range(len(steps)))
    assert steps[-1] == (heard[-1] - offset_ns) // STEP_NS
    with BagReader(tmp_path / 'run' / 'bag') as reader:
        assert reader.complete
    assert (tmp_path / 'run' / 'timing.json').is_file()
    assert (tmp_path / 'run' / 'C-ZAM_CutIn-1_1_T-1.xml').is_file()
