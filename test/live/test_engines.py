# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Perception and reactive traffic in their own processes: as offline, and after failures."""

from collections.abc import Iterator
from pathlib import Path
import re

from crgame_ros.game.game import load_game
from crgame_ros.game.objects import ObjectStates
from crgame_ros.messages.joints import from_joint_trajectory, vehicles_from_joints
from crgame_ros.perception.perception import Perception
from crgame_ros.recording.reader import BagReader
from crgame_ros.roads.signs import TrafficLights
from crgame_ros.ros.messages import from_time
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.simulation.traffic_setup import WorldReader
from crgame_ros.vehicle.state import VehicleState
from live_peer import Peer
from live_support import Launcher, SCENARIOS
import numpy as np
from numpy.typing import NDArray
import pytest
import yaml

pytestmark = pytest.mark.clock

AGENTS = 12
DURATION_S = 6.0
STEPS_PER_TICK = 10


def write_game(folder: Path, duration_s: float) -> Path:
    """Write a game of an intersection with agents, whose AV perceives and tracks."""
    values = yaml.safe_load((SCENARIOS / 'intersection.yaml').read_text())
    values |= {'scenario': str(SCENARIOS / values['scenario']), 'duration': duration_s,
               'traffic': {'agents': AGENTS}}
    values['humans'][0]['driver'] = f'joy:{SCENARIOS / "intersection.joy.yaml"}'
    values['avs'][0] |= {'perception': {}, 'execution': 'tracked',
                         'tracker': {'name': 'lqr', 'pose': 'estimated'}}
    path = folder / 'game.yaml'
    path.write_text(yaml.safe_dump(values))
    return path


class Recorded:
    """
    A finished run with what was published in it, by step.

    :param bag: of the run.
    :param setup: of its game.
    """

    def __init__(self, bag: Path, setup: Setup) -> None:
        self.setup = setup
        self.messages: dict[str, dict[int, object]] = {}
        with BagReader(bag) as reader:
            for item in reader.decoded([
                    '/vehicles/state', '/traffic/objects', '/traffic/agents',
                    '/av0/true_request', '/av0/plan_request', '/av0/localization']):
                stamp_ns = from_time(item.message.header.stamp)
                self.messages.setdefault(item.topic, {})[stamp_ns] = item.message
        self._offset_ns = min(self.messages['/vehicles/state'])

    def at(self, topic: str, n: int) -> object | None:
        """Return what a topic said of step n."""
        stamp_ns = self._offset_ns + n * 10_000_000
        return self.messages[topic].get(stamp_ns)

    def joints(self, n: int) -> tuple[NDArray[np.float64], ...]:
        """Return positions, velocities and accelerations (V, 4) of the driven vehicles."""
        point = self.at('/vehicles/state', n).points[0]  # type: ignore[union-attr,attr-defined]
        return tuple(np.array(values).reshape(-1, 4) for values in (
            point.positions, point.velocities, point.accelerations))

    def objects(self, topic: str, n: int) -> ObjectStates:
        """Return the objects of a tick."""
        point = self.at(topic, n).points[0]  # type: ignore[union-attr,attr-defined]
        return ObjectStates(np.array(point.positions).reshape(-1, 3),
                            np.array(point.velocities).reshape(-1, 3))


@pytest.fixture(scope='module')
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """Run the game to its end."""
    folder = tmp_path_factory.mktemp('engines')
    game = write_game(folder, DURATION_S)
    with Launcher([game], folder / 'run') as launcher:
        assert launcher.wait() == 0, launcher.text
    assert launcher.complaints == [] and not launcher.says('starting without')
    return Recorded(folder / 'run' / 'bag', build_setup(load_game(game)))


def test_perception_perceives_the_same_in_its_process(recorded: Recorded) -> None:
    """Fed with the recorded truth in process, it gives the recorded requests, bit for bit."""
    setup = recorded.setup
    av = setup.avs[0]
    assert av.spec.perception is not None
    perception: Perception | None = None
    compared = 0
    objects = recorded.objects('/traffic/objects', 0)
    for n in range(int(DURATION_S * 100)):
        states = vehicles_from_joints(*recorded.joints(n))
        if perception is None:
            perception = Perception(
                'av0', av.spec.perception, setup.descriptions, av.vehicle, av.transform,
                VehicleState(*states[len(setup.humans)].tolist()), setup.game.seed, 0.01)
        if n % STEPS_PER_TICK == 0:
            objects = recorded.objects('/traffic/objects', n)
        perception.observe(n, states, objects.poses, objects.velocities,
                           n % STEPS_PER_TICK * 0.01)
        odometry = recorded.at('/av0/localization', n)
        if odometry is not None:
            place = odometry.pose.pose.position  # type: ignore[attr-defined]
            assert place.x == perception.estimate.x
        true, told = (recorded.at(f'/av0/{name}_request', n) for name in ('true', 'plan'))
        if true is not None and told is not None:
            expected = perception.perceive(from_joint_trajectory(true, 'true'))
            actual = from_joint_trajectory(told, 'told')
            assert expected.names == actual.names
            # Not compared by `assert`: for a difference in so many bytes pytest looks for minutes.
            same = [expected.positions.tobytes() == actual.positions.tobytes(),
                    expected.velocities.tobytes() == actual.velocities.tobytes()]
            assert all(same), n
            compared += 1
    assert compared >= DURATION_S * 10 - 2


def test_agents_move_the_same_in_their_process(recorded: Recorded) -> None:
    """Fed with the recorded world in process, they drive to the recorded bits, a tick ahead."""
    setup = recorded.setup
    assert setup.traffic is not None
    traffic = setup.traffic.make()
    reader = WorldReader(setup.descriptions, TrafficLights(setup.loaded.scenario))
    columns = setup.agent_columns
    moved, late = 0.0, 0
    for tick in range(int(DURATION_S * 10) - 1):
        n = tick * STEPS_PER_TICK
        shown = recorded.objects('/traffic/objects', n)
        states = traffic.states
        # Where the process came too late, the simulation let the agents roll on for a tick.
        late += shown.poses[columns].tobytes() != states.poses.tobytes()
        positions, velocities, _ = recorded.joints(n)
        traffic.advance(reader.view(tick, positions, velocities, shown))
        published = recorded.objects('/traffic/agents', n + STEPS_PER_TICK)
        assert published.poses.tobytes() == traffic.states.poses.tobytes()
        moved += float(np.nansum(np.abs(traffic.states.poses[:, :2] - states.poses[:, :2])))
    assert late < DURATION_S
    assert np.isfinite(shown.poses[columns, 0]).sum() > AGENTS // 2
    assert moved > 100.0


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Launcher, Peer]]:
    """Keep a graph of the game that goes on."""
    folder = tmp_path_factory.mktemp('engine_failures')
    with Launcher([write_game(folder, 3600.0)], folder / 'run') as launcher, \
            Peer(launcher.domain, '/clock', '/scenario/game', '/traffic/objects',
                 '/vehicles/state', '/diagnostics') as peer:
        peer.wait_until(lambda: peer.n > 50, 'the run')
        yield launcher, peer


def agents(peer: Peer) -> NDArray[np.float64]:
    """Return the poses (ticks, A, 3) of the agents since the last `forget`."""
    messages = peer.messages['/traffic/objects']
    poses = np.array([message.points[0].positions for message in messages])
    names = [name.partition('/')[0] for name in messages[0].joint_names[::3]]
    chosen = [column for column, name in enumerate(names) if name[0] == 't']
    return poses.reshape(len(messages), -1, 3)[:, chosen]


def test_agents_brake_while_traffic_is_frozen(run: tuple[Launcher, Peer]) -> None:
    """They roll on, stop, and drive on from there; the recording says which ticks were late."""
    launcher, peer = run
    launcher.freeze('traffic_node')
    peer.forget()
    peer.wait_until(lambda: peer.statuses('sim_node: traffic'), 'late traffic')

    def stand() -> bool:
        if len(peer.messages['/traffic/objects']) < 3:
            return False
        return bool(np.nanmax(np.abs(np.diff(agents(peer)[-2:, :, :2], axis=0))) < 1e-3)
    peer.wait_until(stand, 'agents that stand')
    status, values = peer.statuses('sim_node: traffic')[-1]
    assert int(values['agents_k']) < int(values['k']) and 'late' in status.message
    launcher.thaw('traffic_node')
    peer.forget()
    peer.wait_until(lambda: len(peer.messages['/traffic/objects']) > 3 and not stand(),
                    'agents that drive on')
    steps = np.abs(np.diff(agents(peer)[:, :, :2], axis=0))
    # From where they were seen, not from where they would have been.
    assert np.nanmax(steps) < 2.0


def test_agents_go_on_with_another_traffic_node(run: tuple[Launcher, Peer]) -> None:
    """Killed and started again, it takes the agents over where they are."""
    launcher, peer = run
    told = re.compile(r'going on at k = (\d+)')
    before = len(told.findall(launcher.text))
    peer.forget()
    launcher.kill('traffic_node')
    launcher.wait_for_restart('traffic_node')
    peer.wait_until(lambda: len(told.findall(launcher.text)) > before, 'a node that goes on')
    back_k = int(told.findall(launcher.text)[before])

    def driving() -> bool:
        last = agents(peer)[-2:, :, :2] if len(peer.messages['/traffic/objects']) > 30 else None
        return last is not None and bool(np.nanmax(np.abs(np.diff(last, axis=0))) > 0.05)
    peer.wait_until(driving, 'agents that drive')
    late = [values for _, values in peer.statuses('sim_node: traffic')
            if int(values['k']) > back_k]
    assert len(late) < 30
    assert np.nanmax(np.abs(np.diff(agents(peer)[:, :, :2], axis=0))) < 3.5


def test_av_brakes_without_perception_and_drives_on_with_it(run: tuple[Launcher, Peer]) -> None:
    """No perceived request, no plan: as if the planner were silent, until it is back."""
    launcher, peer = run
    peer.forget()
    launcher.kill('perception_node_av0')
    launcher.wait_for_restart('perception_node_av0')
    peer.forget()
    peer.wait_until(lambda: peer.statuses('sim_node: av0 plans'), 'a report')
    before = int(peer.statuses('sim_node: av0 plans')[-1][1]['accepted'])

    def accepted() -> int:
        return int(peer.statuses('sim_node: av0 plans')[-1][1]['accepted'])
    peer.wait_until(lambda: accepted() > before + 10, 'plans')
    assert peer.statuses('sim_node: av0 plans')[-1][1]['last_refusal'] == ''
