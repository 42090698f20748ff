# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run's nodes take its own topics from each other alone, and orders too if they are asked to."""

from collections.abc import Iterator
import json
from pathlib import Path
import signal

from crgame_ros.messages.contract import load_contract
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.run_profile import ORDER_TOPICS, own_topics
from live_peer import Peer
from live_support import CUT_IN, Launcher
import pytest
from rclpy.publisher import Publisher
from std_msgs.msg import String
from std_srvs.srv import Trigger
from steady_game import Run, TOPICS, write_steady_game

STATE = '/sim/state'


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Keep one graph that obeys its own nodes alone."""
    folder = tmp_path_factory.mktemp('strangers')
    with Launcher([write_steady_game(folder), '--own-orders'], folder / 'run') as launcher, \
            Peer(launcher.domain, *TOPICS, STATE) as peer:
        peer.wait_until(lambda: peer.n > 50 and peer.messages[STATE], 'some steps')
        yield Run(launcher, peer)


def _publishers(peer: Peer) -> dict[str, Publisher]:
    """Return publishers of every topic, once all their subscribers have been discovered."""
    endpoints, found = Endpoints(peer.node), {}
    for topic in load_contract().topics.values():
        if topic.available:
            for name in topic.names(('hv0',), ('av0',)):
                found[name] = endpoints.publisher(topic.name, name.split('/')[1])
    # Of a topic that strangers may publish: by then the others are discovered as well.
    peer.wait_until(lambda: found['/av0/plan'].get_subscription_count()
                    == peer.node.count_subscribers('/av0/plan') > 2, 'the readers of plans')
    return found


def test_strangers_are_heard_where_the_contract_says_so(run: Run) -> None:
    """Readers of a topic match a stranger's writer exactly if its producers include external."""
    peer = run.peer
    found, own = _publishers(peer), set(own_topics(('hv0',), ('av0',)))
    open_topics = {name for topic in load_contract().topics.values()
                   if 'external' in topic.producers for name in topic.names(('hv0',), ('av0',))}
    assert open_topics == {
        *ORDER_TOPICS, '/hv0/joy', '/hv0/driver_command', '/av0/driver_command', '/av0/plan',
        '/diagnostics'}

    def heard(name: str) -> int:
        # This test hears itself on some topics.
        return found[name].get_subscription_count() - sum(
            info.node_name == peer.node.get_name()
            for info in peer.node.get_subscriptions_info_by_topic(name))
    for name in sorted(open_topics - {*ORDER_TOPICS}):
        peer.wait_until(lambda name=name: heard(name) > 0, f'those who hear {name}')
    assert [name for name in found if (name in own or name in ORDER_TOPICS) and heard(name)] == []


def test_orders_are_the_pages_alone(run: Run) -> None:
    """With --own-orders a service of the run is not there for other programs."""
    client = run.peer.node.create_client(Trigger, '/sim/stop')
    assert not client.wait_for_service(2.0)
    assert run.peer.node.get_service_names_and_types_by_node('sim_node', '/')


def test_forged_messages_leave_no_trace(run: Run) -> None:
    """The end of the run, another game, old times and states: the recording has its own alone."""
    launcher, peer = run
    found = _publishers(peer)
    state = json.loads(peer.messages[STATE][-1].data)
    found[STATE].publish(String(data=json.dumps(state | {'state': 'ended'})))
    game = json.loads(peer.messages['/scenario/game'][-1].data)
    game['clock_offset_ns'] += 7_000_000_000
    found['/scenario/game'].publish(String(data=json.dumps(game)))
    for _ in range(200):
        for name in ('/clock', '/vehicles/state', '/timing/cycle'):
            found[name].publish(peer.messages[name][0])
        peer.listen_for(0.01)
    run.wait_for_steps(100)
    assert not [status.name for message in peer.messages['/diagnostics']
                for status in message.status if status.name.endswith(': messages refused')]
    n = peer.n
    launcher.kill('recorder_node')
    launcher.wait_for('recording into .*bag_part2')
    run.wait_for_steps(100)
    launcher.signal(signal.SIGINT)
    assert launcher.wait() == 0
    folder = launcher.out
    assert sorted(path.name for path in folder.glob('bag*')) == ['bag', 'bag_part2']
    cycles = read_cycles(folder / 'bag').column('n')
    assert cycles[0] == 1 and cycles[-1] > n and len(set(cycles)) == len(cycles)
    with BagReader(folder / 'bag', parts=True) as reader:
        clock = [message.message.clock for message in reader.decoded(['/clock'])]
        assert len({json.loads(message.message.data)['clock_offset_ns']
                    for message in reader.decoded(['/scenario/game'])}) == 1
    times = [item.sec + 1e-9 * item.nanosec for item in clock]
    # The first time is published again and again until all have heard it.
    assert times == sorted(times)


def test_orders_need_the_run_to_believe_its_nodes(tmp_path: Path) -> None:
    """Both options together are refused in a line."""
    with Launcher([CUT_IN, '--own-orders', '--open-topics'], tmp_path / 'run') as launcher:
        assert launcher.wait() == 2
    assert len(launcher.errors) == 1 and 'without --open-topics' in launcher.errors[0]


def test_a_run_that_goes_on_after_a_forged_end_is_recorded_on(tmp_path: Path) -> None:
    """
    With open topics an end is believed in a pause; the recording is then continued in a part.

    An old time on /clock, and another game, change nothing: two programs publish them.
    """
    with Launcher([write_steady_game(tmp_path), '--open-topics'], tmp_path / 'run') as launcher, \
            Peer(launcher.domain, *TOPICS, STATE) as peer:
        peer.wait_until(lambda: peer.n > 50 and peer.messages[STATE], 'some steps')
        game = json.loads(peer.messages['/scenario/game'][-1].data)
        game['clock_offset_ns'] += 7_000_000_000
        clock, other = peer.publisher('/clock'), peer.publisher('/scenario/game')
        other.publish(String(data=json.dumps(game)))
        for index in range(30):
            clock.publish(peer.messages['/clock'][index % 10])
        peer.listen_for(0.5)
        for publisher in (clock, other):
            peer.node.destroy_publisher(publisher)
        assert peer.call('/sim/pause').success
        state = peer.publisher(STATE)
        peer.listen_for(0.5)
        state.publish(String(data=json.dumps(
            json.loads(peer.messages[STATE][-1].data) | {'state': 'ended'})))
        launcher.wait_for(r'\d+ messages in .*/bag$')
        assert peer.call('/sim/start').success
        launcher.wait_for('recording into .*bag_part2')
        peer.listen_for(0.5)
        assert peer.call('/sim/stop').success
        assert launcher.wait() == 0
    folder = launcher.out
    assert sorted(path.name for path in folder.glob('bag*')) == ['bag', 'bag_part2']
    cycles = read_cycles(folder / 'bag').column('n')
    assert list(cycles) == list(range(1, len(cycles) + 1))
