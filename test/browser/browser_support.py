# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One headless Chromium, and the operations that tests of the page need."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import importlib.util
import os
from pathlib import Path
import re
import shutil
import time
from typing import Any, TYPE_CHECKING

from crgame_ros.page_libraries import find_libraries
import pytest

if TYPE_CHECKING:
    from selenium.webdriver.chrome.webdriver import WebDriver

PATIENCE_S = 120.0
WIDTH, HEIGHT = 1280, 720
_POLL_S = 0.05
_BROWSERS = ('chromium', 'chromium-browser', 'google-chrome')
_FLAGS = ('--headless', '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
          '--disable-background-networking', '--disable-component-update', '--disable-sync',
          '--disable-dev-shm-usage', '--force-color-profile=srgb')


def missing_programs() -> list[str]:
    """Return the names of tools that browser tests need and this machine lacks."""
    missing = [] if _chromium() else ['chromium']
    missing += [] if shutil.which('chromedriver') else ['chromedriver']
    missing += [] if importlib.util.find_spec('selenium') else ['the Python package selenium']
    return missing


def skip_without_three() -> None:
    """Skip a test of the 3D view where its library has not been fetched."""
    if find_libraries() is None:
        pytest.skip('the 3D view is not tested: `crgame page-libraries` has not fetched three.js')


def _chromium() -> str | None:
    return next(filter(None, map(shutil.which, _BROWSERS)), None)


# Where to click an element, or why that is impossible; whether it has been clicked is noted.
_CLICK_PLACE = """
const [selector] = arguments;
const element = document.querySelector(selector);
if (!element) { return 'is not there'; }
if (element.matches(':disabled')) { return 'is disabled'; }
element.scrollIntoView({block: 'nearest', inline: 'nearest'});
const box = element.getBoundingClientRect();
const place = [box.x + box.width / 2, box.y + box.height / 2];
const hit = document.elementFromPoint(...place);
if (!element.contains(hit)) { return `is behind ${hit?.outerHTML.slice(0, 100)}`; }
window.hasBeenClicked = false;
document.addEventListener('click', ({target}) => {
  window.hasBeenClicked = target.closest(selector) !== null;
}, {capture: true, once: true});
return place;
"""


# The colour of an element, and that of the ground behind it.
_COLOURS = """
const node = document.querySelector(arguments[0]);
let ground = node;
while (getComputedStyle(ground).backgroundColor === 'rgba(0, 0, 0, 0)') {
  ground = ground.parentElement;
}
const own = getComputedStyle(node);
return [node instanceof SVGElement ? own.fill : own.color,
        getComputedStyle(ground).backgroundColor];
"""


def _luminance(colour: str) -> float:
    parts = [int(part) / 255.0 for part in re.findall(r'\d+', colour)[:3]]
    red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
                        for part in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


class Browser:
    """
    One browser window.

    :param driver: its selenium driver, for calls that are not wrapped here.
    """

    def __init__(self, driver: 'WebDriver') -> None:
        self.driver = driver
        self._errors: list[str] = []

    def renew(self) -> None:
        """Reset to the state of a new start: another tab of 1280x720, no held key, no storage."""
        from selenium.webdriver.common.actions.action_builder import ActionBuilder

        ActionBuilder(self.driver).clear_actions()
        # Storage belongs to an address; a tab without one has no storage to clear.
        self.run('try { localStorage.clear(); sessionStorage.clear(); } catch {}')
        before = self.driver.window_handles
        self.driver.switch_to.new_window('tab')
        own = self.driver.current_window_handle
        for handle in before:
            self.driver.switch_to.window(handle)
            self.driver.close()
        self.driver.switch_to.window(own)
        self.driver.execute_cdp_cmd('Network.clearBrowserCookies', {})
        self.forget_errors()
        self.resize(WIDTH, HEIGHT)

    def open(self, address: str) -> None:  # noqa: A003
        """Load a page."""
        self.driver.get(address)

    def resize(self, width: int, height: int, ratio: float = 1.0) -> None:
        """Set the size of the page [CSS px], and how many pixels of the screen each has."""
        self.driver.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', {
            'width': width, 'height': height, 'deviceScaleFactor': ratio, 'mobile': False})

    def prefer(self, scheme: str) -> None:
        """Make the system prefer the dark or the light theme."""
        self.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {
            'features': [{'name': 'prefers-color-scheme', 'value': scheme}]})

    def run(self, script: str, *arguments: Any) -> Any:
        """Run a function body in the page; return its result as Python values."""
        return self.driver.execute_script(script, *arguments)

    def run_async(self, script: str, *arguments: Any) -> Any:
        """Run the body of an async function in the page; return its result."""
        self.driver.set_script_timeout(PATIENCE_S)
        answer = self.driver.execute_async_script(
            'const done = arguments[arguments.length - 1];'
            f'(async function () {{ {script} }}).apply(null, arguments).then('
            '(value) => done({value}), (error) => done({error: `${error}`}));', *arguments)
        if 'error' in answer:
            pytest.fail(answer['error'])
        return answer.get('value')

    def wait(self, condition: str, what: str = '', patience_s: float = PATIENCE_S,
             arguments: tuple[Any, ...] = ()) -> Any:
        """
        Wait until an expression of the page is true; an exception counts as false.

        :param condition: JavaScript expression; `arguments` holds the further arguments
        :param what: part of the failure message if it stays false
        :return: its value
        """
        end = time.monotonic() + patience_s
        while True:
            value, error = self.run(
                f'try {{ return [({condition}), null]; }} '
                'catch (error) { return [null, String(error)]; }', *arguments)
            if value:
                return value
            if time.monotonic() > end:
                pytest.fail(f'waited {patience_s:.0f} s in vain for {what or condition}'
                            f'{error and f" ({error})" or ""}; console: {self.console_errors()}')
            time.sleep(_POLL_S)

    def click(self, selector: str) -> None:
        """
        Click an element with the mouse, once it exists, is enabled and nothing is before it.

        By the mouse's own events: Selenium's click takes a second on a page that draws. If the
        page moves the element meanwhile, the click is repeated.
        """
        end = time.monotonic() + PATIENCE_S
        while True:
            place = self.run(_CLICK_PLACE, selector)
            if not isinstance(place, str):
                for kind in ('mouseMoved', 'mousePressed', 'mouseReleased'):
                    self.driver.execute_cdp_cmd('Input.dispatchMouseEvent', {
                        'type': kind, 'x': place[0], 'y': place[1], 'clickCount': 1,
                        'button': 'none' if kind == 'mouseMoved' else 'left'})
                # Nothing is known of it if the click has opened another page.
                if self.run('return window.hasBeenClicked') is not False:
                    return
                place = 'moves away'
            if time.monotonic() > end:
                pytest.fail(f'{selector} cannot be clicked: it {place}')
            time.sleep(_POLL_S)

    def wait_for_frame(self) -> None:
        """Wait until the page has drawn what it has received so far."""
        self.run_async('await new Promise((done) => requestAnimationFrame(() =>'
                       ' requestAnimationFrame(done)));')

    def contrast(self, selector: str) -> float:
        """Return the ratio of an element's colour to its background as WCAG 2 defines it."""
        colours = self.run(_COLOURS, selector)
        low, high = sorted(map(_luminance, colours))
        return (high + 0.05) / (low + 0.05)

    @contextmanager
    def offline(self) -> Iterator[None]:
        """Take the network away, and check afterwards that no error occurred."""
        # The log of requests lists all that the page requests.
        self.driver.execute_cdp_cmd('Network.enable', {})
        self.driver.execute_cdp_cmd('Network.emulateNetworkConditions', {
            'offline': True, 'latency': 0, 'downloadThroughput': 0, 'uploadThroughput': 0})
        yield
        self.driver.execute_cdp_cmd('Network.emulateNetworkConditions', {
            'offline': False, 'latency': 0, 'downloadThroughput': -1, 'uploadThroughput': -1})
        assert self.console_errors() == []

    def console_errors(self) -> list[str]:
        """Return every error that the page has logged since it was opened, also thrown ones."""
        self._errors += [entry['message'] for entry in self.driver.get_log('browser')
                         if entry['level'] == 'SEVERE']
        return list(self._errors)

    def forget_errors(self) -> None:
        """Clear the list that `console_errors` returns."""
        self.console_errors()
        self._errors.clear()

    def screenshot(self, path: Path) -> Path:
        """Save the visible page as PNG."""
        self.driver.save_screenshot(str(path))
        return path


OpenBrowser = Callable[..., Browser]


@contextmanager
def open_browser(profile: Path, width: int = WIDTH, height: int = HEIGHT, *,
                 sound: bool = False, trusting: bool = False) -> Iterator[Browser]:
    """
    Start Chromium, and end it.

    :param profile: empty folder for its files
    :param width: of the page [CSS px]
    :param height: of the page [CSS px]
    :param sound: let pages make sounds without a click
    :param trusting: open pages with an unsigned certificate
    """
    from selenium import webdriver
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    options = Options()
    options.binary_location = _chromium() or ''
    for flag in (*_FLAGS, f'--user-data-dir={profile}', f'--window-size={width},{height}'):
        options.add_argument(flag)
    if sound:
        options.add_argument('--autoplay-policy=no-user-gesture-required')
    options.accept_insecure_certs = trusting
    options.set_capability('goog:loggingPrefs', {'browser': 'ALL'})
    # Pages of this machine are not opened through its proxy.
    environment = {key: value for key, value in os.environ.items()
                   if not key.lower().endswith('_proxy')}
    service = Service(shutil.which('chromedriver'), env=environment)
    driver = webdriver.Chrome(options=options, service=service)
    try:
        browser = Browser(driver)
        browser.resize(width, height)
        yield browser
    finally:
        driver.quit()
