# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""marker_node in a running graph: its markers, and its savings without a subscriber."""

from collections.abc import Iterator
import math
from pathlib import Path
import threading

from crgame_ros.game.documents import GAME, OBJECTS
from crgame_ros.game.game import load_game
from crgame_ros.messages.joints import vehicle_joint_names, vehicle_to_joints
from crgame_ros.nodes import marker_node
from crgame_ros.nodes.marker_node import MarkerNode
from crgame_ros.nodes.markers.roads import NAMESPACES
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import from_time, StateMessage
from crgame_ros.ros.node_main import StopFlag
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup, Setup
from live_peer import Peer
from live_support import Launcher
import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import Bool, String
from steady_game import write_steady_game
from visualization_msgs.msg import Marker, MarkerArray

# On a busy machine a message that is sent once may come before its subscriber.
pytestmark = pytest.mark.clock

# CommonRoad vehicle 2 (BMW 320i): distance of the rear axle behind the centre [m].
REAR_TO_CENTER = 1.4227
TOPICS = ('/clock', '/scenario/game', '/vehicles/state', ('/<av>/plan', 'av0'))
# The cut-in map has no stop lines.
MAP = set(NAMESPACES) - {'stop_lines'}
TICK_NS = 100_000_000


def _maps(messages: list[MarkerArray]) -> list[MarkerArray]:
    return [message for message in messages if any(item.ns == 'road' for item in message.markers)]


def _frames(messages: list[MarkerArray]) -> list[MarkerArray]:
    return [message for message in messages
            if any(item.ns == 'vehicles' for item in message.markers)]


def _settle(viewer: Peer) -> None:
    """Wait for the map and its second copy: the first may come before all are matched."""
    viewer.wait_until(lambda: _maps(viewer.messages['/markers']), 'the map')
    viewer.listen_for(1.5)


def _marker(message: MarkerArray, namespace: str, number: int) -> Marker | None:
    return next((item for item in message.markers if (item.ns, item.id) == (namespace, number)),
                None)


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Launcher, Peer]]:
    """Keep one graph, and a node that steers it and does not look at the markers."""
    folder = tmp_path_factory.mktemp('markers')
    game = write_steady_game(folder)
    # On a busy machine timesync_node's own orders would mix with the test's.
    game.write_text(game.read_text() + 'timing: {frame_skipping: false}\n')
    with Launcher([game, '--open-topics'], folder / 'run') as launcher, \
            Peer(launcher.domain, *TOPICS) as peer:
        peer.wait_until(lambda: peer.n > 0, 'the first step')
        yield launcher, peer


def _subscribers(peer: Peer, topic: str) -> set[str]:
    return {info.node_name for info in peer.node.get_subscriptions_info_by_topic(topic)}


def test_a_viewer_sees_the_map_then_what_moves(graph: tuple[Launcher, Peer]) -> None:
    """Deletion and map come first; boxes are at the states of their stamp, and move with them."""
    launcher, peer = graph
    with Peer(launcher.domain, '/markers') as viewer:
        seen = viewer.messages['/markers']
        viewer.wait_until(lambda: len(_frames(seen)) > 40, 'two seconds of markers')
        peer.listen()
        assert seen[0].markers[0].action == Marker.DELETEALL
        assert {item.ns for item in seen[0].markers[1:]} == MAP
        # Twice more for a subscriber that has just come, and then never again.
        assert len(_maps(seen)) <= 3
        assert all(item.action == Marker.ADD for message in seen[1:] for item in message.markers)
        frames = _frames(seen)
        for number, vehicle in enumerate(('hv0', 'av0')):
            states = {int(row[0]): row[1:4] for row in peer.states(vehicle)}
            places = []
            for frame in frames:
                box = _marker(frame, 'vehicles', number)
                assert box is not None
                x, y, yaw = states[from_time(box.header.stamp)]
                assert box.header.frame_id == 'map'
                assert math.isclose(box.pose.position.x, x + REAR_TO_CENTER * math.cos(yaw),
                                    abs_tol=5e-5)
                assert math.isclose(box.pose.position.y, y + REAR_TO_CENTER * math.sin(yaw),
                                    abs_tol=5e-5)
                places.append((box.pose.position.x, box.pose.position.y))
            # Both vehicles drive at more than 20 m/s.
            assert math.dist(places[0], places[-1]) > 20.0
        plans = [np.array(plan.points[0].positions[:2]) for plan in peer.messages['/<av>/plan']]
        line = _marker(frames[-1], 'plan', 0)
        assert line is not None
        first = np.array((line.points[0].x, line.points[0].y))
        assert min(float(np.hypot(*(plan - first))) for plan in plans) < 1e-9
        prediction = _marker(frames[-1], 'prediction', 0)
        assert prediction is not None
        # The human at more than 20 m/s over 3 s, in segments of 0.5 s.
        assert len(prediction.points) == 12


def test_late_joiner_gets_the_map(graph: tuple[Launcher, Peer]) -> None:
    """A second, later subscriber gets it too; for the first nothing is deleted."""
    launcher, _ = graph
    with Peer(launcher.domain, '/markers') as viewer:
        seen = viewer.messages['/markers']
        _settle(viewer)
        with Peer(launcher.domain, '/markers') as late:
            late.wait_until(lambda: _maps(late.messages['/markers']), 'the map, late')
            assert {item.ns for item in _maps(late.messages['/markers'])[0].markers} == MAP
        viewer.listen()
        assert not any(item.action == Marker.DELETEALL for message in _maps(seen)
                       for item in message.markers)


def test_requests_and_plans_are_taken_only_for_a_viewer(
        graph: tuple[Launcher, Peer]) -> None:
    """They are the large messages: marker_node leaves these topics when the last viewer does."""
    launcher, peer = graph
    for topic in ('/av0/plan', '/av0/plan_request'):
        peer.wait_until(lambda topic=topic: 'marker_node' not in _subscribers(peer, topic),
                        f'{topic} left')
        with Peer(launcher.domain, '/markers'):
            peer.wait_until(lambda topic=topic: 'marker_node' in _subscribers(peer, topic),
                            f'{topic} taken')
        peer.wait_until(lambda topic=topic: 'marker_node' not in _subscribers(peer, topic),
                        f'{topic} left again')


def test_frame_skipping_suppresses_markers(graph: tuple[Launcher, Peer]) -> None:
    """While skipping is ordered no marker comes, though the vehicles drive on; then they do."""
    launcher, peer = graph
    with Peer(launcher.domain, '/markers') as viewer:
        seen = viewer.messages['/markers']
        viewer.wait_until(lambda: _frames(seen), 'markers')
        orders = peer.publisher('/timing/frame_skip')
        peer.wait_until(lambda: {'marker_node', 'sim_node'} <= _subscribers(
            peer, '/timing/frame_skip'), 'those who obey')
        orders.publish(Bool(data=True))
        try:
            viewer.listen_for(1.0)
            before, n = len(seen), peer.n
            viewer.listen_for(2.0)
            peer.listen()
            assert peer.n > n + 100
            assert len(seen) == before
        finally:
            orders.publish(Bool(data=False))
        viewer.wait_until(lambda: len(_frames(seen)) > before + 5, 'markers again')
        peer.node.destroy_publisher(orders)


def test_a_reset_clears_the_scene(graph: tuple[Launcher, Peer]) -> None:
    """A deletion and the map come again; from then on all markers are of the new epoch."""
    launcher, peer = graph
    with Peer(launcher.domain, '/markers') as viewer:
        seen = viewer.messages['/markers']
        _settle(viewer)
        del seen[:]
        epoch = peer.games[-1].epoch
        assert peer.call('/sim/reset').success
        peer.wait_until(lambda: peer.games[-1].epoch > epoch and peer.n > 50, 'a new epoch')
        _settle(viewer)
        start = next(index for index, message in enumerate(seen)
                     if message.markers[0].action == Marker.DELETEALL)
        assert _maps(seen)[0] is seen[start]
        offset_ns = peer.games[-1].scheduler.clock_offset_ns
        stamps = [from_time(frame.markers[0].header.stamp) for frame in _frames(seen[start:])]
        assert stamps
        assert min(stamps) >= offset_ns


def test_a_pause_keeps_the_scene(graph: tuple[Launcher, Peer]) -> None:
    """Paused, the same picture is sent again before it would vanish, to newcomers too."""
    launcher, peer = graph
    assert peer.call('/sim/pause').success
    try:
        with Peer(launcher.domain, '/markers') as viewer:
            seen = viewer.messages['/markers']
            viewer.wait_until(lambda: len(_frames(seen)) >= 4, 'four frames')
            boxes = [_marker(frame, 'vehicles', 0) for frame in _frames(seen)]
            assert {(box.pose.position.x, box.pose.position.y) for box in boxes[1:]} == {
                (boxes[-1].pose.position.x, boxes[-1].pose.position.y)}
    finally:
        assert peer.call('/sim/start').success


class Stage:
    """
    A marker_node in this process, and a node in the role of the simulation.

    :param setup: the game that is played.
    """

    def __init__(self, setup: Setup, domain: int) -> None:
        rclpy.init(domain_id=domain)
        self.setup = setup
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node: Node = rclpy.create_node('stage', context=self._context)
        endpoints = Endpoints(self.node)
        self.texts = {name: endpoints.publisher(f'/scenario/{name}')
                      for name in ('xml', 'objects', 'game')}
        self._states = endpoints.publisher('/vehicles/state')
        self._message = StateMessage([name for vehicle in setup.vehicle_ids
                                      for name in vehicle_joint_names(vehicle)])
        self._stop = StopFlag()
        self._n = 0
        drawing = MarkerNode()
        self._thread = threading.Thread(target=lambda: (drawing.run(self._stop),
                                                        drawing.destroy_node()))
        self._thread.start()

    def tell(self, epoch: int) -> None:
        """Publish the documents of an epoch."""
        for name, text in (
                ('xml', self.setup.loaded.xml_text),
                ('objects', OBJECTS.write(self.setup.descriptions)),
                ('game', GAME.write(describe_game(self.setup, epoch=epoch)))):
            self.texts[name].publish(String(data=text))

    def step(self) -> None:
        """Publish a state."""
        self._n += 1
        for index, vehicle in enumerate(self.setup.vehicles):
            place = slice(4 * index, 4 * index + 4)
            (self._message.positions[place], self._message.velocities[place],
             self._message.accelerations[place]) = vehicle_to_joints(vehicle.state)
        self._states.publish(self._message.stamp(self._n * TICK_NS))

    def close(self) -> None:
        """End both nodes."""
        self._stop.requested = True
        self._thread.join(20.0)
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)
        rclpy.try_shutdown()


@pytest.fixture
def stage(tmp_path: Path, ros_domain: int) -> Iterator[Stage]:
    """Play the cut-in game for a marker_node in this process."""
    found = Stage(build_setup(load_game(write_steady_game(tmp_path))), ros_domain)
    yield found
    found.close()


def test_nothing_is_computed_without_a_viewer(
        stage: Stage, ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """No document is read and no marker is made before the first subscriber."""
    made: list[str] = []

    class Counted(marker_node.SceneMarkers):

        def __init__(self, documents: marker_node.ScenarioSet) -> None:
            made.append('scene')
            super().__init__(documents)

        def message(self) -> MarkerArray:
            made.append('message')
            return super().message()

    monkeypatch.setattr(marker_node, 'SceneMarkers', Counted)
    stage.tell(epoch=0)
    with Peer(ros_domain, '/vehicles/state') as peer:
        for _ in range(20):
            stage.step()
            peer.listen_for(0.05)
        assert len(peer.messages['/vehicles/state']) > 10
        assert made == []
        with Peer(ros_domain, '/markers') as viewer:
            def drawn() -> bool:
                stage.step()
                return bool(_frames(viewer.messages['/markers']))

            viewer.wait_until(drawn, 'markers')
        assert made[:2] == ['scene', 'message']
        # At 20 Hz it has noticed within a second that no subscriber is left.
        peer.listen_for(1.0)
        count = len(made)
        for _ in range(20):
            stage.step()
            peer.listen_for(0.05)
        assert len(made) == count


def test_documents_that_do_not_fit_are_waited_for(stage: Stage, ros_domain: int) -> None:
    """A game with another scenario's text draws nothing; malformed text is reported."""
    with Peer(ros_domain, '/markers', '/scenario/game') as viewer:
        seen = viewer.messages['/markers']
        stage.tell(epoch=0)
        stage.texts['xml'].publish(String(data='<commonRoad/>'))
        viewer.listen_for(1.0)
        before = len(_maps(seen))
        stage.texts['game'].publish(String(data='{'))
        viewer.listen_for(1.0)
        assert len(_maps(seen)) == before
        stage.tell(epoch=1)
        viewer.wait_until(lambda: len(_maps(seen)) > before, 'the map')
        stage.step()
        viewer.wait_until(lambda: any(
            from_time(frame.markers[0].header.stamp) > 0 for frame in _frames(seen)), 'a state')
