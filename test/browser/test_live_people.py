# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two people drive one game in two browsers over TLS, with spectators and attackers."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
import http.client
from pathlib import Path
import re
import signal
import socket
import ssl
import threading
from typing import Any
from urllib.parse import urlsplit

from browser_support import Browser, OpenBrowser
from live_browser_support import Graph, LivePage, PATIENCE_S, THROTTLE
from live_peer import Peer
from live_support import is_node, Launcher, ROOT, wait_until
import numpy as np
import pytest
from selenium.common.exceptions import WebDriverException
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
import yaml

pytestmark = pytest.mark.exhaustive

TOPICS = ('/clock', '/scenario/game', '/timing/cycle', '/vehicles/state', '/seats/drivers')
HOSTILE = 20
LONG_S, SHORT_S = 3600.0, 6.0
# The least real-time factor.
SLOWEST = 0.1


@pytest.fixture
def graph(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Graph]:
    """Keep one graph of the example for two people, open by links, of a duration [s]."""
    game = yaml.safe_load((ROOT / 'examples' / 'two_humans.yaml').read_text())
    game |= {'scenario': str(ROOT / 'scenarios' / 'ZAM_Merge-1_1_T-1.xml'),
             'duration': request.param}
    (tmp_path / 'game.yaml').write_text(yaml.safe_dump(game))
    with Launcher([tmp_path / 'game.yaml', '--open-cockpit', '--listen', '127.0.0.1'],
                  tmp_path / 'run', headless=False) as launcher, \
            Peer(launcher.domain, *TOPICS) as peer:
        launcher.wait_for('its certificate')
        peer.wait_until(lambda: peer.games, 'the game')
        yield Graph(launcher, peer, '')


def link(graph: Graph, purpose: str) -> str:
    """Return a printed link."""
    found = re.search(rf'to {purpose} +(https://\S+)', graph.launcher.text)
    assert found, graph.launcher.text
    return found[1]


class Person(LivePage):
    """A person admitted by a link, in a browser that trusts the certificate."""

    def __init__(self, graph: Graph, browser: Browser, purpose: str, name: str) -> None:
        super().__init__(graph._replace(address=link(graph, purpose)), browser)
        if name:
            field = self.driver.find_element(By.ID, 'my-name')
            field.send_keys(Keys.CONTROL, 'a')
            field.send_keys(name, Keys.ENTER)
        self.keep_messages()

    def ask(self, **message: Any) -> dict[str, Any]:
        """Send a request regardless of the page's buttons; return the reply."""
        return dict(self.run_async('return crgame.connection.request(arguments[0]);', message))


def throttle(graph: Graph, seat: str) -> float:
    """Return the throttle that a vehicle obeyed last."""
    graph.peer.listen()
    return float(graph.commands(seat)[1][-1, THROTTLE]) \
        if graph.peer.messages['/timing/cycle'] else np.nan


def attack(address: str, number: int) -> bool:
    """Send requests without a link; return whether they were refused with an answer."""
    host, port = urlsplit(address).hostname or '', urlsplit(address).port or 0
    context = ssl._create_unverified_context()
    try:
        with socket.create_connection((host, port), PATIENCE_S) as plain:
            if number % 4 == 0:
                plain.sendall(b'GET / HTTP/1.1\r\n' + b'\x00\xff' * 100)
                plain.recv(100)
                return False
            with context.wrap_socket(plain) as peer:
                if number % 4 == 1:
                    peer.sendall(b'NONSENSE \x01\r\nHost: :\r\n\r\n')
                    peer.recv(100)
                    return False
                if number % 4 == 2:
                    peer.sendall(f'GET /ws HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: '
                                 'Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13'
                                 '\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n'
                                 .encode())
                else:
                    peer.sendall(f'POST /api/load HTTP/1.1\r\nHost: {host}:{port}\r\nX-Crgame: '
                                 '1\r\nContent-Length: 2\r\n\r\n{}'.encode())
                answer = peer.recv(100)
    except OSError:
        # The server closed the connection, as expected.
        return False
    assert answer.startswith(b'HTTP/1.1 403 '), answer
    return True


@pytest.mark.parametrize('graph', [LONG_S], indirect=True)
def test_two_people_drive_one_game(graph: Graph, new_browser: OpenBrowser) -> None:
    """Two people share a game: seats, readiness, countdown, lost page, spectator, attackers."""
    peer, launcher = graph.peer, graph.launcher
    anna = Person(graph, new_browser(1000, 640, trusting=True), 'drive hv0', 'Anna')
    bert = Person(graph, new_browser(1000, 640, trusting=True), 'drive hv1', 'Bert')
    watcher = Person(graph, new_browser(1000, 640, trusting=True), 'watch', '')

    # A link admits one browser, and the next one gets the reason.
    status, text = get(link(graph, 'drive hv0'))
    assert status == 403 and 'This link has been used' in text

    # Each driver has one seat; the server decides, regardless of the page.
    anna.claim('hv0')
    bert.claim('hv1')
    assert 'your link is for hv1' in bert.ask(type='claim', seat='av0', device='')['text']
    watcher.wait_for_text('li[data-seat="hv0"]', 'Driven by Anna')
    for message in ({'type': 'claim', 'seat': 'av0', 'device': ''},
                    {'type': 'hand_over', 'seat': 'hv0', 'to': 'c1'},
                    {'type': 'ready', 'seat': 'hv0', 'ready': 1},
                    *({'type': 'control', 'action': action, 'all': 1}
                      for action in ('start', 'pause', 'step', 'reset', 'stop')),
                    {'type': 'rate', 'factor': 0.1}, {'type': 'role', 'role': 'all'},
                    {'type': 'planner', 'av': 'av0', 'run': 0}):
        reply = watcher.ask(**message)
        assert 'spectator' in reply['text'], (message, reply)
    assert 'only a director can reset the run' in anna.ask(
        type='control', action='reset')['text']
    button = watcher.driver.find_element(By.CSS_SELECTOR, '#run-control [data-action="reset"]')
    assert not button.is_enabled() and 'Only a director' in (button.get_attribute('title') or '')

    # One ready driver is not enough; with both the run starts after the countdown.
    anna.click('.lobby .primary')
    bert.wait('crgame.store.seats.hv0.ready', 'her readiness')
    peer.listen_for(0.5)
    assert bert.run('return crgame.store.status.n') == 0
    watcher.run("""window.counted = false;
        crgame.store.on('status', ({ countdown_s }) => { window.counted ||= countdown_s > 0; });
        """)
    bert.click('.lobby .primary')
    watcher.wait('window.counted', 'the countdown')
    watcher.wait('crgame.store.status.run === "running" && crgame.store.status.n > 10', 'the run')

    # Both drive their own vehicles. A driver's P pauses nothing.
    anna.hold('w')
    bert.hold('s')
    graph.wait_for_command('hv0', THROTTLE, 1.0, 1.0)
    graph.wait_for_command('hv1', 1, 1.0, 1.0)
    bert.hold('p')
    bert.release('p')
    graph.wait_for_steps(20)
    anna.release('w')
    anna.hold('w')
    watcher.wait('crgame.store.people.filter((person) => person.input_delay_ms > 0).length === 2',
                 'both delays')

    # One page is killed: the vehicle brakes by itself, and its driver returns to the kept seat.
    own = anna.driver.current_window_handle
    anna.driver.switch_to.new_window('tab')
    spare = anna.driver.current_window_handle
    anna.driver.switch_to.window(own)
    crash(anna)
    bert.wait_for_text('li[data-seat="hv0"]', 'Kept for Anna')
    # The watchdog's gentle brake is 0.15.
    graph.wait_for_command('hv0', 1, 0.05, 0.16)
    anna.driver.switch_to.window(spare)
    ActionBuilder(anna.driver).clear_actions()
    anna.graph = anna.graph._replace(address=link(graph, 'drive hv0').partition('?')[0])
    anna.open()
    anna.wait('crgame.driving.seat === "hv0"', 'her seat')
    anna.driver.execute_cdp_cmd('Page.bringToFront', {})
    anna.wait('crgame.driving.away === null', 'her hands')
    anna.hold('w')
    graph.wait_for_command('hv0', THROTTLE, 1.0, 1.0)

    # Clients without a link change nothing.
    n = peer.n
    with ThreadPoolExecutor(HOSTILE) as strangers:
        attacks = [strangers.submit(attack, link(graph, 'watch'), number)
                   for number in range(HOSTILE)]
    refused = [each.result() for each in attacks]
    assert any(refused)
    graph.wait_for_command('hv1', 1, 1.0, 1.0)
    assert peer.n > n and throttle(graph, 'hv0') == 1.0
    assert watcher.run('return [crgame.store.seats.hv0.holder_name, '
                       'crgame.store.seats.hv1.holder_name]') == ['Anna', 'Bert']
    assert 'Traceback' not in launcher.text + '\n'.join(launcher.errors)

    assert bert.browser.console_errors() == watcher.browser.console_errors() == []
    check_recording(graph)


@pytest.mark.parametrize('graph', [SHORT_S], indirect=True)
def test_a_game_ends_for_everybody(graph: Graph, new_browser: OpenBrowser) -> None:
    """Others see a director's actions with the name; at the end each gets the result."""
    # The run must not be over before the director's last action, nor before it is looked at.
    assert graph.peer.set_parameter('real_time_factor', SLOWEST).successful
    dora = Person(graph, new_browser(1000, 640, trusting=True), 'direct', 'Dora')
    drivers = {seat: Person(graph, new_browser(1000, 640, trusting=True), f'drive {seat}', name)
               for seat, name in (('hv0', 'Anna'), ('hv1', 'Bert'))}
    dora.wait('crgame.store.me.name === "Dora"', 'her name')
    for seat, person in drivers.items():
        person.claim(seat)
    for person in drivers.values():
        person.click('.lobby .primary')
    dora.wait('crgame.store.status.run === "running" && crgame.store.status.n > 0', 'the run')
    for deed, told in (('pause', 'paused'), ('start', 'started'), ('reset', 'reset')):
        dora.order(deed)
        for person in drivers.values():
            person.wait_for_text('#notices', f'Dora {told} the run')
            person.wait_for_run('paused' if deed == 'pause' else 'running')
    assert 'Dora' not in dora.text('#notices'), 'she knows'
    # After the reset they drive to the end without further confirmation.
    assert graph.peer.set_parameter('real_time_factor', 1.0).successful
    for seat, person in drivers.items():
        person.wait_for_run('ended')
        person.wait('document.querySelector(".score[data-state=told]")', 'the score')
        text = person.text('#outcome')
        assert f'Its duration of {SHORT_S:.1f} s is over' in text
        assert person.run("""return [...document.querySelectorAll('.score-vehicle')].map(
            (node) => node.dataset.vehicle);""")[0] == seat, 'their own score first'
        assert 'Only a director can choose what is run; you are a driver.' in text
        assert person.run("""return ['again', 'next', 'another', 'look'].map((action) => document
            .querySelector(`#outcome [data-action=${action}]`).disabled);""") == [
            True, True, True, False]
        assert person.run('return crgame.store.status.t') == SHORT_S
    assert graph.peer.set_parameter('real_time_factor', SLOWEST).successful
    dora.click('#outcome [data-action=again]')
    for person in drivers.values():
        person.wait('document.querySelector("#outcome").hidden'
                    ' && crgame.store.status.run === "running"', 'the next run')
    assert [each.browser.console_errors() for each in (dora, *drivers.values())] == [[], [], []]
    assert 'Traceback' not in graph.launcher.text + '\n'.join(graph.launcher.errors)
    graph.launcher.signal(signal.SIGINT)
    wait_until(lambda: not any(is_node(pid) for _, pid in graph.launcher.started), 'the end')


def crash(person: Person) -> None:
    """End the process of the present tab."""
    def kill() -> None:
        try:
            person.driver.execute_cdp_cmd('Page.crash', {})
        except WebDriverException:
            # No process is left to answer.
            return
    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    thread.join(5.0)


def get(address: str) -> tuple[int, str]:
    """Open a link as a program does."""
    parts = urlsplit(address)
    connection = http.client.HTTPSConnection(
        parts.netloc, context=ssl._create_unverified_context(), timeout=PATIENCE_S)
    connection.request('GET', f'{parts.path}?{parts.query}')
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text


def check_recording(graph: Graph) -> None:
    """End all processes, and read the drivers from the bag."""
    from crgame_ros.recording.run_record import read_run_record
    launcher = graph.launcher
    launcher.signal(signal.SIGINT)
    wait_until(lambda: not any(is_node(pid) for _, pid in launcher.started), 'the end',
               PATIENCE_S)
    drivers = [item for item in read_run_record(launcher.out / 'bag').drivers
               if item.spell.person is not None]
    assert [(item.spell.seat, item.spell.person.name, item.spell.person.role)
            for item in drivers if item.spell.until_n is None] == [
        ('hv1', 'Bert', 'driver'), ('hv0', 'Anna', 'driver')]
    first = next(item for item in drivers if item.spell.seat == 'hv0')
    assert first.spell.person.device == 'Keyboard'
    assert re.fullmatch(r'(Chromium|Chrome) [0-9]+', first.spell.person.browser)
    assert first.spell.from_n == 0 < (first.spell.until_n or 0)
    assert all(0.0 < (item.input_delay_ms or 0.0) < 5_000.0 for item in drivers)
