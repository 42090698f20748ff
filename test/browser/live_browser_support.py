# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A running graph, the pages that people have open on it, and their input."""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
import signal
import sys
from typing import Any, NamedTuple

from browser_support import Browser
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from selenium.webdriver.common.action_chains import ActionChains

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'live'))

from live_peer import Peer  # noqa: E402, I100 - importable from here on
from live_support import is_node, Launcher, SCENARIOS, wait_until  # noqa: E402

__all__ = ['Graph', 'live_graph', 'LivePage', 'PATIENCE_S', 'SCENARIOS']

# Timeout of events that must come [s]: many times the duration on an idle machine.
PATIENCE_S = 120.0
THROTTLE, BRAKE, STEERING = 0, 1, 2
# How long the page shows notices and mishaps [ms]; a slow test would look too late.
MESSAGES_STAY_MS = (5000, 9000, 10000)
_TOPICS = ('/clock', '/scenario/game', '/timing/cycle', '/vehicles/state', '/diagnostics')


class Graph(NamedTuple):
    """A graph with a cockpit, a peer that subscribes to it, and the address of its page."""

    launcher: Launcher
    peer: Peer
    address: str

    def commands(self, vehicle: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return n (R) and the (R, 4) commands that a vehicle obeyed since the last `forget`."""
        self.peer.listen()
        table = self.peer.cycles()
        return table.column('n'), table.commands(vehicle)

    def wait_for_command(self, vehicle: str, column: int, low: float, high: float) -> None:
        """Wait for a cycle after this call whose command lies between two values."""
        self.peer.forget()

        def obeyed() -> bool:
            if not self.peer.messages['/timing/cycle']:
                return False
            value = self.commands(vehicle)[1][-1, column]
            return bool(low <= value <= high)
        self.peer.wait_until(
            obeyed, f'{vehicle} to obey {low:g} to {high:g} in column {column}', PATIENCE_S)

    def wait_for_steps(self, steps: int) -> None:
        """Wait for the simulation to run a number of steps."""
        self.peer.listen()
        last = self.peer.n + steps
        self.peer.wait_until(lambda: self.peer.n >= last, f'n = {last}', PATIENCE_S)


@contextmanager
def live_graph(game: Path, out: Path, *options: str) -> Iterator[Graph]:
    """
    Start the graph of a game with its cockpit, and end it.

    :param game: game file.
    :param out: folder of the run.
    :param options: of the command line.
    """
    with Launcher([game, *options], out, headless=False) as launcher, \
            Peer(launcher.domain, *_TOPICS) as peer:
        address = launcher.page
        peer.wait_until(lambda: peer.games, 'the game')
        try:
            yield Graph(launcher, peer, address)
        finally:
            # Killed nodes would leave their shared memory behind. Tests need no file that the
            # launcher makes of the recordings after their end.
            launcher.signal(signal.SIGINT)
            wait_until(lambda: not any(is_node(pid) for _, pid in launcher.started),
                       'the end of the nodes', PATIENCE_S)


class LivePage:
    """
    The page of a running graph in a browser, used by one person.

    :param graph: the graph of the page.
    :param browser: of the person.
    """

    def __init__(self, graph: Graph, browser: Browser) -> None:
        self.graph = graph
        self.browser = browser
        self.driver = browser.driver
        self.open()

    def open(self) -> None:  # noqa: A003
        """Load the page, and wait until all its parts exist and it shows the scene."""
        self.browser.open(self.graph.address)
        self.wait('window.crgame?.ready && crgame.world.shown && crgame.store.status'
                  ' && crgame.store.me.id && Object.keys(crgame.store.seats).length > 0',
                  'the page with all its parts')

    def run(self, script: str, *arguments: Any) -> Any:
        """Run a function body in the page."""
        return self.browser.run(script, *arguments)

    def run_async(self, script: str, *arguments: Any) -> Any:
        """Run the body of an async function in the page, and wait for what it returns."""
        return self.browser.run_async(script, *arguments)

    def wait(self, condition: str, what: str = '', *arguments: Any) -> Any:
        """Wait until an expression of the page is true; return its value."""
        return self.browser.wait(condition, what, PATIENCE_S, arguments)

    def text(self, selector: str) -> str:
        """Return the text of an element, as the page holds it; empty without the element."""
        return str(self.run(
            'return document.querySelector(arguments[0])?.textContent ?? ""', selector))

    def wait_for_text(self, selector: str, part: str) -> None:
        """Wait until an element has a text."""
        self.wait('document.querySelector(arguments[0])?.textContent.includes(arguments[1])',
                  f'{selector} to say {part!r}', selector, part)

    def click(self, selector: str) -> None:
        """Click an element with the mouse once it exists and is clickable."""
        self.browser.click(selector)

    def tab(self, name: str) -> None:
        """Open a panel by its tab."""
        self.click(f'#tab-{name}')
        self.wait('!document.querySelector(`#panel-${arguments[0]}`).hidden', '', name)

    def hold(self, key: str) -> None:
        """Press a key and keep it down."""
        ActionChains(self.driver).key_down(key).perform()

    def release(self, key: str) -> None:
        """Release a key."""
        ActionChains(self.driver).key_up(key).perform()

    def seat(self, seat: str) -> dict[str, Any]:
        """Return a seat as the page knows it."""
        return dict(self.run('return crgame.store.seats[arguments[0]]', seat))

    def seat_button(self, seat: str, action: str) -> str:
        """Return the selector of a button in a seat's row."""
        return f'li[data-seat="{seat}"] [data-action="{action}"]'

    def claim(self, seat: str) -> None:
        """Claim a seat by its button, and wait until the hands are on its controls."""
        self.tab('drive')
        self.click(self.seat_button(seat, 'claim'))
        self.wait('crgame.driving.seat === arguments[0] && crgame.driving.away === null'
                  ' && crgame.store.seats[arguments[0]].source === "cockpit"',
                  f'the seat {seat}', seat)

    def give_back(self, seat: str) -> None:
        """Release a seat by its button."""
        self.tab('drive')
        self.click(self.seat_button(seat, 'release'))
        self.wait('crgame.driving.seat === null'
                  ' && crgame.store.seats[arguments[0]].holder === null',
                  f'{seat} to be given back', seat)

    def order(self, action: str) -> None:
        """Press a button of the run control, and confirm if asked."""
        self.click(f'#run-control [data-action="{action}"]')
        if action in ('reset', 'stop'):
            self.click('dialog.confirm[open] .danger')

    def wait_for_run(self, state: str) -> None:
        """Wait until the run is waiting, running, paused or ended."""
        self.wait('crgame.store.status.run === arguments[0]', f'a run that is {state}', state)

    def pause(self) -> None:
        """Pause the run by the button, and wait until its last step is shown."""
        self.order('pause')
        self.wait_for_run('paused')
        self.wait('crgame.store.status.n === arguments[0] && crgame.world.shown.n === arguments[0]'
                  ' && !crgame.world.camera.moves', 'the last step in the picture',
                  self.graph.peer.wait_for_pause())

    def hold_at_the_start(self) -> None:
        """Begin the run anew, held at its first step."""
        self.pause()
        epoch = self.run('return crgame.store.status.epoch')
        self.order('reset')
        self.wait('crgame.store.status.epoch > arguments[0] && crgame.store.status.n === 0'
                  ' && crgame.store.status.run === "paused"'
                  ' && crgame.world.shown.epoch === crgame.store.status.epoch'
                  ' && crgame.world.shown.n === 0', 'the first step of a run', epoch)

    def wait_for_frame(self) -> None:
        """Wait until the page has drawn what it has received so far."""
        self.browser.wait_for_frame()

    def keep_messages(self) -> None:
        """Let messages stay that go by themselves after some seconds, till the next load."""
        self.run("""
            const setTimeoutOfPage = window.setTimeout;
            window.setTimeout = (call, ms, ...more) => setTimeoutOfPage(
              call, arguments[0].includes(ms) ? 1e9 : ms, ...more);""", MESSAGES_STAY_MS)

    def reset(self) -> None:
        """Reset by the button, and wait until the new run is shown and running."""
        epoch = self.run('return crgame.store.status.epoch')
        self.order('reset')
        self.wait('crgame.store.status.epoch > arguments[0]'
                  ' && ["running", "paused"].includes(crgame.store.status.run)', 'a reset', epoch)
        if self.run('return crgame.store.status.run') == 'paused':
            # The game's driver is a person in a browser, who starts the run.
            self.order('start')
        self.wait('crgame.store.status.n > 0 && crgame.store.status.run === "running"'
                  ' && crgame.world.shown?.epoch === crgame.store.status.epoch', 'a new run')

    def vehicle(self, index: int) -> NDArray[np.float64]:
        """Return the 13 numbers of a vehicle as last drawn."""
        row = self.run('const at = 13 * arguments[0];'
                       'return [...crgame.world.shown.vehicles.subarray(at, at + 13)];', index)
        return np.array([np.nan if value is None else value for value in row], dtype=float)

    def follow(self, vehicle_id: str) -> None:
        """Follow a vehicle with the camera, and wait until the camera has arrived."""
        self.run('crgame.world.follow(arguments[0], true);', vehicle_id)
        self.wait('!crgame.world.camera.moves', 'the camera to arrive')

    def picture(self, half_px: int = 150) -> NDArray[np.int64]:
        """Return a screenshot of the area ahead of the followed vehicle, (rows, columns, 3)."""
        x, y = self.run("""
            const { camera } = crgame.world;
            const box = document.querySelector('#world').getBoundingClientRect();
            return [box.left + camera.anchorX, box.top + camera.anchorY];""")
        with Image.open(BytesIO(self.driver.get_screenshot_as_png())) as image:
            box = [round(value) for value in (x - half_px, y - half_px, x + half_px, y)]
            return np.asarray(image.convert('RGB').crop(box), dtype=np.int64)
