# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A graph whose nodes are started one by one, as examples/nine_nodes.sh does."""

from collections.abc import Iterator
import os
from pathlib import Path
import signal
import subprocess
import sys

from crgame_ros.recording.conversion import read_last_run
from crgame_ros.recording.metadata import TopicQos
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.recording.writer import BagWriter
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.environment import PROFILE_VARIABLES
from live_peer import Peer
from live_support import PATIENCE_S, ROOT
import numpy as np
import pytest
from ros_domains import own_domain_id
from std_msgs.msg import String

LATCHED = TopicQos(1, 'reliable', 'transient_local')


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Run it, kill the recorder in mid-run and start another one by hand."""
    folder = tmp_path_factory.mktemp('by_hand')
    environment = os.environ | {'ROS_DOMAIN_ID': str(own_domain_id()),
                                'CRGAME_PYTHON': sys.executable}
    with (folder / 'log').open('w') as log, subprocess.Popen(
            [ROOT / 'examples' / 'nine_nodes.sh', 'cut_in', '600', folder], env=environment,
            cwd=ROOT, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
            start_new_session=True) as script:
        recorder = None
        try:
            with Peer(int(environment['ROS_DOMAIN_ID']), '/clock', '/scenario/game',
                      '/diagnostics') as peer:
                peer.wait_until(lambda: peer.n > 200, 'n = 200')
                forge_an_end(peer)
                os.kill(_child(script.pid, 'recorder_node'), signal.SIGKILL)
                recorder = subprocess.Popen(
                    [sys.executable, '-m', 'crgame_ros.nodes.recorder_node', '--ros-args',
                     '-p', f'directory:={folder / "bag"}'], cwd=ROOT,
                    env=environment | dict.fromkeys(
                        PROFILE_VARIABLES, str(folder / 'fastdds.xml')),
                    stdin=subprocess.DEVNULL, stdout=log, stderr=log)
                peer.wait_until(lambda: any(
                    status.message == 'recording into bag_part2' for status, _ in
                    peer.statuses('recorder_node: recording')), 'the second part')
                last = peer.n + 100
                peer.wait_until(lambda: peer.n > last, f'n = {last}')
                assert peer.call('/sim/stop').success
            assert script.wait(PATIENCE_S) == 0, (folder / 'log').read_text()
            recorder.terminate()
            assert recorder.wait(PATIENCE_S) == 0
        finally:
            # The script's nodes are in its group; they outlive it if it is killed alone.
            if script.poll() is None:
                os.killpg(script.pid, signal.SIGKILL)
            if recorder is not None and recorder.poll() is None:
                recorder.kill()
        yield folder


def forge_an_end(peer: Peer) -> None:
    """Say that the run has ended, on its own topic; all readers of plans hear strangers."""
    endpoints = Endpoints(peer.node)
    plan, state = (endpoints.publisher(name, 'av0') for name in ('/<av>/plan', '/sim/state'))
    peer.wait_until(lambda: plan.get_subscription_count() > 2, 'the readers of plans')
    state.publish(String(data='{"state": "ended"}'))
    assert state.get_subscription_count() == 0


def _child(parent: int, name: str) -> int:
    """Return the process of a node that a script has started."""
    for pid in Path(f'/proc/{parent}/task/{parent}/children').read_text().split():
        if name in Path(f'/proc/{pid}/comm').read_text():
            return int(pid)
    raise AssertionError(f'there is no {name}')


def test_a_killed_recorder_is_continued_by_the_next(folder: Path) -> None:
    """It finds the bag of the same run, and both are read as one recording."""
    assert 'Traceback' not in (folder / 'log').read_text()
    assert sorted(path.name for path in folder.glob('bag*')) == ['bag', 'bag_part2']
    cycles = read_cycles(folder / 'bag').column('n')
    assert cycles[0] == 1 and cycles[-1] > 300 and len(set(cycles)) == len(cycles)
    assert list(folder.glob('*.xml'))


def test_a_bag_whose_clock_was_set_back_is_read_as_the_run_was(
        folder: Path, tmp_path: Path) -> None:
    """As others record: the second half is logged 3 s before the first half ends."""
    with BagReader(folder / 'bag', parts=True) as reader:
        writer = BagWriter(tmp_path / 'bag', now_ns=lambda: 0)
        channels = {name: writer.add_topic(name, topic.type_name, LATCHED)
                    for name, topic in reader.topics.items()}
        middle_ns = (reader.start_ns + reader.end_ns) // 2
        for message in reader.messages():
            back_ns = 3_000_000_000 if message.log_time_ns > middle_ns else 0
            writer.write(channels[message.topic], message.data, message.log_time_ns - back_ns)
        writer.close()
    whole, back = read_last_run(folder / 'bag'), read_last_run(tmp_path / 'bag')
    assert np.array_equal(whole.ks, back.ks)
    assert np.array_equal(whole.vehicle_states, back.vehicle_states)
    assert np.array_equal(read_cycles(folder / 'bag').rows, read_cycles(tmp_path / 'bag').rows,
                          equal_nan=True)
