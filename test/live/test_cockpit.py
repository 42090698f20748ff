# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cockpit of a running graph, seen from its WebSocket."""

from collections.abc import Iterator
import json
import os
from pathlib import Path
import signal
import socket
from typing import Any, NamedTuple
from urllib.parse import urlsplit
import urllib.request

from crgame_ros.ros.messages import from_time
from live_peer import Peer
from live_support import Launcher, SCENARIOS, wait_until
import numpy as np
from page_client import PageClient, PLAN, STATE
import pytest
from steady_game import THROTTLE, write_steady_game

TOPICS = ('/clock', '/scenario/game', '/seats', '/timing/cycle', '/vehicles/state', '/trigger',
          '/diagnostics', ('/<v>/driver_command', 'hv0'), ('/<av>/plan', 'av0'))
# On a busy machine a page would get no plans while frames are skipped.
EVENTS = """
timing: {frame_skipping: false}
events:
  - {name: box, label: 'A <b>box</b> falls', obstacle: {x: 60.0, y: 0.0, length: 2, width: 1}}
"""


class Graph(NamedTuple):
    """A graph with a cockpit, a peer that listens, and the page's address."""

    launcher: Launcher
    peer: Peer
    page: str


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """Keep one graph; every test gives its seats back."""
    folder = tmp_path_factory.mktemp('cockpit')
    game = write_steady_game(folder)
    game.write_text(game.read_text() + EVENTS)
    with Launcher([game, '--port', str(free_port())], folder / 'run',
                  headless=False) as launcher, Peer(launcher.domain, *TOPICS) as peer:
        peer.wait_until(lambda: peer.n > 30, 'n = 30')
        yield Graph(launcher, peer, launcher.page)


def free_port() -> int:
    """Find a port that is free now."""
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def page(graph: Graph) -> Iterator[PageClient]:
    """Open a client; release its seats at the end."""
    with PageClient(graph.page) as client:
        yield client
        client.let_go()
        for name, seat in client.documents['seats']['seats'].items():
            if seat['source'] == 'cockpit':
                client.request('release', seat=name)
        client.order('control', action='start')


def _commands(graph: Graph) -> np.ndarray:
    return graph.peer.cycles().commands('hv0')


def test_frames_carry_the_published_poses(graph: Graph, page: PageClient) -> None:
    """They agree bit for bit, under the right step."""
    graph.peer.forget()
    page.frames.clear()
    graph.peer.wait_until(lambda: len(page.frames) > 60, 'frames')
    game = graph.peer.games[-1]
    published = {game.scheduler.step_of_stamp(from_time(m.header.stamp)): m.points[0].positions
                 for m in graph.peer.messages['/vehicles/state']}
    compared = 0
    for frame in list(page.frames):
        if frame[0] == STATE and int(frame[2]) in published:
            rows = frame[6:].reshape(-1, 13)
            positions = np.array(published[int(frame[2])]).reshape(-1, 4)
            assert np.array_equal(rows[:, :3], positions[:, :3])
            assert np.array_equal(rows[:, 4], positions[:, 3])
            assert frame[4] == int(frame[2]) * 0.01
            compared += 1
    assert compared > 20


@pytest.mark.exhaustive
def test_plan_frames_are_the_plans(graph: Graph, page: PageClient) -> None:
    """Same rear-axle poses as on /av0/plan, with the time after the request."""
    graph.peer.forget()
    game = graph.peer.games[-1]

    def pairs() -> list[tuple[np.ndarray, Any]]:
        """Join the page's newest frame with the plan of its step: one may come late."""
        frame = page.newest(PLAN)
        return [] if frame is None else [
            (frame, m) for m in graph.peer.messages['/<av>/plan']
            if game.scheduler.step_of_stamp(from_time(m.header.stamp)) == frame[2]]
    found: list[tuple[np.ndarray, Any]] = []
    graph.peer.wait_until(lambda: found.extend(pairs()) or found, 'a plan and its frame')
    frame, plan = found[0]
    rows = frame[7:].reshape(-1, 5)
    assert np.array_equal(rows[:, :3], [list(point.positions[:3]) for point in plan.points])
    assert rows[:, 4] == pytest.approx(0.1 * np.arange(len(rows)))


@pytest.mark.exhaustive
def test_holding_a_key_drives_and_closing_lets_go(graph: Graph, page: PageClient) -> None:
    """The filter ramps the brake up; after the connection is gone it is off within 0.3 s."""
    with PageClient(graph.page) as driver:
        assert driver.request('claim', seat='hv0')['ok']
        graph.peer.forget()
        driver.hold_keys('hv0', [0, 1, 0, 0])
        graph.peer.wait_until(
            lambda: graph.peer.messages['/timing/cycle'] and _commands(graph)[-1, 1] == 1.0,
            'the whole brake')
        # r_br+ = 2.5 / s is 0.025 a cycle: 40 cycles to the whole pedal, of which a busy machine
        # may miss some, each on the ramp.
        brake = _commands(graph)[:, 1]
        ramp = np.unique(brake[(brake > 0.0) & (brake < 1.0)])
        assert len(ramp) >= 10
        assert np.allclose(np.round(ramp / 0.025) * 0.025, ramp, atol=1e-6)
        wait_until(lambda: page.seat('hv0')['holder'] == driver.id, 'the holder at the watcher')
        wait_until(lambda: page.vehicle(0)[9] == 1.0, "the brake in the watcher's frame")
        graph.peer.forget()
    # Released, then the gentle brake of the watchdog: not the held one again.
    graph.peer.wait_until(
        lambda: len(graph.peer.messages['/timing/cycle']) > 30
        and np.max(_commands(graph)[-30:, 1]) <= 0.151, 'the brake released')
    wait_until(lambda: page.seat('hv0')['holder'] is None, 'the seat without a holder')


@pytest.mark.clock
def test_silence_lets_go_too(graph: Graph, page: PageClient) -> None:
    """A page that hangs keeps its connection and its seat, but not the pedals."""
    page.order('claim', seat='hv0')
    page.hold_keys('hv0', [1, 0, 0, 0])
    graph.peer.forget()
    graph.peer.wait_until(
        lambda: graph.peer.messages['/timing/cycle'] and _commands(graph)[-1, 0] == 1.0,
        'full throttle')
    page.let_go()
    graph.peer.wait_until(lambda: _commands(graph)[-1, 0] == 0.0, 'the throttle released', 10.0)
    assert page.seat('hv0')['holder'] == page.id


@pytest.mark.clock
def test_hands_off_is_immediate(graph: Graph, page: PageClient) -> None:
    """A page sends hands off at blur: the next cycle that gets it has the pedals released."""
    page.order('claim', seat='hv0')
    page.hold_keys('hv0', [1, 0, 1, 0])
    graph.peer.forget()
    graph.peer.wait_until(
        lambda: graph.peer.messages['/timing/cycle'] and _commands(graph)[-1, 0] == 1.0,
        'full throttle')
    page.let_go()
    page.send({'type': 'input', 'seat': 'hv0', 'away': True})
    graph.peer.wait_until(lambda: _commands(graph)[-1, 0] == 0.0, 'the throttle released', 10.0)
    rows = _commands(graph)
    released = int(np.flatnonzero(rows[:, 0] > 0.0)[-1]) + 1
    # The pedal goes from full to zero in one cycle, and the steering with it: no ramp.
    assert rows[released - 1, 0] > 0.9 and rows[released, 2] == 0.0


def test_a_seat_changes_hands(graph: Graph, page: PageClient) -> None:
    """A seat is claimed by one page, refused to the other, asked for, handed over, given back."""
    with PageClient(graph.page) as other:
        other.send({'type': 'name', 'name': 'Bob <i>'})
        page.order('claim', seat='hv0')
        refused = other.request('claim', seat='hv0')
        assert not refused['ok'] and 'ask for it' in refused['text']
        assert other.request('ask', seat='hv0')['ok']
        wait_until(lambda: page.seat('hv0')['requests'], 'the request')
        assert page.seat('hv0')['requests'][0]['client'] == other.id
        assert not other.request('hand_over', seat='hv0', to=other.id)['ok']
        page.order('hand_over', seat='hv0', to=other.id)
        wait_until(lambda: page.seat('hv0')['offer'] is not None, 'the offer')
        assert page.seat('hv0')['holder'] == page.id
        assert other.request('answer', seat='hv0', accept=True)['ok']
        wait_until(lambda: page.seat('hv0')['holder'] == other.id, 'the new holder')
        # Input of the page that has handed over is ignored.
        other.hold_keys('hv0', [0, 1, 0, 0])
        page.hold_keys('hv0', [1, 0, 0, 0])
        graph.peer.forget()
        graph.peer.wait_until(
            lambda: graph.peer.messages['/timing/cycle'] and _commands(graph)[-1, 1] == 1.0,
            'the brake of the new holder')
        assert _commands(graph)[-1, 0] == 0.0
        page.let_go()
        other.let_go()
        assert other.request('release', seat='hv0')['ok']
    graph.peer.wait_until(lambda: _commands(graph)[-1, 0] == THROTTLE, 'the script again')


def test_run_control(graph: Graph, page: PageClient) -> None:
    """The page can pause, step by one tick, set another pace and reset."""
    page.order('control', action='pause')
    wait_until(lambda: page.documents['status']['run'] == 'paused', 'the pause')
    before = page.documents['status']['n']
    page.order('control', action='step')
    wait_until(lambda: page.documents['status']['n'] == before + 10, 'ten steps')
    page.order('rate', factor=2.0)
    page.order('control', action='start')
    wait_until(lambda: page.documents['status']['run'] == 'running'
               and page.documents['status']['real_time_factor'] == 2.0, 'the double pace')
    page.order('rate', factor=1.0)
    assert not page.request('planner', av='av7', run=False)['ok']
    epoch = page.documents['status']['epoch']
    page.order('control', action='reset')
    wait_until(lambda: page.documents['scene']['time']['epoch'] == epoch + 1, 'the next epoch')
    wait_until(lambda: page.documents['status']['epoch'] == epoch + 1
               and page.documents['status']['run'] == 'running', 'the run of it')


@pytest.mark.exhaustive
def test_planner_stop_and_go(graph: Graph, page: PageClient) -> None:
    """The AV's row shows that its planner is stopped, and its plans stop coming."""
    page.order('planner', av='av0', run=False)
    wait_until(lambda: _planner(page).get('running') is False, 'the stop')
    page.order('planner', av='av0', run=True)
    wait_until(lambda: _planner(page).get('running') is True, 'the go')


def _planner(page: PageClient) -> dict:
    """Return the row of av0, empty before its first report in an epoch."""
    return dict(page.documents['status']['planners'].get('av0', {}))


def test_trigger(graph: Graph, page: PageClient) -> None:
    """The event fires once, is shown with its step, and the obstacle is there."""
    event, = page.documents['scene']['events']
    assert event['name'] == 'box' and event['label'] == 'A <b>box</b> falls'
    assert not page.request('trigger', event='storm')['ok']
    assert page.documents['events']['fired'] == []
    page.order('trigger', event='box')
    wait_until(lambda: page.documents['events']['fired'], 'the event')
    fired, = page.documents['events']['fired']
    assert (fired['name'], fired['by']) == ('box', 'trigger') and fired['n'] == 10 * fired['k']
    assert graph.peer.n >= 0
    wait_until(lambda: (frame := page.newest(2)) is not None and frame[6] == 60.0, 'the box')


@pytest.mark.exhaustive
def test_another_game_with_more_vehicles(graph: Graph, page: PageClient) -> None:
    """A game chosen from the list begins by a reset; its second AV gets a planner of its own."""
    with urllib.request.urlopen(f'{graph.page}api/scenarios', timeout=10) as answer:
        content = json.load(answer)
    entries = [entry for folder in content['folders'] for entry in folder['entries']]
    chosen = next(entry for entry in entries if entry['name'] == 'two_avs.yaml')
    before = page.documents['scene']['time']['epoch']
    _post(f'{graph.page}api/load', {
        'id': chosen['id'], 'humans': [{'id': 'hv0', 'driver': 'cockpit'}],
        'avs': [{'id': 'av0', 'planner': 'idm'}, {'id': 'av1', 'planner': 'constant-velocity'}]})
    wait_until(lambda: page.documents['scene']['time']['epoch'] > before, 'the new game')
    assert [vehicle['id'] for vehicle in page.documents['scene']['vehicles']] \
        == ['hv0', 'av0', 'av1']
    page.order('claim', seat='hv0')
    page.hold_keys('hv0', [0, 0, 0, 0])
    page.order('control', action='start')
    wait_until(lambda: page.documents['status']['planners'].get('av1', {}).get('accepted', 0) > 5,
               'plans of the second AV')
    assert graph.launcher.says('planner_node_av1: process')
    assert page.documents['status']['planners']['av1']['planner'] == 'constant-velocity'
    assert page.documents['seats']['seats']['hv0']['driver'] == 'cockpit'
    page.let_go()
    page.order('release', seat='hv0')
    steady = next(entry for entry in entries if entry['name'] == 'cut_in.yaml')
    _post(f'{graph.page}api/load', {'id': steady['id'], 'humans': [], 'avs': []})
    wait_until(lambda: len(page.documents['scene']['vehicles']) == 2, 'the first game')


def _post(url: str, content: dict) -> dict:
    request = urllib.request.Request(url, json.dumps(content).encode(), {
        'Content-Type': 'application/json', 'X-Crgame': '1'})
    with urllib.request.urlopen(request, timeout=30) as answer:
        return json.load(answer)


@pytest.mark.exhaustive
def test_a_dead_cockpit_is_replaced_and_the_run_goes_on(graph: Graph) -> None:
    """After a kill the run keeps its pace, and a new cockpit starts at once."""
    with PageClient(graph.page) as client:
        client.order('claim', seat='hv0')
        client.hold_keys('hv0', [1, 0, 0, 0])
        n = graph.peer.n
        graph.peer.wait_until(lambda: graph.peer.n > n + 50 or graph.peer.n < n, 'half a second')
        os.kill(graph.launcher.node('cockpit_node'), signal.SIGKILL)
        graph.launcher.wait_for_restart('cockpit_node')
        wait_until(lambda: client.closed, 'the end of the connection')
    graph.peer.forget()
    graph.peer.wait_until(lambda: graph.peer.messages['/timing/cycle'], 'a cycle')
    graph.peer.wait_until(lambda: _commands(graph)[-1, 0] == 0.0, 'the throttle released')
    wait_until(lambda: sum('the cockpit is at' in line for line in graph.launcher.lines) > 1,
               'the address of the new one')
    with PageClient(graph.launcher.page) as client:
        # It gets the graph's seats a moment after it begins to serve.
        wait_until(lambda: 'hv0' in client.documents.get('seats', {}).get('seats', {}),
                   'the seats')
        # The seat is kept for the client that had it at the dead cockpit; here all are directors.
        wait_until(lambda: client.seat('hv0')['source'] == 'cockpit'
                   and client.seat('hv0')['holder'] is None, 'the empty seat')
        assert client.seat('hv0')['kept']['name'].startswith('Guest')
        client.order('claim', seat='hv0')
        client.order('release', seat='hv0')


@pytest.mark.exhaustive
def test_the_next_port_is_taken_when_one_is_in_use(tmp_path: Path) -> None:
    """The launcher says so; the seat must be taken before a `cockpit` driver's run begins."""
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        taken.listen()
        port = int(taken.getsockname()[1])
        with Launcher([SCENARIOS / 'cut_in.yaml', '--driver', 'cockpit', '--port', port,
                       '--duration', '1'], tmp_path / 'run', headless=False) as launcher:
            page = launcher.page
            assert urlsplit(page).port != port
            launcher.wait_for(f'port {port} is taken')
            with PageClient(page) as client:
                wait_until(lambda: client.documents.get('status', {}).get('run') == 'paused',
                           'the run to wait')
                client.order('claim', seat='hv0')
                client.order('control', action='start')
                client.hold_keys('hv0', [0, 0, 0, 0])
                assert launcher.wait() == 0
    assert not launcher.says('driver_node')
    assert (tmp_path / 'run' / 'timing.json').is_file()
