# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The standard's services and action on a running graph, where their package is installed."""

from collections.abc import Iterator
import math
import os
from pathlib import Path
import subprocess
import sys

from action_msgs.msg import GoalStatus
from crgame_ros.messages.joints import MAP
from live_peer import Peer
from live_support import CUT_IN, is_node, Launcher, SCENARIOS
import pytest
from rclpy.action import ActionClient
from ros_domains import own_domain_id

MISSING = 'the package simulation_interfaces is not installed'
msg = pytest.importorskip('simulation_interfaces.msg', reason=MISSING)
srv = pytest.importorskip('simulation_interfaces.srv', reason=MISSING)
SimulateSteps = pytest.importorskip('simulation_interfaces.action', reason=MISSING).SimulateSteps

OK = msg.Result.RESULT_OK
OTHER_SCENARIO = 'ZAM_Roundabout-1_1_T-1.xml'
TOPICS = ('/clock', '/scenario/game', '/vehicles/state', '/diagnostics')


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Launcher, Peer]]:
    """Keep one graph for all tests."""
    folder = tmp_path_factory.mktemp('standard')
    with Launcher([CUT_IN, '--duration', 3600], folder / 'run') as launcher, \
            Peer(launcher.domain, *TOPICS) as peer:
        peer.wait_until(lambda: peer.n > 30, 'n = 30')
        yield launcher, peer


@pytest.fixture
def peer(graph: tuple[Launcher, Peer]) -> Peer:
    """Return a peer of the graph, paused."""
    peer = graph[1]
    _set_state(peer, msg.SimulationState.STATE_PAUSED)
    peer.wait_for_pause()
    return peer


def _ask(peer: Peer, kind: type, name: str, **fields: object) -> object:
    """Call a service and return its answer."""
    client = peer.node.create_client(kind, name)
    peer.wait_until(client.service_is_ready, name)
    future = client.call_async(kind.Request(**fields))
    peer.wait_until(future.done, f'an answer of {name}')
    peer.node.destroy_client(client)
    return future.result()


def _set_state(peer: Peer, state: int) -> object:
    return _ask(peer, srv.SetSimulationState, '/set_simulation_state',
                state=msg.SimulationState(state=state))


def _state(peer: Peer) -> int:
    return _ask(peer, srv.GetSimulationState, '/get_simulation_state').state.state


def test_pause_steps_and_going_on(peer: Peer) -> None:
    """A step is one of the simulation, and the answer comes when all are done."""
    states = msg.SimulationState
    assert _state(peer) == states.STATE_PAUSED
    again = _set_state(peer, states.STATE_PAUSED)
    assert again.result.result == srv.SetSimulationState.Response.ALREADY_IN_TARGET_STATE
    n = peer.n
    for steps in (1, 3, 0, 23):
        assert _ask(peer, srv.StepSimulation, '/step_simulation', steps=steps).result.result == OK
        n += steps
        assert peer.wait_for_pause() == n
    assert _set_state(peer, states.STATE_PLAYING).result.result == OK
    peer.wait_until(lambda: peer.n > n + 30, 'the run going on')
    assert _state(peer) == states.STATE_PLAYING
    refused = _ask(peer, srv.StepSimulation, '/step_simulation', steps=1)
    assert refused.result.result == msg.Result.RESULT_OPERATION_FAILED
    assert 'not paused' in refused.result.error_message


def test_action_tells_each_step_and_can_be_cancelled(peer: Peer) -> None:
    """Feedback counts up and down; a cancelled goal leaves the run paused where it is."""
    client = ActionClient(peer.node, SimulateSteps, '/simulate_steps')
    peer.wait_until(client.server_is_ready, 'the action')
    before, counts = peer.n, []

    def order(steps: int) -> object:
        counts.clear()
        sent = client.send_goal_async(SimulateSteps.Goal(steps=steps), lambda news: counts.append(
            (news.feedback.completed_steps, news.feedback.remaining_steps)))
        peer.wait_until(sent.done, 'the acceptance of the goal')
        return sent.result()

    done = order(20).get_result_async()
    peer.wait_until(done.done, 'the steps')
    assert done.result().status == GoalStatus.STATUS_SUCCEEDED
    assert done.result().result.result.result == OK
    assert counts == [(count, 20 - count) for count in range(1, 21)]
    assert peer.wait_for_pause() == before + 20

    goal = order(10 ** 12)
    peer.wait_until(lambda: len(counts) > 10, 'some steps')
    cancelled = goal.cancel_goal_async()
    peer.wait_until(cancelled.done, 'the cancellation')
    assert cancelled.result().goals_canceling
    done = goal.get_result_async()
    peer.wait_until(done.done, 'the result')
    assert done.result().status == GoalStatus.STATUS_CANCELED
    assert 'cancelled' in done.result().result.result.error_message
    assert peer.wait_for_pause() == before + 20 + counts[-1][0]
    client.destroy()


def test_states_are_those_of_the_topics(peer: Peer) -> None:
    """Pose, velocity and acceleration are those of /vehicles/state, of the same stamp."""
    answer = _ask(peer, srv.GetEntitiesStates, '/get_entities_states',
                  filters=msg.EntityFilters(filter='(hv|av)[[:digit:]]+'))
    told = peer.messages['/vehicles/state'][-1]
    assert answer.entities == ['hv0', 'av0']
    for place, state in enumerate(answer.states):
        x, y, yaw, _ = told.points[0].positions[4 * place:4 * place + 4]
        vx, vy, rate, _ = told.points[0].velocities[4 * place:4 * place + 4]
        ax, ay, *_ = told.points[0].accelerations[4 * place:4 * place + 4]
        assert state.header == told.header and state.header.frame_id == MAP
        assert (state.pose.position.x, state.pose.position.y) == (x, y)
        assert 2.0 * math.atan2(state.pose.orientation.z, state.pose.orientation.w) \
            == pytest.approx(yaw)
        twist = state.twist
        assert (twist.linear.x, twist.linear.y, twist.angular.z) == (vx, vy, rate)
        assert (state.acceleration.linear.x, state.acceleration.linear.y) == (ax, ay)


def test_reset_stop_and_another_world(graph: tuple[Launcher, Peer], peer: Peer) -> None:
    """Each answer comes when the run stands at its first step; time has not gone back."""
    states, scopes = msg.SimulationState, srv.ResetSimulation.Request
    for name, scope, code in (
            ('time', scopes.SCOPE_TIME, msg.Result.RESULT_FEATURE_UNSUPPORTED),
            ('all', scopes.SCOPE_ALL, OK)):
        epoch, last_ns = peer.games[-1].epoch, peer.clock_ns[-1]
        assert _ask(peer, srv.ResetSimulation, '/reset_simulation',
                    scope=scope).result.result == code, name
    peer.wait_until(lambda: peer.games[-1].epoch == epoch + 1, 'a new epoch')
    assert peer.games[-1].scheduler.clock_offset_ns > last_ns
    # Still paused, and at the first step.
    assert _state(peer) == states.STATE_PAUSED
    assert _ask(peer, srv.StepSimulation, '/step_simulation', steps=2).result.result == OK
    assert peer.wait_for_pause() == 2

    assert _set_state(peer, states.STATE_STOPPED).result.result == OK
    peer.wait_until(lambda: peer.games[-1].epoch == epoch + 2, 'the epoch of the stop')
    assert _state(peer) == states.STATE_STOPPED
    answer = _ask(peer, srv.StepSimulation, '/step_simulation', steps=1)
    assert answer.result.result == msg.Result.RESULT_OPERATION_FAILED

    uri = (SCENARIOS / OTHER_SCENARIO).as_uri()
    answer = _ask(peer, srv.LoadWorld, '/load_world', uri=uri)
    assert answer.result.result == OK, answer.result
    assert answer.world.name == OTHER_SCENARIO.removesuffix('.xml')
    assert _ask(peer, srv.GetCurrentWorld, '/get_current_world').world.world_resource.uri == uri
    assert _state(peer) == states.STATE_STOPPED
    broken = graph[0].out / 'broken.xml'
    broken.write_text((SCENARIOS / OTHER_SCENARIO).read_text()[:5000])
    for name, code in ((broken, srv.LoadWorld.Response.RESOURCE_PARSE_ERROR),
                       (Path('/etc/hosts.xml'), msg.Result.RESULT_NOT_FOUND)):
        assert _ask(peer, srv.LoadWorld, '/load_world',
                    uri=name.as_uri()).result.result == code
    # The next reset begins with the scenario that could be used.
    assert _ask(peer, srv.ResetSimulation, '/reset_simulation').result.result == OK
    assert _set_state(peer, states.STATE_PLAYING).result.result == OK
    peer.wait_until(lambda: peer.n > 20, 'the run in the other world')
    assert peer.games[-1].benchmark_id == OTHER_SCENARIO.removesuffix('.xml')


def test_quitting_ends_the_run_well(graph: tuple[Launcher, Peer], peer: Peer) -> None:
    """The answer comes, then all nodes end."""
    launcher, _ = graph
    assert _set_state(peer, msg.SimulationState.STATE_QUITTING).result.result == OK
    assert launcher.wait() == 0, launcher.text
    assert not any(is_node(pid) for _, pid in launcher.started)
    assert not launcher.says('Traceback')


def test_a_run_that_is_over_stands_stopped() -> None:
    """It begins anew, here paused at its first step; quitting ends a node that would stay."""
    states, domain = msg.SimulationState, own_domain_id()
    parameters = {'game': CUT_IN, 'duration': 0.2, 'at_end': 'stay', 'planner_timeout': 0.1}
    words = [word for item in parameters.items() for word in ('-p', '{}:={}'.format(*item))]
    command = [sys.executable, '-m', 'crgame_ros.nodes.sim_node', '--ros-args', *words]
    with subprocess.Popen(command, env=os.environ | {'ROS_DOMAIN_ID': str(domain)}) as node, \
            Peer(domain, *TOPICS) as peer:
        peer.wait_until(lambda: peer.n == 20, 'the end')
        peer.wait_until(lambda: _state(peer) == states.STATE_STOPPED, 'the end being told')
        for _ in range(2):
            assert _set_state(peer, states.STATE_PAUSED).result.result == OK
            assert _state(peer) == states.STATE_PAUSED
            answer = _ask(peer, srv.StepSimulation, '/step_simulation', steps=20)
            # The answer to the last step is that it is done, though the run is over with it.
            assert answer.result.result == OK
            assert _state(peer) == states.STATE_STOPPED
        assert _set_state(peer, states.STATE_QUITTING).result.result == OK
        assert node.wait(30) == 0
