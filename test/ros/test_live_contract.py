# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A running graph has exactly the endpoints of the contract.

DDS announces type, reliability and durability of an endpoint, not its depth, so the depth is
no part of this comparison.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
import time
from typing import Any

from crgame_ros.cli import main
from crgame_ros.messages.contract import load_contract, Topic
from crgame_ros.ros.endpoints import Endpoints
from live_support import Launcher, PATIENCE_S, SCENARIOS, wait_until
import pytest
from rcl_interfaces.srv import DescribeParameters, ListParameters
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo
import yaml

TESTER = 'tester'
# Endpoints that every ROS node has by default.
OF_EVERY_NODE = {'/rosout', '/parameter_events'}
SERVICES_OF_EVERY_NODE = {
    'describe_parameters', 'get_parameter_types', 'get_parameters', 'get_type_description',
    'list_parameters', 'set_parameters', 'set_parameters_atomically'}
# Subscriptions that exist only while a game needs them: (topic, node).
ONLY_WITH_A_JOY_NODE = ('/<hv>/joy', 'driver_node')
ONLY_WITH_DRIVABILITY_STOP = ('/<v>/drivability', 'sim_node')
# No test has a wheel; test_live_force.py tests the endpoints of one.
ONLY_WITH_A_MOTOR = frozenset({('/<v>/odom', 'driver_node'), ('/<v>/drivability', 'driver_node')})
ONLY_WITH_TASKS = ('/tasks/report', 'sim_node')
OPTIONAL = frozenset({ONLY_WITH_A_JOY_NODE, ONLY_WITH_DRIVABILITY_STOP, ONLY_WITH_TASKS})
ONLY_WITH_PERCEPTION = (('/<av>/plan_request', 'sim_node'), ('/<av>/localization', 'cockpit_node'),
                        ('/<av>/scan', 'cockpit_node'))
# Processes that exist only in a game with reactive traffic, a map, and instruments.
ENGINES = ('traffic_node', 'map_node', 'instruments_node')
# A service is asked so often before it counts as one that does not answer.
ATTEMPTS = 6
PARAMETER_TYPES = {'bool': 1, 'integer': 2, 'double': 3, 'string': 4}

Endpoint = tuple[str, str, str, str, str]


@dataclass(frozen=True)
class Case:
    """
    A game and the expected endpoints of its graph.

    :param humans: ids of the humans' vehicles.
    :param avs: ids of the AVs.
    :param used: which optional subscriptions the game needs.
    :param perceiving: AVs with perception.
    :param engines: whether it has reactive traffic, a map of permanent obstacles, and triggers.
    """

    humans: tuple[str, ...]
    avs: tuple[str, ...]
    used: frozenset[tuple[str, str]]
    perceiving: tuple[str, ...] = ()
    engines: bool = False

    def nodes(self, executable: str, vehicle: str) -> list[str]:
        """Name the processes of an executable that serve a vehicle; all of them without one."""
        groups = {'driver_node': self.humans, 'planner_node': self.avs,
                  'perception_node': self.perceiving}
        if executable not in groups:
            return [executable] if self.engines or executable not in ENGINES else []
        served = [item for item in groups[executable] if vehicle in ('', item)]
        return [f'{executable}_{item}' for item in served]

    def publishers(self, topic: Topic) -> set[Endpoint]:
        """List the publishers that a topic must have."""
        return self._endpoints(topic, topic.producers, frozenset(), frozenset(
            (name, 'sim_node', av) for av in self.avs for name in (
                ['/<av>/plan_request'] if av in self.perceiving else ['/<av>/true_request'])))

    def subscriptions(self, topic: Topic) -> set[Endpoint]:
        """List the subscriptions that a topic must have."""
        perfect = set(self.avs) - set(self.perceiving)
        idle = {(name, node, av) for name, node in ONLY_WITH_PERCEPTION for av in perfect}
        if not self.engines:
            idle.add(('/traffic/agents', 'sim_node', ''))
        return self._endpoints(topic, topic.consumers, ONLY_WITH_A_MOTOR | OPTIONAL - self.used,
                               frozenset(idle))

    def _endpoints(self, topic: Topic, executables: tuple[str, ...],
                   unused: frozenset[tuple[str, str]],
                   without: frozenset[tuple[str, str, str]]) -> set[Endpoint]:
        found = set()
        for name in topic.names(self.humans, self.avs):
            vehicle = name.split('/')[1] if topic.placeholder else ''
            for executable in sorted({*executables} - {'external'}):
                pair = (topic.name, executable)
                # Only a human's violation may end the run.
                idle = pair == ONLY_WITH_DRIVABILITY_STOP and vehicle not in self.humans
                if pair not in unused and not idle and (*pair, vehicle) not in without:
                    found |= {(name, node, topic.type_name, topic.qos.reliability,
                               topic.qos.durability) for node in self.nodes(executable, vehicle)}
        return found


PLAIN = Case(('hv0',), ('av0',), frozenset())
FULL = Case(('hv0',), ('av0', 'av1'), OPTIONAL, ('av1',), engines=True)


def _game(name: str) -> dict[str, Any]:
    """Read a game in which marker_node draws, and so subscribes, on a busy machine, too."""
    game = yaml.safe_load((SCENARIOS / name).read_text())
    return game | {'scenario': str(SCENARIOS / game['scenario']),
                   'timing': {'frame_skipping': False}}


def _plain_game(folder: Path) -> Path:
    """Write a game of one human and one AV."""
    game = _game('cut_in.yaml')
    game['humans'][0]['driver'] = f'keys:{SCENARIOS / "cut_in.keys.yaml"}'
    path = folder / 'plain.yaml'
    path.write_text(yaml.safe_dump(game))
    return path


def _full_game(folder: Path) -> Path:
    """Write a game of two AVs that needs every optional endpoint and every node."""
    game = _game('two_avs.yaml')
    game['humans'][0]['driver'] = 'joy'
    game['drivability']['stop'] = True
    game['avs'][1]['perception'] = {}
    game['traffic'] = {'agents': 2}
    game['tasks'] = [{'name': 'radio', 'secondary_task': {}}]
    game['instruments'] = {'triggers': {
        'address': '127.0.0.1:9', 'protocol': 'udp', 'codes': {'stimulus': 1}}}
    assert main(['rasterize', game['scenario'], str(folder / 'map')]) == 0
    game['occupancy'] = str(folder / 'map' / 'map.yaml')
    path = folder / 'full.yaml'
    path.write_text(yaml.safe_dump(game))
    return path


@dataclass
class Graph:
    """A running graph, seen by a node of the test's own."""

    case: Case
    node: Node
    executor: SingleThreadedExecutor

    def publishers(self) -> set[Endpoint]:
        """Return all publishers but those that each node has."""
        return self._endpoints(self.node.get_publishers_info_by_topic)

    def subscriptions(self) -> set[Endpoint]:
        """Return all subscriptions but those that each node has."""
        return self._endpoints(self.node.get_subscriptions_info_by_topic)

    def _endpoints(self, look_up: object) -> set[Endpoint]:
        assert callable(look_up)
        return {_endpoint(name, info) for name, _ in self.node.get_topic_names_and_types()
                if name not in OF_EVERY_NODE for info in look_up(name) if info.node_name != TESTER}

    def services(self) -> set[tuple[str, str, str]]:
        """Return all services but those that each node has: node, name, type."""
        return {(node, name, kind) for node in self.node.get_node_names() if node != TESTER
                for name, kinds in self.node.get_service_names_and_types_by_node(node, '/')
                if name.rpartition('/')[2] not in SERVICES_OF_EVERY_NODE for kind in kinds}

    def ask(self, kind: type, name: str, **fields: object) -> object:
        """
        Call a service that only tells, until it answers.

        A server that has not discovered its new client within 0.1 s drops the answer.
        """
        client = self.node.create_client(kind, name)
        assert client.wait_for_service(PATIENCE_S), name
        for _ in range(ATTEMPTS):
            future = client.call_async(kind.Request(**fields))
            self.executor.spin_until_future_complete(future, PATIENCE_S / ATTEMPTS)
            if future.done():
                break
        self.node.destroy_client(client)
        assert future.done(), name
        return future.result()


def _endpoint(name: str, info: TopicEndpointInfo) -> Endpoint:
    profile = info.qos_profile
    return (name, info.node_name, info.topic_type, profile.reliability.name.lower(),
            profile.durability.name.lower())


@pytest.fixture(scope='module', params=[PLAIN, FULL], ids=['plain', 'full'])
def graph(request: pytest.FixtureRequest,
          tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """Start a game and look at its graph once it drives."""
    folder = tmp_path_factory.mktemp('contract')
    game = (_plain_game if request.param is PLAIN else _full_game)(folder)
    with Launcher([game, '--duration', 3600], folder / 'run', headless=False) as launcher:
        launcher.wait_for('recording into')
        context = Context()
        rclpy.init(context=context, domain_id=launcher.domain)
        node = rclpy.create_node(TESTER, context=context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        # marker_node subscribes to plans and requests only while its markers have a subscriber.
        endpoints = Endpoints(node)
        markers = endpoints.polled('/markers')
        try:
            yield Graph(request.param, node, executor)
        finally:
            executor.shutdown()
            node.destroy_subscription(markers.subscription)
            node.destroy_node()
            context.try_shutdown()


def _settled(look: object, expected: set[tuple[str, ...]]) -> set[tuple[str, ...]]:
    """Poll until the expected is seen, or time is up; return what was seen last."""
    assert callable(look)
    until_s = time.monotonic() + 20.0
    while (seen := look()) != expected and time.monotonic() < until_s:
        time.sleep(0.1)
    return set(seen)


def _compare(seen: set[tuple[str, ...]], expected: set[tuple[str, ...]]) -> None:
    missing, undeclared = sorted(expected - seen), sorted(seen - expected)
    assert not missing and not undeclared, f'missing: {missing}\nundeclared: {undeclared}'


@pytest.mark.matrix
def test_nodes_are_those_of_the_game(graph: Graph) -> None:
    """One process each; a driver for each human and a planner for each AV, named after them."""
    case = graph.case
    expected = {('sim_node',), ('recorder_node',), ('drivability_node',), ('timesync_node',),
                ('criticality_node',),
                ('marker_node',), ('cockpit_node',),
                *((f'driver_node_{item}',) for item in case.humans),
                *((f'planner_node_{item}',) for item in case.avs),
                *((f'perception_node_{item}',) for item in case.perceiving),
                *((name,) for name in ENGINES if case.engines), (TESTER,)}
    _compare(_settled(lambda: {(name,) for name in graph.node.get_node_names()}, expected),
             expected)
    names = graph.node.get_node_names()
    assert len(names) == len(set(names))


def test_publishers_are_the_declared_producers(graph: Graph) -> None:
    """Topic, node, type and QoS of every publisher: all that is declared, nothing else."""
    expected = {item for topic in load_contract().topics.values() if topic.available
                for item in graph.case.publishers(topic)}
    for action in load_contract().actions.values():
        if action.available:
            place = f'{action.name}/_action'
            expected |= {(f'{place}/feedback', 'sim_node', f'{action.type_name}_FeedbackMessage',
                          'reliable', 'volatile'),
                         (f'{place}/status', 'sim_node', 'action_msgs/msg/GoalStatusArray',
                          'reliable', 'transient_local')}
    assert len(expected) > 20
    _compare(_settled(graph.publishers, expected), expected)


def test_subscriptions_are_the_declared_consumers(graph: Graph) -> None:
    """The same of every subscription; the optional ones exactly where the game needs them."""
    expected = {item for topic in load_contract().topics.values()
                for item in graph.case.subscriptions(topic)}
    assert len(expected) > 20
    _compare(_settled(graph.subscriptions, expected), expected)


def test_services_are_the_declared_ones(graph: Graph) -> None:
    """`sim_node` alone offers services beside those that every node has, and of actions."""
    contract = load_contract()
    expected = {('sim_node', name, service.type_name)
                for service in contract.services.values() if service.available
                for name in service.names(graph.case.avs)}
    expected |= {('sim_node', f'{action.name}/_action/{part}', kind)
                 for action in contract.actions.values() if action.available
                 for part, kind in (('send_goal', f'{action.type_name}_SendGoal'),
                                    ('get_result', f'{action.type_name}_GetResult'),
                                    ('cancel_goal', 'action_msgs/srv/CancelGoal'))}
    _compare(_settled(graph.services, expected), expected)


@pytest.mark.matrix
def test_parameters_that_may_be_set_are_the_declared_ones(graph: Graph) -> None:
    """All other parameters of our nodes are read-only, so that setting them is refused."""
    seen, expected = set(), {
        (node, name, str(PARAMETER_TYPES[row['type']]))
        for node, rows in load_contract().parameters.items() for name, row in rows.items()}
    nodes = {item.node_name for name in ('/diagnostics', '/clock')
             for item in graph.node.get_publishers_info_by_topic(name)}
    wait_until(lambda: 'sim_node' in graph.node.get_node_names(), 'sim_node')
    for node in sorted(nodes):
        names = graph.ask(ListParameters, f'/{node}/list_parameters').result.names
        described = graph.ask(DescribeParameters, f'/{node}/describe_parameters', names=names)
        seen |= {(node, item.name, str(item.type)) for item in described.descriptors
                 if not item.read_only and item.name != 'use_sim_time'}
    _compare(seen, expected)
