# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Orders that a running graph obeys: pause, step, reset, pace, another scenario and stop."""

from collections.abc import Iterator
import time

from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.recording.run_folder import bags_of, run_folder, run_folders
from crgame_ros.ros.messages import from_time, to_time
from live_peer import Peer
from live_support import CUT_IN, is_node, Launcher, SCENARIOS
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

pytestmark = pytest.mark.clock

STEPS_PER_TICK = 10
TOPICS = ('/clock', '/scenario/game', '/scenario/xml', '/scenario/objects', '/seats',
          '/timing/cycle', '/vehicles/state', '/diagnostics', ('/<v>/driver_command', 'hv0'),
          ('/<av>/plan', 'av0'), ('/<av>/plan_request', 'av0'))
OTHER_SCENARIO = 'ZAM_Roundabout-1_1_T-1.xml'
# For this long nothing may happen during a pause [s]; ten ticks would fit into it.
QUIET_S = 1.0


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Launcher, Peer]]:
    """Keep one graph for all tests; each begins a new epoch in it."""
    folder = tmp_path_factory.mktemp('control')
    with Launcher([CUT_IN, '--duration', 3600], folder / 'run') as launcher, \
            Peer(launcher.domain, *TOPICS) as peer:
        # Long enough for a scenario step: without one a recording has no scenario to write.
        peer.wait_until(lambda: peer.n > 30, 'n = 30')
        yield launcher, peer


def _reset(peer: Peer) -> None:
    epoch = peer.games[-1].epoch
    assert peer.call('/sim/reset').success
    peer.wait_until(lambda: peer.games[-1].epoch == epoch + 1, 'the documents of a new epoch')


@pytest.fixture
def peer(graph: tuple[Launcher, Peer]) -> Iterator[Peer]:
    """Return a peer of the game, and leave the game running at its pace."""
    peer = graph[1]
    yield peer
    assert peer.call('/sim/start').success
    assert peer.set_parameter('real_time_factor', 1.0).successful


@pytest.fixture
def _anew(peer: Peer) -> None:
    """Begin the game again, for tests that look at an epoch from its first step on."""
    _reset(peer)
    peer.wait_until(lambda: peer.n > 30, 'n = 30 of a new epoch')


def _counts(peer: Peer) -> dict[str, int]:
    """Count the messages by topic, without the nodes' reports that they are alive."""
    return {name: len(messages) for name, messages in peer.messages.items()
            if name != '/diagnostics'}


@pytest.mark.usefixtures('_anew')
def test_pause_freezes_everything_and_step_advances_one_tick(peer: Peer) -> None:
    """
    No time, no requests and no cycle pass in a pause; a step is N = 10 simulation steps.

    The pedals hold: the cycle after a pause consumes what the driver's filter had reached.
    """
    assert not peer.call('/sim/step').success
    assert peer.call('/sim/pause').success
    peer.listen_for(0.3)
    before, paused_n = _counts(peer), peer.n
    peer.listen_for(QUIET_S)
    assert _counts(peer) == before
    for steps in (1, 2):
        goal = paused_n + steps * STEPS_PER_TICK
        # The answer comes when the step is done.
        assert peer.call('/sim/step').message == f'at n = {goal}'
        peer.wait_until(lambda goal=goal: peer.n >= goal, f'n = {goal}')
        peer.listen_for(0.3)
        assert peer.n == goal
        # Each scenario step has one tick, at which the planner is asked.
        assert len(peer.messages['/<av>/plan_request']) == before['/<av>/plan_request'] + steps
    assert peer.call('/sim/start').success
    peer.wait_until(lambda: peer.n > goal + 20, 'the run going on')
    cycles = peer.cycles()
    numbers = cycles.column('n')
    assert np.array_equal(numbers, np.arange(1, len(numbers) + 1))
    # A pause counts neither as lag nor as a long interval: Delta t_max is 50 ms.
    assert cycles.column('dt_eff_s').max() <= 0.05
    assert np.array_equal(cycles.column('resets'), np.zeros(len(numbers)))
    # CRG's keyboard filter moves by about 2 in a second: it did not move in the pause.
    throttle = cycles.commands('hv0')[:, 0]
    assert abs(throttle[paused_n] - throttle[paused_n - 1]) < 0.1
    assert peer.statuses('sim_node: hv0 seat')[-1][1]['losses'] == '0'


def test_each_order_of_a_burst_is_answered_and_done(peer: Peer) -> None:
    """200 steps ordered at once are 200 scenario steps."""
    count = 200
    assert peer.set_parameter('real_time_factor', 10.0).successful
    assert peer.call('/sim/pause').success
    before = peer.wait_for_pause()
    client = peer.node.create_client(Trigger, '/sim/step', qos_profile=QoSProfile(depth=2 * count))
    peer.wait_until(client.service_is_ready, 'the service')
    answers = [client.call_async(Trigger.Request()) for _ in range(count)]
    peer.wait_until(lambda: all(answer.done() for answer in answers), 'all answers')
    assert all(answer.result().success for answer in answers)
    peer.node.destroy_client(client)
    peer.wait_until(lambda: peer.n >= before + count * STEPS_PER_TICK, 'all steps')
    assert peer.wait_for_pause() == before + count * STEPS_PER_TICK


@pytest.mark.usefixtures('_anew')
def test_reset_begins_a_new_epoch_and_bag(graph: tuple[Launcher, Peer], peer: Peer) -> None:
    """The clock goes on, the documents come again, n and the vehicles begin anew."""
    launcher, _ = graph
    epoch = peer.games[-1].epoch
    counts = {name: len(peer.messages[name]) for name in
              ('/scenario/xml', '/scenario/objects', '/scenario/game', '/seats')}
    _reset(peer)
    peer.wait_until(lambda: peer.n > 20, 'n = 20')
    assert np.all(np.diff(peer.clock_ns) >= 0)
    for name, count in counts.items():
        peer.wait_until(lambda name=name, count=count: len(peer.messages[name]) > count,
                        f'{name} again')
    first, second = peer.games[-2:]
    assert (first.epoch, second.epoch) == (epoch, epoch + 1)
    assert second.scheduler.clock_offset_ns > first.scheduler.clock_offset_ns
    assert second.scenario_sha256 == first.scenario_sha256
    rows = peer.states('hv0')
    starts = [rows[rows[:, 0] == game.scheduler.clock_offset_ns][0, 1:]
              for game in (first, second)]
    assert np.array_equal(*starts)
    launcher.wait_for(rf'recording into .*/run_{epoch + 2}/bag$')
    # The bag of the epoch before is finished, and holds all cycles of that epoch only.
    bag = run_folder(launcher.out, epoch) / 'bag'
    with BagReader(bag) as reader:
        assert reader.complete
    cycles = read_cycles(bag, epoch).column('n')
    assert np.array_equal(cycles, np.arange(1, len(cycles) + 1))
    assert np.array_equal(cycles, peer.cycles(epoch).column('n'))


@pytest.mark.usefixtures('_anew')
def test_messages_of_an_earlier_epoch_are_refused(peer: Peer) -> None:
    """A plan and a command with stamps from before the reset change nothing, and are counted."""
    plan, command = peer.messages['/<av>/plan'][-1], peer.messages['/<v>/driver_command'][-1]
    commands = peer.publisher('/<v>/driver_command', 'hv0')
    plans = peer.publisher('/<av>/plan', 'av0')
    _reset(peer)
    peer.wait_until(lambda: peer.n > 10, 'n = 10')
    offset_ns = peer.games[-1].scheduler.clock_offset_ns
    assert max(from_time(plan.header.stamp), from_time(command.header.stamp)) < offset_ns
    command.axes = [0.0, 1.0, 0.0]
    seat, refused = 'sim_node: hv0 seat', 'sim_node: av0 plan refused'

    def speak() -> None:
        plans.publish(plan)
        commands.publish(command)

    def counted(name: str) -> bool:
        speak()
        return bool(peer.statuses(seat)) and int(peer.statuses(seat)[-1][1]['outdated']) > 0 \
            if name == seat else bool(peer.statuses(refused))
    peer.wait_until(lambda: counted(refused) and counted(seat), 'both refusals')
    assert f'{from_time(plan.header.stamp)} ns answers no request' \
        in peer.statuses(refused)[-1][0].message
    # The same message with a stamp of this epoch works: full braking is obeyed.
    assert peer.cycles().commands('hv0')[:, 1].max() == 0.0
    command.header.stamp = to_time(offset_ns)

    def braked() -> bool:
        commands.publish(command)
        return peer.cycles().commands('hv0')[:, 1].max() == 1.0
    peer.wait_until(braked, 'the brake')
    for publisher in (commands, plans):
        peer.node.destroy_publisher(publisher)


@pytest.mark.parametrize('factor', [0.5, 2.0])
def test_pace_of_the_clock_follows_the_real_time_factor(peer: Peer, factor: float) -> None:
    """Simulated over steady time is the factor that was set; beyond its bounds it is refused."""
    assert not peer.set_parameter('real_time_factor', 11.0).successful
    assert peer.set_parameter('real_time_factor', factor).successful
    peer.wait_until(lambda n=peer.n: peer.n > n + 10, 'the new pace')
    wall_s, first = time.monotonic(), peer.n
    peer.wait_until(lambda: peer.n >= first + 100 * factor, 'a second')
    # Time lost to long stalls is dropped: the tolerance still tells another factor apart.
    simulated_s = (peer.n - first) * 0.01
    assert simulated_s / (time.monotonic() - wall_s) == pytest.approx(factor, rel=0.3)
    # By the cycles' own measure the schedule was kept: its steps are dt / factor apart.
    cycles = peer.cycles()
    lag_s = cycles.column('cumulative_error_s')[cycles.column('n') >= first]
    assert np.median(np.abs(lag_s)) < 0.01


def test_another_scenario_is_taken_at_the_next_reset(graph: tuple[Launcher, Peer],
                                                     peer: Peer) -> None:
    """The same processes continue: the planner is set up anew and its plans are followed."""
    launcher, _ = graph
    started = launcher.started
    assert peer.set_parameter('scenario', OTHER_SCENARIO).successful
    _reset(peer)
    peer.forget()
    peer.wait_until(lambda: peer.n > 120, 'n = 120 in another scenario')
    assert peer.games[-1].benchmark_id == OTHER_SCENARIO.removesuffix('.xml')
    assert peer.messages['/scenario/xml'][-1].data == (SCENARIOS / OTHER_SCENARIO).read_text()
    # The roundabout's AV begins with 8 m/s, the motorway's with 20 m/s.
    assert peer.states('av0')[0, 4] == pytest.approx(8.0, abs=0.5)
    peer.wait_until(lambda: peer.statuses('sim_node: av0 plans'), 'a report')
    status, values = peer.statuses('sim_node: av0 plans')[-1]
    assert status.message == 'following its plan'
    assert int(values['accepted']) > 5
    assert int(values['refused']) == 0
    assert launcher.started == started
    assert peer.set_parameter('game', str(CUT_IN)).successful


@pytest.mark.parametrize('name', ['/etc/hostname', '../pyproject.toml', '../../etc/passwd',
                                  'no_such.xml'])
def test_files_outside_the_directories_are_refused(peer: Peer, name: str) -> None:
    """A peer can't make the simulation open any file: not by path, and not by `..`."""
    result = peer.set_parameter('scenario', name)
    assert not result.successful
    assert 'in none of the configured directories' in result.reason
    assert name in result.reason


@pytest.mark.usefixtures('_anew')
def test_malformed_scenario_leaves_the_present_game(graph: tuple[Launcher, Peer],
                                                    peer: Peer) -> None:
    """An error names it, and the game that ran begins again."""
    launcher, _ = graph
    text = (SCENARIOS / OTHER_SCENARIO).read_text()
    broken = launcher.out / 'broken.xml'
    broken.write_text(text[:len(text) // 2])
    # The folder of the game file that the run was started with is one of the directories.
    assert peer.set_parameter('scenario', str(broken)).successful
    before = peer.games[-1]
    _reset(peer)
    peer.wait_until(lambda: peer.n > 20, 'n = 20 after a failed change')
    launcher.wait_for(r'broken\.xml.*the present game starts again')
    assert peer.games[-1].scenario_sha256 == before.scenario_sha256
    assert peer.set_parameter('game', str(CUT_IN)).successful
    broken.unlink()


def test_newcomer_in_a_pause_sees_the_world(graph: tuple[Launcher, Peer], peer: Peer) -> None:
    """The states are sent again to a newcomer, unchanged; no time passes."""
    assert peer.call('/sim/pause').success
    peer.listen_for(0.3)
    paused_n, ticks = peer.n, len(peer.messages['/clock'])
    with Peer(graph[0].domain, '/vehicles/state', '/traffic/objects') as newcomer:
        newcomer.wait_until(
            lambda: {'/vehicles/state', '/traffic/objects'} <= newcomer.messages.keys(),
            'the world that stands still')
        peer.listen()
        told, last = newcomer.messages['/vehicles/state'][0], peer.messages['/vehicles/state'][-1]
        assert told.header.stamp == last.header.stamp
        assert told.points[0].positions == last.points[0].positions
    assert peer.n == paused_n and len(peer.messages['/clock']) == ticks


def test_reset_in_a_pause_stays_paused_and_can_be_stepped(peer: Peer) -> None:
    """The new epoch waits at n = 0 for a step or the start."""
    assert peer.call('/sim/pause').success
    _reset(peer)
    peer.wait_until(lambda: peer.n == 0, 'n = 0')
    peer.listen_for(QUIET_S)
    assert peer.n == 0
    assert peer.call('/sim/step').success
    peer.wait_until(lambda: peer.n >= STEPS_PER_TICK, 'the step')
    peer.listen_for(0.3)
    assert peer.n == STEPS_PER_TICK


def test_stop_ends_the_run_well(graph: tuple[Launcher, Peer]) -> None:
    """After a stop the launcher ends the others, and every epoch's recording is finished."""
    launcher, peer = graph
    assert peer.call('/sim/stop').success
    assert launcher.wait() == 0, launcher.text
    assert not any(is_node(pid) for _, pid in launcher.started)
    bags = [bag for folder in run_folders(launcher.out) for bag in bags_of(folder)]
    assert len(bags) == peer.games[-1].epoch + 1
    for bag in bags:
        with BagReader(bag) as reader:
            assert reader.complete
    assert not launcher.says('Traceback')
