# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bare page for driving only, framed by a page at another port, on a real graph."""

from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
import threading
from typing import Any, NamedTuple

from browser_support import Browser
from crgame_ros.messages.status_values import read_status
from live_browser_support import Graph, live_graph, PATIENCE_S, SCENARIOS, THROTTLE
from live_peer import Peer
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

pytestmark = pytest.mark.clock

GAME = f"""
scenario: {SCENARIOS / 'ZAM_Crossing-1_1_T-1.xml'}
duration: 3600
humans:
  - {{id: hv0, driver: cockpit, spawn: {{lanelet: 22, s: 40.0, d: 0.0, speed: 0.0}}}}
avs:
  - {{id: av0, planning_problem: 100, planner: idm}}
"""
# Stands for an experimenter's page: it shows the stage and keeps its messages.
AROUND = """<!DOCTYPE html><title>around</title><style>iframe {{ width: 900px; height: 500px }}
</style><button>Ready</button>
<iframe src="{address}" allow="gamepad; fullscreen; autoplay"></iframe>
<script>
window.told = [];
window.addEventListener('message', (event) => {{
  window.told.push({{ origin: event.origin, at_ms: performance.now(), ...event.data }});
}});
window.order = (message) => document.querySelector('iframe').contentWindow.postMessage(
  {{ crgame: 1, ...message }}, '*');
</script>"""


class Around(NamedTuple):
    """A server of pages that show another one."""

    origin: str
    shown: list[str]


@contextmanager
def page_around() -> Iterator[Around]:
    """Serve a page that frames the last noted address."""
    shown: list[str] = []

    class Handler(BaseHTTPRequestHandler):

        def do_GET(self) -> None:  # noqa: N802
            body = AROUND.format(address=shown[-1]).encode()
            self.send_response(200)
            self.send_header('Content-Type', 'text/html')
            self.send_header('Content-Length', str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: Any) -> None:
            pass

    server = ThreadingHTTPServer(('127.0.0.1', 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield Around(f'http://127.0.0.1:{server.server_port}', shown)
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@pytest.fixture(scope='module')
def around() -> Iterator[Around]:
    """Keep the page that may show the stage."""
    with page_around() as page:
        yield page


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory, around: Around) -> Iterator[Graph]:
    """Keep one graph, which one page may show, and whose run waits for its driver."""
    folder = tmp_path_factory.mktemp('stage')
    (folder / 'game.yaml').write_text(GAME)
    with live_graph(folder / 'game.yaml', folder / 'run', '--framed-by', around.origin) as graph:
        yield graph


def state(browser: Browser) -> dict[str, Any]:
    """Return the stage's last message."""
    return dict(browser.run('return window.told.at(-1)?.state ?? {}'))


def wait_for_state(browser: Browser, condition: str) -> dict[str, Any]:
    """Wait until the stage has sent a state; `s` is its newest state."""
    try:
        browser.wait(f'((s) => {condition})(window.told.at(-1).state)', condition)
    except pytest.fail.Exception:
        print(f'the stage told last: {state(browser)}')
        raise
    return state(browser)


def seen(peer: Peer) -> dict[str, str]:
    """Return the last recorded description of the picture in the seat."""
    return next((read_status(status).values
                 for message in reversed(peer.messages['/diagnostics'])
                 for status in message.status if status.name == 'cockpit_node: hv0 view'), {})


@contextmanager
def within(browser: Browser) -> Iterator[None]:
    """Switch into the frame."""
    browser.driver.switch_to.frame(browser.driver.find_element(By.TAG_NAME, 'iframe'))
    try:
        yield
    finally:
        browser.driver.switch_to.default_content()


def test_a_driver_takes_the_seat_gets_ready_drives_and_steers_nothing_else(
        graph: Graph, around: Around, module_browser: Browser) -> None:
    """The address seats the driver, the outer page makes it ready, and only driving keys act."""
    browser = module_browser
    around.shown.append(f'{graph.address}?stage=hv0&view=map&lang=de')
    browser.open(around.origin)
    waiting = wait_for_state(browser, 's.seated && s.connected && s.run !== null')
    assert waiting['run'] in ('waiting', 'paused') and not waiting['ready']
    assert waiting['view'] == 'map' and waiting['seat'] == 'hv0' and waiting['sound'] == 'waits'
    assert not waiting['hasInput'] and waiting['away'] == 'focus'
    assert browser.run('return window.told.every(({ origin, crgame, kind }) => '
                       'origin + "/" === arguments[0] && crgame === 1 && kind === "stage")',
                       graph.address)
    # The outer page asks for readiness and has the focus for it.
    assert waiting['trouble'] == ''
    browser.driver.find_element(By.TAG_NAME, 'button').click()
    browser.run("window.order({ kind: 'ready', ready: 'yes' }); window.order({ kind: 'start' });"
                "window.order({ kind: 'focus' })")
    wait_for_state(browser, 's.hasInput && !s.ready && s.trouble === ""')
    browser.run("window.order({ kind: 'ready', ready: true })")
    wait_for_state(browser, 's.countdown_s > 0 || s.run === "running"')
    running = wait_for_state(browser, 's.run === "running" && s.time_s > 0.2')
    assert running['epoch'] == waiting['epoch'] and running['device'] == 'Keyboard'
    browser.driver.find_element(By.TAG_NAME, 'button').click()
    wait_for_state(browser, 's.away === "focus" && s.trouble.startsWith("Hands off")')
    with within(browser):
        browser.wait("document.querySelector('.stage-line').textContent"
                     " === 'Zum Fahren hier klicken.'")
    browser.run("window.order({ kind: 'focus' })")
    wait_for_state(browser, 's.hasInput && s.trouble === ""')

    ActionChains(browser.driver).key_down('w').perform()
    graph.wait_for_command('hv0', THROTTLE, 0.2, 1.0)
    assert wait_for_state(browser, 's.sound === "on"')['delay_ms'] is not None
    for key in ('p', 'n', 'v', 'c', 'm', 'f', 'l', 'h', '0', Keys.ESCAPE):
        ActionChains(browser.driver).send_keys(key).perform()
    ActionChains(browser.driver).key_down('r').pause(1.0).key_up('r').key_up('w').perform()
    with within(browser):
        for message in ({'type': 'control', 'action': 'pause'}, {'type': 'rate', 'factor': 2}):
            answer = browser.run_async('return await crgame.connection.request(arguments[0])',
                                       message)
            assert not answer['ok'] and 'only a director' in answer['text']
    told = wait_for_state(browser, 's.time_s > arguments[0]'.replace(
        'arguments[0]', str(state(browser)['time_s'])))
    assert (told['run'], told['epoch'], told['view'], told['sound']) == (
        'running', waiting['epoch'], 'map', 'on')
    first, last, count = browser.run("""
        const told = window.told;
        return [told[0].at_ms, told.at(-1).at_ms, told.length];""")
    assert count <= (last - first) / 100.0 + 2


def test_nothing_is_seen_but_the_view_and_the_dashboard(
        graph: Graph, around: Around, module_browser: Browser) -> None:
    """The stage has no panel, button or name, and the small map only on request."""
    browser = module_browser
    wait_for_state(browser, 's.seated')
    with within(browser):
        text = browser.run('return document.body.innerText')
        assert not any(word in text for word in ('hv0', 'av0', 'idm', 'Keyboard', 'Reset'))
        assert 'km/h' in text and 'Bremse' in text
        assert browser.run("""return [...document.querySelectorAll(
            'button, select, input, a, [role=tab]')].every(
            (node) => node.getClientRects().length === 0)""")
        assert browser.run("""
            const box = document.querySelector('#world').getBoundingClientRect();
            return [box.left, box.top, box.width, box.height]""") == [0, 0, 900, 500]
        assert browser.run("""return ['people', 'runControl', 'scenario', 'history', 'planners',
            'perception', 'settings', 'outcome'].every((part) => !(part in crgame))""")
        # A wheel or a finger on the map moves nothing.
        browser.run("""document.elementFromPoint(450, 100).dispatchEvent(
            new WheelEvent('wheel', { deltaY: 400, bubbles: true, cancelable: true }))""")
        assert browser.run('return crgame.world.followed') == 'hv0'


def test_a_new_visit_gets_the_seat_again_and_the_view_of_its_address(
        graph: Graph, around: Around, module_browser: Browser) -> None:
    """It has the driver's view if the library exists, else the map, and reports it."""
    browser = module_browser
    around.shown.append(f'{graph.address}?stage=hv0&view=driver&map=0')
    browser.open(around.origin)
    # The view cannot be drawn without the library: both get the same message.
    told = wait_for_state(browser, 's.seated && (s.view === "driver" || s.missing3d)')
    assert (told['view'] == 'map') is told['missing3d']
    shown = {'shown': told['view'], 'bare': 'true', 'plans': 'false', 'inset': 'false',
             'width_px': '900', 'height_px': '500'}
    with Peer(graph.launcher.domain, '/diagnostics') as peer:
        peer.wait_until(lambda: shown.items() <= seen(peer).items(),
                        'what the page shows to be told', PATIENCE_S)
        peer.wait_until(lambda: float(seen(peer)['rate_hz'] or 'nan') >= 0.0,
                        'how often it is drawn', PATIENCE_S)
    with within(browser):
        assert browser.run("""return getComputedStyle(document.querySelector('#world')).display
            === (crgame.view3d.on ? 'none' : 'block')""")
        assert browser.run('return localStorage.getItem("crgame.view3d-inset")') is None
    browser.driver.find_element(By.TAG_NAME, 'button').click()
    browser.run("window.order({ kind: 'focus' })")
    wait_for_state(browser, 's.hasInput')


def test_a_seat_that_is_not_there_or_not_free_is_told(
        graph: Graph, around: Around, module_browser: Browser) -> None:
    """The stage gives the reason for the missing seat to the driver and the outer page."""
    browser = module_browser
    around.shown.append(f'{graph.address}?stage=hv7&view=map')
    browser.open(around.origin)
    assert wait_for_state(browser, 's.trouble !== "" && s.connected && s.run !== null'
                          ' && s.trouble.includes("no such")')['seated'] is False


def test_a_passenger_in_an_av_rides_along(
        graph: Graph, around: Around, module_browser: Browser) -> None:
    """The AV's planner keeps driving; the picture is the AV's, and no error is shown."""
    browser = module_browser
    around.shown.append(f'{graph.address}?stage=av0&view=map')
    browser.open(around.origin)
    told = wait_for_state(browser, 's.connected && s.time_s !== null && s.trouble === ""')
    assert told['rides'] and not told['seated'] and not told['hasInput']
    with within(browser):
        browser.wait("crgame.world.followed === 'av0'")
        assert browser.run('return crgame.store.seats.av0.holder') is None


def test_no_other_page_can_show_the_cockpit(
        graph: Graph, around: Around, module_browser: Browser) -> None:
    """The same page at another port gets an empty frame and no messages."""
    browser = module_browser
    with page_around() as stranger:
        stranger.shown.append(f'{graph.address}?stage=hv0&view=map')
        browser.open(stranger.origin)
        browser.wait('document.readyState === "complete"')
        with within(browser):
            browser.wait('!location.href.startsWith("http") || !window.crgame')
            assert browser.run('return window.crgame === undefined')
        assert browser.run('return window.told.length') == 0
    assert any('frame-ancestors' in error for error in browser.console_errors())
