# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recording is played in a loop, first from its middle: every node begins anew."""

from collections.abc import Iterator
from itertools import pairwise
import os
from pathlib import Path
import subprocess
import sys
from threading import Thread
from typing import NamedTuple

from bag_player import BagPlayer
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.ros.messages import from_time
from live_peer import Peer
from live_support import Launcher, PATIENCE_S, SCENARIOS
from page_client import PageClient
import pytest
from ros_domains import own_domain_id
from visualization_msgs.msg import Marker

DURATION_S = 4.0
# Where the last round begins: without documents, which are known from the one before.
OFFSET_S = 0.5
# The rounds: from the middle, as a whole while the planner is loaded, as a whole, from OFFSET_S.
MIDDLE, LOADING, WHOLE, LATER = range(4)
# The listening nodes, with their parameters; the topics that they publish are not played.
NODES = {'marker_node': (), 'timesync_node': (), 'map_node': (), 'drivability_node': (),
         'criticality_node': (),
         'perception_node': ('vehicle:=av0',), 'planner_node': ('vehicle:=av0',),
         'recorder_node': ('directory:={folder}/bag',),
         'cockpit_node': ('port:=8650', 'directory:={folder}/cockpit')}
THEIRS = ('/markers', '/timing/frame_skip', '/occupancy', '/hv0/drivability', '/av0/drivability',
          '/criticality', '/av0/plan_request', '/av0/localization', '/av0/scan', '/av0/plan',
          '/av0/plan_path', '/diagnostics')
HEARD = ('/markers', '/criticality', ('/<v>/drivability', 'av0'), ('/<av>/plan_request', 'av0'),
         ('/<av>/plan', 'av0'), '/diagnostics', '/timing/frame_skip')


class Played(NamedTuple):
    """
    Results of a recording that was played from its middle, twice as a whole, and later on.

    :ivar peer: it received all messages.
    :ivar begun: how many messages of each topic had come when each round began.
    :ivar pages: scenes that the page had got by then.
    :ivar lines: output of each node.
    :ivar codes: how each node ended.
    """

    folder: Path
    peer: Peer
    begun: list[dict[str, int]]
    scenes: list[int]
    lines: dict[str, list[str]]
    codes: dict[str, int]

    def stamps_s(self, topic: str, index: int) -> list[float]:
        """Return the stamps of the messages of one of the rounds [s]."""
        ends = [*self.begun[1:], {name: len(found) for name, found in self.peer.messages.items()}]
        heard = self.peer.messages[topic][self.begun[index].get(topic, 0):
                                          ends[index].get(topic, 0)]
        return [from_time(message.header.stamp) * 1e-9 for message in heard]


pytestmark = pytest.mark.clock


@pytest.fixture(scope='module')
def played(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Played]:
    """Record 4 s of a game with perception, and play them for all nodes."""
    folder = tmp_path_factory.mktemp('played')
    with Launcher([SCENARIOS / 'fog.yaml', '--duration', str(DURATION_S)],
                  folder / 'run') as launcher:
        assert launcher.wait() == 0, launcher.text
    domain = own_domain_id()
    processes = {name: subprocess.Popen(
        [sys.executable, '-m', f'crgame_ros.nodes.{name}', '--ros-args',
         *(word for item in parameters for word in ('-p', item.format(folder=folder)))],
        env=os.environ | {'ROS_DOMAIN_ID': str(domain)}, text=True, stdin=subprocess.DEVNULL,
        stdout=(folder / f'{name}.log').open('w'), stderr=subprocess.STDOUT)
        for name, parameters in NODES.items()}
    player = BagPlayer(folder / 'run' / 'bag', domain, THEIRS)
    begun: list[dict[str, int]] = []
    scenes: list[int] = []
    with Peer(domain, *HEARD) as peer:
        def counts() -> dict[str, int]:
            return {topic: len(found) for topic, found in peer.messages.items()}

        def play(start_offset_s: float) -> None:
            begun.append(counts())
            scenes.append(0 if page is None else sum(
                item['type'] == 'scene' for item in list(page.events)))
            thread = Thread(target=player.play, args=(start_offset_s,))
            thread.start()
            while thread.is_alive():
                peer.listen()
            peer.listen_for(0.3)

        page = None
        try:
            peer.wait_until(lambda: all(
                player.publishers[topic].get_subscription_count() >= count for topic, count in (
                    ('/vehicles/state', 5), ('/timing/cycle', 3), ('/scenario/game', 8),
                    ('/av0/true_request', 1))), 'all listeners')
            play(player.start_s + OFFSET_S)
            play(0.0)
            # A planner's code is loaded when a game names it first: seconds on a slow machine.
            peer.wait_until(lambda: peer.messages['/<av>/plan'], 'the planner')
            play(0.0)
            page = PageClient('http://127.0.0.1:8650')
            play(player.start_s + OFFSET_S)
            scenes.append(sum(item['type'] == 'scene' for item in page.events))
        finally:
            if page is not None:
                page.close()
            player.close()
            for process in processes.values():
                process.terminate()
            codes = {name: process.wait(PATIENCE_S) for name, process in processes.items()}
        lines = {name: (folder / f'{name}.log').read_text().splitlines() for name in NODES}
        print('\n'.join(line for found in lines.values() for line in found))
        yield Played(folder, peer, begun, scenes, lines, codes)


def test_no_node_dies_or_complains(played: Played) -> None:
    """Each node stays the same process and ends in good order; no error is reported."""
    assert played.codes == dict.fromkeys(NODES, 0)
    wrong = [line for found in played.lines.values() for line in found
             if 'ERROR' in line or 'Traceback' in line or 'error' in line.lower()]
    assert wrong == []


@pytest.mark.parametrize('node', ['marker_node', 'timesync_node', 'recorder_node'])
def test_without_documents_it_is_told_once_why_nothing_happens(played: Played, node: str) -> None:
    """From its middle on a recording has no documents; 2 s later that is reported."""
    told = [line for line in played.lines[node] if '/scenario/game' in line]
    assert len(told) == 1 and '--start-offset' in told[0]


def test_markers_are_deleted_and_drawn_anew(played: Played) -> None:
    """Without documents there are no markers; then each round's scene comes within a second."""
    messages = played.peer.messages['/markers']
    begun = [count.get('/markers', 0) for count in played.begun]
    assert begun[MIDDLE] == begun[LOADING] == 0
    rounds = [slice(*ends) for ends in pairwise([*begun, len(messages)])][LOADING:]
    for heard in rounds:
        assert any(message.markers[0].action == Marker.DELETEALL
                   for message in messages[heard])
    offset_s = _offset_s(played)
    for heard in rounds:
        boxes = [from_time(item.header.stamp) * 1e-9 - offset_s
                 for message in messages[heard] for item in message.markers
                 if item.ns == 'vehicles']
        assert min(boxes) < OFFSET_S + 1.0 and max(boxes) > DURATION_S - 0.5


def _offset_s(played: Played) -> float:
    return read_trajectories(played.folder / 'run' / 'bag').game.scheduler.clock_offset_ns * 1e-9


@pytest.mark.parametrize('topic', ['/<v>/drivability', '/<av>/plan_request', '/<av>/plan'])
def test_verdicts_perception_and_plans_begin_anew(played: Played, topic: str) -> None:
    """In each round with documents they begin within a second and go to the end."""
    offset_s = _offset_s(played)
    assert played.stamps_s(topic, MIDDLE) == []
    for index in (WHOLE, LATER) if topic == '/<av>/plan' else (LOADING, WHOLE, LATER):
        stamps = [stamp - offset_s for stamp in played.stamps_s(topic, index)]
        assert min(stamps) < OFFSET_S + 1.0 and max(stamps) > DURATION_S - 1.2
        assert stamps == sorted(stamps)


def test_timing_is_measured_anew(played: Played) -> None:
    """The counts of cycles grow within a round and never hold two of them."""
    cycles = [int(values['cycles']) for status, values in
              played.peer.statuses('timesync_node: table I')]
    assert max(cycles) <= DURATION_S * 100
    assert sum(later < earlier for earlier, later in pairwise(cycles)) == 2
    refused = [values for status, values in played.peer.statuses('timesync_node: refused')]
    assert refused == [] or all(values.get('/timing/cycle', '0') == '0' for values in refused)


def test_each_round_is_a_recording_of_its_own(played: Played) -> None:
    """Nothing is lost once the game is known: each bag holds what was played, and is a run."""
    bags = sorted(path for path in played.folder.glob('bag*'))
    assert [bag.name for bag in bags] == ['bag', 'bag_2', 'bag_3']
    original = read_trajectories(played.folder / 'run' / 'bag')
    for bag, offset_s in zip(bags, (0.0, 0.0, OFFSET_S), strict=True):
        with BagReader(bag) as reader:
            counts = {name: topic.message_count for name, topic in reader.topics.items()}
        log = read_trajectories(bag)
        assert log.ks[0] - original.ks[0] <= 10.0 * offset_s + 1.0
        assert abs(int(log.ks[-1] - original.ks[-1])) <= 1
        for topic in ('/vehicles/state', '/timing/cycle'):
            # On a busy machine some from before publisher and subscriber met may be missing.
            assert counts[topic] >= (DURATION_S - offset_s) * 100 * 0.95


def test_the_page_gets_the_scene_again(played: Played) -> None:
    """The page drops the old scene, and goes on with the steps of the new round."""
    assert played.scenes[-1] > played.scenes[-2] >= 0
