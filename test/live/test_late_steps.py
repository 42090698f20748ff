# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The causes of late steps are reported, in the recording and after the run."""

from collections.abc import Iterator
from contextlib import contextmanager
import json
import os
from pathlib import Path
import subprocess
import sys
import time

from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.ros.messages import from_time
from crgame_ros.timing.late_step import CAUSE_WORDS
from live_peer import Peer
from live_support import Launcher
import pytest
from rcl_interfaces.srv import GetParameters
from steady_game import write_steady_game

pytestmark = pytest.mark.clock
STOPPED_S = 0.15
# sim_node takes some tens of milliseconds to answer for so many names.
NAMES = 15_000
HOG = 'import os\nwhile os.getppid() > 1: pass'


@contextmanager
def kept_busy(pid: int) -> Iterator[None]:
    """Keep the only processor of a process busy with processes of higher priority."""
    processor = {min(os.sched_getaffinity(pid))}
    for task in Path(f'/proc/{pid}/task').iterdir():
        os.sched_setaffinity(int(task.name), processor)
        os.setpriority(os.PRIO_PROCESS, int(task.name), 19)
    hogs = [subprocess.Popen([sys.executable, '-c', HOG]) for _ in range(2)]
    try:
        for hog in hogs:
            os.sched_setaffinity(hog.pid, processor)
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


def ask_for_much(peer: Peer) -> None:
    """Call a service of the simulation that takes long to answer."""
    client = peer.node.create_client(GetParameters, '/sim_node/get_parameters')
    peer.wait_until(client.service_is_ready, 'the parameters of sim_node')
    future = client.call_async(GetParameters.Request(names=['real_time_factor'] * NAMES))
    peer.wait_until(future.done, 'an answer about parameters')
    peer.node.destroy_client(client)


def published_ns(slot: PolledSubscription) -> dict[int, int]:
    """Return the time at which each waiting message was published [ns], by its stamp."""
    found = {}
    while (taken := slot.pop_timed()) is not None:
        found[from_time(taken[0].header.stamp)] = taken[1]
    return found


def test_late_steps_of_a_run_are_told_with_their_causes(tmp_path: Path) -> None:
    """Three causes in turn: a stop by a signal, a long service call, and no processor."""
    with Launcher([write_steady_game(tmp_path), '--duration', 6], tmp_path / 'run') as launcher, \
            Peer(launcher.domain, '/diagnostics', '/clock') as peer:
        endpoints = Endpoints(peer.node)
        odometry = endpoints.polled('/<v>/odom', 'hv0', depth=2000)
        requests = endpoints.polled('/<av>/plan_request', 'av0', depth=200)
        peer.wait_until(lambda: len(peer.messages['/clock']) > 100, 'the hundredth step')
        launcher.freeze('sim_node')
        time.sleep(STOPPED_S)
        launcher.thaw('sim_node')
        ask_for_much(peer)
        with kept_busy(launcher.node('sim_node')):
            time.sleep(0.5)
        assert launcher.wait() == 0, launcher.text
        peer.listen()
        shown_ns, asked_ns = published_ns(odometry), published_ns(requests)
        assert 'ms late at' in peer.statuses('timesync_node: table I')[-1][1]['worst_late_step']
    # A driver sees the result of its command before planners are asked anything.
    both = shown_ns.keys() & asked_ns.keys()
    assert len(both) > 20 and all(shown_ns[stamp] < asked_ns[stamp] for stamp in both)
    cycles = read_cycles(tmp_path / 'run' / 'bag')
    if not cycles.column('late_processor_s').any():
        pytest.skip('this kernel has no schedstat')
    assert cycles.column('late_stopped_s').max() > STOPPED_S - 0.02
    assert cycles.column('late_services_s').max() > 0.005
    assert cycles.column('late_processor_s').max() > 0.02
    late = json.loads((tmp_path / 'run' / 'timing.json').read_text())['late_steps']
    assert late['count'] >= 3
    for cause in ('stopped', 'services', 'processor'):
        told_ms = 1e3 * cycles.column(f'late_{cause}_s').sum()
        assert late['by_cause'][cause]['ms'] == pytest.approx(told_ms)
    assert sum(entry['steps'] for entry in late['by_cause'].values()) == late['count']
    for step in late['worst']:
        assert sum(step['causes_ms'].values()) == pytest.approx(step['late_ms'])
        assert CAUSE_WORDS[step['cause']] in step['text']
