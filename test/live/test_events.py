# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Events in a running graph: triggers over DDS, planners that change, a recording that repeats."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from crgame_ros.game.documents import EVENTS
from crgame_ros.game.events import AtStep, FiredEvent
from crgame_ros.game.game import load_game
from crgame_ros.recording.recorded_game import (
    read_run_events,
    recorded_inputs,
    with_replayed_events,
)
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.ros.messages import from_time
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from live_peer import Peer
from live_support import Launcher, SCENARIOS
import numpy as np
import pytest
from rclpy.publisher import Publisher
from std_msgs.msg import String

CROSSING = SCENARIOS / 'crossing.yaml'
TOPICS = ('/clock', '/scenario/game', '/scenario/events', '/traffic/objects', '/diagnostics',
          '/vehicles/state', ('/<av>/plan_request', 'av0'))
STEPS_PER_TICK = 10
SLOW = 30.0 / 3.6


class Stage(NamedTuple):
    """A graph that runs, a node that listens to it, and its button."""

    launcher: Launcher
    peer: Peer
    button: Publisher

    @property
    def fired(self) -> tuple[FiredEvent, ...]:
        """Return what has taken effect in the present epoch, as published last."""
        events = EVENTS.read(self.peer.messages['/scenario/events'][-1].data)
        assert events.epoch == self.peer.games[-1].epoch
        return events.fired

    def press(self, *names: str) -> None:
        """Trigger events and wait until they have taken effect."""
        for name in names:
            self.button.publish(String(data=name))
        self.peer.wait_until(lambda: {event.name for event in self.fired} >= set(names),
                             f'the events {names}')

    def said_by_planner(self, text: str) -> int:
        """Count the lines of the AV's planner that hold a text."""
        return sum('planner_node_av0]' in line and text in line
                   for line in list(self.launcher.lines))


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Launcher, Peer]]:
    """Start the game of the crossing."""
    folder = tmp_path_factory.mktemp('events')
    with Launcher([CROSSING, '--duration', 600], folder / 'run') as launcher, \
            Peer(launcher.domain, *TOPICS) as peer:
        peer.wait_until(lambda: peer.n > 0, 'the first step')
        yield launcher, peer


def _epoch_of_events(peer: Peer) -> int:
    """Return the epoch of the newest list of fired events."""
    return EVENTS.read(peer.messages['/scenario/events'][-1].data).epoch


@pytest.fixture
def stage(graph: tuple[Launcher, Peer]) -> Iterator[Stage]:
    """Begin the game again."""
    launcher, peer = graph
    epoch = peer.games[-1].epoch
    assert peer.call('/sim/reset').success
    peer.wait_until(lambda: peer.games[-1].epoch > epoch and peer.n > 0
                    and _epoch_of_events(peer) == peer.games[-1].epoch, 'a new epoch')
    peer.forget()
    button = peer.publisher('/trigger')
    yield Stage(launcher, peer, button)
    peer.node.destroy_publisher(button)


def test_trigger_releases_the_pedestrian(stage: Stage) -> None:
    """
    The pedestrian stands until then, and walks at 1.4 m/s from the published tick on.

    The list of fired events is published whole, and empty at the start of the epoch.
    """
    peer = stage.peer
    assert stage.fired == ()
    peer.wait_until(lambda: peer.messages['/traffic/objects'], 'the objects')
    stage.press('pedestrian')
    (event,) = stage.fired
    assert event == FiredEvent('pedestrian', event.n, event.n // STEPS_PER_TICK, 'trigger')
    scheduler = peer.games[-1].scheduler

    def ways() -> dict[int, float]:
        found = {}
        for message in peer.messages['/traffic/objects']:
            place = list(message.joint_names).index('o201/y')
            n = scheduler.step_of_stamp(from_time(message.header.stamp))
            found[n] = message.points[0].positions[place] + 4.9
        return found
    peer.wait_until(lambda: max(ways()) >= event.n + 100, '1 s more')
    walked = ways()
    assert all(way == pytest.approx(0.0, abs=1e-4) for n, way in walked.items() if n <= event.n)
    late = [n for n in walked if event.n < n <= event.n + 100]
    assert len(late) >= 9
    assert [walked[n] for n in late] == pytest.approx(
        [1.4 * 0.01 * (n - event.n) for n in late], abs=1e-3)
    stage.press('roadworks')
    assert [item.name for item in stage.fired] == ['pedestrian', 'roadworks']


def test_refusals_are_told(stage: Stage) -> None:
    """An unknown name and an event that has already fired are refused; the run goes on."""
    peer = stage.peer
    stage.press('hide-plan')
    for name in ('fly', 'hide-plan'):
        stage.button.publish(String(data=name))
    peer.wait_until(lambda: len(peer.statuses('sim_node: event refused')) == 2, 'both refusals')
    (unknown, values), (again, _) = peer.statuses('sim_node: event refused')
    assert unknown.message.startswith('there is no event "fly"; the game has pedestrian, leader')
    assert values['event'] == 'fly'
    assert again.message == '"hide-plan" has taken effect already'
    n = peer.n
    peer.wait_until(lambda: peer.n > n + STEPS_PER_TICK, 'the next tick')
    assert [event.name for event in stage.fired] == ['hide-plan']


@pytest.mark.exhaustive
def test_planner_changes_and_comes_back_the_same_when_restarted(stage: Stage) -> None:
    """
    Planner and limit change; a restarted node has the same planner and limit.

    It knows them from /scenario/events alone: the events lie in the past when it starts.
    """
    peer = stage.peer
    swapped, limited = (stage.said_by_planner(text) for text in (
        'planner idm by an event', 'speed limit 8.3333 m/s by an event'))
    stage.press('slow-zone', 'careful-planner')
    peer.wait_until(lambda: stage.said_by_planner('planner idm by an event') == swapped + 1,
                    'the swap')
    assert stage.said_by_planner('speed limit 8.3333 m/s by an event') == limited + 1
    stage.launcher.kill('planner_node_av0')
    stage.launcher.wait_for_restart('planner_node_av0')
    peer.wait_until(lambda: stage.said_by_planner('planner idm by an event') == swapped + 2
                    and stage.said_by_planner('speed limit 8.3333 m/s by an event')
                    == limited + 2, 'the events again', 60.0)
    # The new planner keeps the new limit; it had been driving at 12.5 m/s.
    n = peer.n
    peer.wait_until(lambda: peer.n > n + 600, '6 s more', 60.0)
    assert peer.states('av0')[-1, 4] < SLOW + 0.1


@pytest.mark.exhaustive
def test_stopped_planner_is_asked_for_nothing(stage: Stage) -> None:
    """It gets no request after the tick of the event, until another event resumes it."""
    peer = stage.peer
    stage.press('planner-stops')
    stopped = stage.fired[0].n
    peer.wait_until(lambda: peer.n > stopped + 100, '1 s more')
    scheduler = peer.games[-1].scheduler

    def asked() -> list[int]:
        return [scheduler.step_of_stamp(from_time(message.header.stamp))
                for message in peer.messages['/<av>/plan_request']]

    assert all(n < stopped for n in asked())
    stage.press('planner-goes')
    peer.wait_until(lambda: any(n > stopped for n in asked()), 'a request')
    assert min(n for n in asked() if n >= stopped) == stage.fired[1].n


@pytest.mark.exhaustive
def test_recorded_events_repeat_offline_and_live(tmp_path: Path) -> None:
    """
    The bag's events become exact steps, and every recorded object comes out again.

    Live, the folder's game file says at which step the pedestrian goes.
    """
    folder = tmp_path / 'first'
    # Slowly at first: the run must not end before the buttons are pressed.
    with Launcher([CROSSING, '--duration', 6, '--real-time-factor', 0.1], folder) as launcher, \
            Peer(launcher.domain, *TOPICS) as peer:
        peer.wait_until(lambda: peer.n > 0 and peer.messages['/scenario/events'],
                        'the first step')
        stage = Stage(launcher, peer, peer.publisher('/trigger'))
        stage.press('pedestrian')
        stage.press('leader-brakes')
        assert peer.set_parameter('real_time_factor', 2.0).successful
        assert launcher.wait() == 0, launcher.text
    known, fired = read_run_events(folder / 'bag')
    assert [event.name for event in fired] == ['pedestrian', 'leader-brakes']
    assert {'pedestrian', 'slow-zone'} <= known
    log = read_trajectories(folder / 'bag')
    game = load_game(folder / 'game.yaml')
    human = replace(game.humans[0], driver=f'replay:{folder / "bag"}')
    setup = with_replayed_events(build_setup(replace(game, humans=(human,))))
    drivers, intervals_s = recorded_inputs(setup)
    again = run_offline(setup, duration_s=6.0, drivers=drivers, intervals_s=intervals_s)
    assert [(event.name, event.k) for event in again.fired] == [
        (event.name, event.k) for event in fired]
    np.testing.assert_array_equal(again.object_poses, log.object_poses)
    second = tmp_path / 'second'
    with Launcher([CROSSING, '--driver', f'replay:{folder / "bag"}', '--duration', 6,
                   '--real-time-factor', 2], second) as launcher:
        assert launcher.wait() == 0, launcher.text
    assert {event.name: event.when for event in load_game(second / 'game.yaml').events
            if event.when is not None} == {event.name: AtStep(event.k) for event in fired}
    np.testing.assert_array_equal(read_trajectories(second / 'bag').object_poses, log.object_poses)
    assert [(event.name, event.n) for event in read_run_events(second / 'bag').fired] == [
        (event.name, event.n) for event in fired]
