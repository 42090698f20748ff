# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Events change agents in their own process: the same bits as offline, also after a restart."""

from pathlib import Path

from crgame_ros.game.game import load_game
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.recorded_game import read_run_events, with_recorded_events
from crgame_ros.ros.messages import from_time
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from live_peer import Peer
from live_support import Launcher, SCENARIOS
import numpy as np
from numpy.typing import NDArray
import pytest
from std_msgs.msg import String
import yaml

pytestmark = pytest.mark.clock

# Seconds after the start at which the button is pressed, and traffic_node is killed.
PRESSED_S, KILLED_S = 2.5, 6.0
RESUMED = 'going on at k'
CRAWL = 3.0


def write_game(folder: Path) -> Path:
    """Write a game of traffic alone: one agent speeds up after 1 s; a button slows all agents."""
    values = yaml.safe_load((SCENARIOS / 'intersection.yaml').read_text())
    values |= {
        'scenario': str(SCENARIOS / values['scenario']), 'duration': 600, 'humans': [],
        'avs': [], 'traffic': {'agents': 12, 'flow': 200.0, 'late_yielders': 0.5}, 'events': [
            {'name': 'hurry', 'when': {'time': 1.0}, 'traffic': {
                'agent': 't1', 'desired_speed': 25.0, 'options': {'max_acceleration': 3.0}}},
            {'name': 'crawl', 'traffic': {'agent': 'all', 'desired_speed': CRAWL,
                                          'reaction_time': 0.3, 'imperfection': 0.1}}]}
    path = folder / 'game.yaml'
    path.write_text(yaml.safe_dump(values))
    return path


def told(bag: Path, scheduler: ScenarioScheduler) -> dict[int, NDArray[np.float64]]:
    """Return poses and velocities (2, A, 3) that traffic_node published in a run, by tick."""
    found = {}
    with BagReader(bag) as reader:
        for item in reader.decoded(['/traffic/agents']):
            n = scheduler.tick_of_stamp(from_time(item.message.header.stamp))
            if n is not None:
                point = item.message.points[0]
                found[scheduler.k(n)] = np.array(
                    (point.positions, point.velocities)).reshape(2, -1, 3)
    return found


def test_agents_obey_events_to_the_same_bits_and_after_a_restart(tmp_path: Path) -> None:
    """
    Until the node is killed the states equal those offline with the recorded events.

    The process that replaces it knows from /scenario/events alone that all agents are slow.
    """
    game = write_game(tmp_path)
    with Launcher([game], tmp_path / 'run') as launcher, \
            Peer(launcher.domain, '/clock', '/scenario/game', '/traffic/agents') as peer:
        # On a busy machine the first run starts without its traffic; the next one has it.
        peer.wait_until(lambda: peer.messages['/traffic/agents'], 'agents')
        assert peer.call('/sim/reset').success
        peer.wait_until(lambda: len(peer.games) > 1 and peer.n > 0, 'another run')
        scheduler = peer.games[-1].scheduler
        peer.wait_until(lambda: peer.n > 100 * PRESSED_S, 'some seconds')
        peer.publisher('/trigger').publish(String(data='crawl'))
        peer.wait_until(lambda: peer.n > 100 * KILLED_S, 'some seconds more')
        # It may have reported this before: on a busy machine it is late at the start of a run.
        times = launcher.text.count(RESUMED)
        launcher.kill('traffic_node')
        peer.wait_until(lambda: launcher.text.count(RESUMED) > times, 'agents that go on')
        back, times = peer.n, launcher.text.count(RESUMED)
        while peer.n <= back + 300:
            peer.listen_for(0.1)
            if launcher.text.count(RESUMED) > times:
                # On a busy machine it was late, and the agents stood again.
                back, times = peer.n, launcher.text.count(RESUMED)
        assert peer.call('/sim/stop').success
        assert launcher.wait() == 0, launcher.text
    bag = tmp_path / 'run' / 'run_2' / 'bag'
    fired = read_run_events(bag).fired
    assert [(event.name, event.by) for event in fired] == [
        ('hurry', 'condition'), ('crawl', 'trigger')]
    setup = build_setup(with_recorded_events(load_game(game), fired))
    offline = run_offline(setup, duration_s=KILLED_S)
    agents = told(bag, scheduler)
    columns, compared = setup.agent_columns, 0
    for k in range(int(10 * KILLED_S)):
        if k in agents:
            assert agents[k][0].tobytes() == offline.object_poses[k, columns].tobytes(), k
            assert agents[k][1].tobytes() == offline.object_velocities[k, columns].tobytes(), k
            compared += 1
    assert compared > 10 * KILLED_S - 10
    # Both events had an effect.
    speed = np.hypot(*np.moveaxis(offline.object_velocities[:, columns, :2], -1, 0))
    hurrying = [item.id for item in setup.traffic.descriptions].index('t1')
    free = run_offline(build_setup(load_game(game)), duration_s=0.9)
    assert np.array_equal(free.object_poses[:10], offline.object_poses[:10], equal_nan=True)
    assert speed[fired[1].k, hurrying] > np.nanmax(speed[10, hurrying]) + 2.0
    assert np.nanmedian(speed[-1]) < np.nanmedian(speed[fired[1].k]) - 2.0
    # Without the event they would be at 4.5 m/s, 3 s after they stood without news.
    last = np.hypot(*agents[max(agents)][1][:, :2].T)
    assert max(agents) >= (back + 290) // 10
    assert CRAWL - 1.0 < np.nanmax(last) < CRAWL + 1.0
