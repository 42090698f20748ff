# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""No message ends a process, takes over a run, or costs its files."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
import json
import math
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from builtin_interfaces.msg import Time
from commonroad.common.file_reader import CommonRoadFileReader
from hostile import code, games, messages
from live_peer import Peer
from live_support import is_node, Launcher, SCENARIOS
import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rclpy._rclpy_pybind11 import RCLError
from rclpy.publisher import Publisher
from std_msgs.msg import String
from steady_game import Run

TOPICS = ('/clock', '/scenario/xml', '/scenario/objects', '/scenario/game', '/timing/cycle',
          '/vehicles/state', '/traffic/objects', '/traffic/agents', '/seats', '/diagnostics',
          '/sim/state', ('/<av>/plan', 'av0'), ('/<v>/driver_command', 'hv0'))
# With open topics: a graph of nodes that were started one by one has no others.
# Every node that reads anything: perception, traffic, a driver, and the rest.
GAME = f"""
scenario: {SCENARIOS / 'ZAM_DenseMerge-1_1_T-1.xml'}
duration: 3600
humans:
  - id: hv0
    driver: joy:steady.joy.yaml
    spawn: {{lanelet: 51, s: 255.0, d: 0.0, speed: 12.0}}
avs:
  - id: av0
    planning_problem: 100
    planner: idm
    perception:
      sensors: [{{name: front, field_of_view: 2.0, horizon: 60.0, rays: 91, rate: 10.0}}]
traffic: {{agents: 6, flow: 200, seed: 17}}
"""
THROTTLE = 0.1
TIMELINE = f"""
joy:
  axes: [throttle, brake, steering]
  points: [[0.0, {THROTTLE}, 0.0, 0.0], [3600.0, {THROTTLE}, 0.0, 0.0]]
"""
PROOF = 'import pathlib\npathlib.Path({path!r}).write_text("run")\n'


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Keep one graph: whatever is sent, it must be whole for the next test."""
    folder = tmp_path_factory.mktemp('hostile')
    (folder / 'steady.joy.yaml').write_text(TIMELINE)
    (folder / 'hostile.yaml').write_text(GAME)
    with Launcher([folder / 'hostile.yaml', '--open-topics'], folder / 'run',
                  headless=False) as launcher, Peer(launcher.domain, *TOPICS) as peer:
        peer.wait_until(lambda: peer.n > 100, 'the first second')
        for topic in ('/traffic/agents', '/traffic/objects', '/<av>/plan', '/scenario/xml'):
            peer.wait_until(lambda topic=topic: peer.messages[topic], topic)
        yield Run(launcher, peer)


class Sender:
    """Sends on any topic; its publishers stay."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        self._publishers: dict[tuple[str, str], Publisher] = {}

    def meet(self, topics: Iterable[tuple[str, str]]) -> None:
        """Wait until all subscribers of these topics hear this sender."""
        for topic, vehicle in topics:
            if (topic, vehicle) not in self._publishers:
                self._publishers[topic, vehicle] = self._peer.publisher(topic, vehicle)

    def send(self, topic: str, vehicle: str, message: object) -> None:
        """Send a message, or bytes that claim to be one."""
        self.meet([(topic, vehicle)])
        # The middleware itself sends no bytes that cannot be a message of a fixed size.
        with suppress(RCLError):
            self._publishers[topic, vehicle].publish(message)

    def send_until_refused(self, topic: str, message: object, node: str, reason: str) -> None:
        """Send a message again and again, until a node tells of its refusal."""
        def is_refused() -> bool:
            self.send(topic, '', message)
            self._peer.listen_for(1.0)
            return any(reason in status.message
                       for status, _ in self._peer.statuses(f'{node}: messages refused'))
        self._peer.wait_until(is_refused, f'the refusal of {topic}')

    def close(self) -> None:
        """Remove the publishers, and with them their latched messages."""
        for publisher in self._publishers.values():
            self._peer.node.destroy_publisher(publisher)


def _whole(run: Run, pids: dict[str, int]) -> None:
    """Check that no node has ended, and that the run goes on."""
    launcher, peer = run
    assert dict(launcher.started) == pids, 'a node was started again'
    assert [name for name, pid in pids.items() if not is_node(pid)] == []
    peer.forget()
    run.wait_for_steps(100)
    peer.wait_until(lambda: peer.messages['/<av>/plan'] and peer.messages['/traffic/agents'],
                    'plans and agents')
    assert not launcher.says('Traceback')
    assert [line for line in launcher.errors if 'Traceback' in line] == []


@pytest.mark.exhaustive
def test_no_message_ends_a_node_or_the_run(run: Run) -> None:
    """More than 300 messages on 24 topics are refused and counted; all vehicles drive on."""
    launcher, peer = run
    pids, sender, sent = dict(launcher.started), Sender(peer), 0
    names = [list(peer.messages[topic][-1].joint_names) for topic in (
        '/vehicles/state', '/traffic/objects', '/traffic/agents')]
    sender.meet((topic, vehicle) for topic, vehicle, _ in messages(Time(), *names))
    for topic, vehicle, message in messages(peer.messages['/clock'][-1].clock, *names):
        sender.send(topic, vehicle, message)
        sent += 1
        if sent % 10 == 0:
            peer.listen_for(0.1)
    assert sent > 300
    peer.listen_for(2.0)
    sender.close()
    told = {status.name.split(':')[0] for message in peer.messages['/diagnostics']
            for status in message.status if status.name.endswith(': messages refused')}
    _whole(run, pids)
    for node in ('sim_node', 'planner_node_av0', 'perception_node_av0', 'traffic_node',
                 'drivability_node', 'timesync_node', 'recorder_node', 'cockpit_node'):
        assert node in told, f'{node} told of no refusal'


def test_no_game_ends_a_node_or_names_code_that_is_run(run: Run, tmp_path: Path) -> None:
    """Invalid documents are reported and dropped; code that they name is not imported."""
    launcher, peer = run
    pids, sender = dict(launcher.started), Sender(peer)
    good = peer.messages['/scenario/game'][-1].data
    proof = tmp_path / 'was_run'
    (tmp_path / 'planner.py').write_text(PROOF.format(path=str(proof)))
    sender.meet((topic, '') for topic in (
        '/scenario/xml', '/scenario/objects', '/scenario/game'))
    # Forget the documents that the test before has sent now, instead of at the next reset.
    for topic in ('/scenario/xml', '/scenario/objects'):
        sender.send(topic, '', peer.messages[topic][0])
    for text in games(good):
        sender.send('/scenario/game', '', String(data=text))
        peer.listen_for(0.05)
    sender.send('/scenario/game', '', String(data=code(good, str(tmp_path / 'planner.py'))))
    peer.wait_until(lambda: launcher.says('only a message names'), 'the refusal of the code')
    assert not proof.exists()
    sender.send('/scenario/game', '', String(data=good))
    peer.listen_for(1.0)
    sender.close()
    # The test's own node has received all these messages, too.
    peer.messages['/scenario/game'][:] = [String(data=good)]
    _whole(run, pids)


def test_bad_orders_and_numbers_cost_the_run_nothing(run: Run) -> None:
    """
    Orders at which a callback raises, states hours ahead and infinite rows are refused.

    The runs of other tests end with the conversion of what was recorded.
    """
    launcher, peer = run
    pids, sender = dict(launcher.started), Sender(peer)
    for name in ('x' * 300, 'a\0b', '../' * 2_000):
        assert not peer.set_parameter('game', name).successful
    # rclpy itself raises for a type that there is not: the caller gets no answer.
    peer.send_parameter(Parameter(name='game', value=ParameterValue(type=200)))
    sender.meet((topic, '') for topic in ('/vehicles/state', '/timing/cycle'))
    state = peer.messages['/vehicles/state'][-1]
    state.header.stamp.sec += 20_000
    sender.send('/vehicles/state', '', state)
    for value in (math.inf, math.nan):
        cycle = peer.messages['/timing/cycle'][-1]
        cycle.data[0] = value
        sender.send('/timing/cycle', '', cycle)
    ended = json.loads(peer.messages['/sim/state'][-1].data) | {'state': 'ended'}
    peer.forget()
    # Where the machine is so late that the clock is silent for seconds, the recorder takes the end
    # for true and goes on in another part. Then the next one is refused.
    sender.send_until_refused('/sim/state', String(data=json.dumps(ended)),
                              'recorder_node', 'the end of a run that goes on')
    sender.close()
    _whole(run, pids)
    peer.wait_until(lambda: len(peer.statuses('recorder_node: recording')) > 1, 'two reports')
    # On a machine that is late, the recording may go on in another part.
    assert all(status.message.startswith('recording into bag')
               for status, _ in peer.statuses('recorder_node: recording'))
    assert peer.call('/sim/pause').success and peer.call('/sim/start').success


@pytest.mark.clock
def test_a_flood_takes_no_place(run: Run) -> None:
    """
    Under hundreds of foreign plans, agents and commands a second the real ones arrive.

    Nine of ten must: the flood costs the machine time, too.
    """
    launcher, peer = run
    pids = dict(launcher.started)

    def report() -> tuple[dict[str, str], dict[str, str]]:
        peer.forget()
        peer.wait_until(lambda: peer.statuses('sim_node: av0 plans')
                        and peer.statuses('sim_node: hv0 seat'), 'a report')
        return run.counters(), peer.statuses('sim_node: hv0 seat')[-1][1]

    before, _ = report()
    flood = subprocess.Popen([sys.executable, Path(__file__).with_name('flood.py'), '6'],
                             env=os.environ | {'ROS_DOMAIN_ID': str(launcher.domain)})
    try:
        while flood.poll() is None:
            peer.listen()
    finally:
        flood.kill()
    assert flood.wait() == 0
    pedal = peer.cycles().commands('hv0')[:, 0]
    assert np.mean(np.abs(pedal - THROTTLE) < 1e-6) > 0.9
    after, seat = report()
    asked, accepted, refused = (int(after[name]) - int(before[name])
                                for name in ('requests', 'accepted', 'refused'))
    assert accepted > 0.9 * asked > 10
    assert after['steps_without_plan'] == before['steps_without_plan']
    assert refused > 500 and int(seat['passed_over']) > 500
    assert not any(status.message.startswith('agents are')
                   for status, _ in peer.statuses('sim_node: traffic'))
    _whole(run, pids)


@pytest.mark.exhaustive
def test_the_run_has_its_files(run: Run) -> None:
    """After these attacks the bag, scenario, timing and game are there."""
    launcher, peer = run
    assert peer.n > 500
    time.sleep(1.0)
    launcher.signal(signal.SIGINT)
    assert launcher.wait() == 0
    folder = launcher.out
    assert json.loads((folder / 'timing.json').read_text())['cycles'] > 500
    # A whole forged game is another run to the recorder: it may have got a recording of its own.
    found = [path for path in folder.glob('*.xml') if not path.name.startswith('bag_')]
    assert len(found) == 1
    scenario, _ = CommonRoadFileReader(found[0]).open()
    assert scenario.obstacle_by_id(100) is not None or scenario.obstacles
    assert (folder / 'game.yaml').is_file() and list((folder / 'bag').glob('*.mcap'))
