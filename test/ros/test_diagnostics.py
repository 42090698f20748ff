# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Statuses of every node: one form, one time base, and their owner."""

import ast
from collections.abc import Iterator
from pathlib import Path
import time

from cockpit_graph import Graph, lived, OFFSET_NS
from crgame_ros.game.game import load_game
from crgame_ros.ros.endpoints import Endpoints, NodeReport
from crgame_ros.ros.messages import from_time, to_time
from crgame_ros.simulation.setup import build_setup
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from live_support import SCENARIOS
import pytest
import rclpy
from rclpy.node import Node

PATIENCE_S = 60.0
NOW_NS = 12_345_678_901


@pytest.fixture
def node(ros_domain: int) -> Iterator[Node]:
    """Return a node in a namespace."""
    rclpy.init(domain_id=ros_domain)
    node = rclpy.create_node('planner_node_av0', namespace='/exp1')
    yield node
    node.destroy_node()
    rclpy.try_shutdown()


def _heard(endpoints: Endpoints, count: int) -> list[DiagnosticArray]:
    slot = endpoints.polled('/diagnostics', depth=100)
    found: list[DiagnosticArray] = []
    until_s = time.monotonic() + PATIENCE_S
    while endpoints.diagnostics.publisher.get_subscription_count() < 1:
        assert time.monotonic() < until_s
        time.sleep(0.01)
    diagnostics = endpoints.diagnostics
    diagnostics.publish('planner_node: av0', DiagnosticStatus.OK, 'too early', {})
    diagnostics.now_ns = NOW_NS
    endpoints.refusals.note('/av0/plan_request', 'half a \ud800 character')
    NodeReport(endpoints, 'planner_node: work').publish('working', {'n': 3}, NOW_NS + 1)
    diagnostics.publish('planner_node: av0', DiagnosticStatus.WARN, '\udfff', {'\ud800': '\ud800'})
    while len(found) < count:
        assert time.monotonic() < until_s
        if (message := slot.pop()) is not None:
            found.append(message)
    return found


def test_every_status_says_when_and_whose(node: Node) -> None:
    """Simulation time, the node's full name, printable text; 0 only before any time is known."""
    messages = _heard(Endpoints(node), 4)
    assert [from_time(message.header.stamp) for message in messages] == [
        0, NOW_NS, NOW_NS + 1, NOW_NS + 1]
    statuses = [message.status[0] for message in messages]
    assert {status.hardware_id for status in statuses} == {'/exp1/planner_node_av0'}
    assert statuses[1].message == 'half a ? character'
    assert statuses[1].values == [KeyValue(key='/av0/plan_request', value='1')]
    assert statuses[3].values == [KeyValue(key='?', value='?')]


def test_a_node_has_one_publisher_of_them(node: Node) -> None:
    """Reports and refusals of all endpoints of a node go out through the same one."""
    first, second = Endpoints(node), Endpoints(node)
    assert first.diagnostics is second.diagnostics
    assert node.count_publishers('/exp1/diagnostics') == 1


def test_statuses_are_made_in_one_place(project_root: Path) -> None:
    """One helper makes them all: other code might leave out time or owner."""
    made = []
    for file in (project_root / 'crgame_ros').rglob('*.py'):
        text = file.read_text(encoding='utf-8')
        for call in ast.walk(ast.parse(text)) if 'Diagnostic' in text else ():
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) \
                    and call.func.id in ('DiagnosticArray', 'DiagnosticStatus'):
                made.append(file.name)
    assert set(made) == {'diagnostics.py'}


def test_the_page_passes_over_what_is_of_the_run_before() -> None:
    """This holds for every sender; a status of a sender without time yet is shown."""
    setup = build_setup(load_game(SCENARIOS / 'cut_in.yaml'))

    def recording(text: str, stamp_ns: int) -> DiagnosticArray:
        message = DiagnosticArray(status=[DiagnosticStatus(
            name='recorder_node: recording', level=DiagnosticStatus.ERROR, message=text)])
        message.header.stamp = to_time(stamp_ns)
        return message

    async def check(graph: Graph) -> None:
        await graph.begin(setup)

        def text() -> str:
            return str(graph.document('status').get('recording', {}).get('text'))
        await graph.say('/diagnostics', recording('before', OFFSET_NS - 1))
        await graph.say('/diagnostics', recording('now', OFFSET_NS))
        await graph.until(lambda: text() == 'now', 'the status of this run')
        await graph.say('/diagnostics', recording('before', OFFSET_NS - 1))
        await graph.pause(0.5)
        assert text() == 'now'
        await graph.say('/diagnostics', recording('no time yet', 0))
        await graph.until(lambda: text() == 'no time yet', 'the status without a time')
        # The cockpit's own statuses are of the state that it shows.
        await graph.state(setup, 20)
        endpoints = graph.backend._endpoints
        await graph.until(lambda: endpoints.diagnostics.now_ns == OFFSET_NS + 200_000_000,
                          'the time of the state')
    lived(check)
