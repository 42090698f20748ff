# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A graph, a browser that shows its page, and a driver at the page: for benchmarks."""

from collections.abc import Sequence
import json
from pathlib import Path
import random
import socket
import time
from types import TracebackType
from typing import Any, Self

from live_graph import LiveGraph, RemoteControl
import numpy as np
from odometry_probe import OdometryProbe
import psutil
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

FLAGS = ('--headless', '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
         '--disable-background-networking', '--disable-component-update', '--disable-sync',
         '--window-size=1280,720')
LOGGER = """
window.keyTimes = []; window.frameTimes = [];
addEventListener('keydown', e => keyTimes.push(performance.timeOrigin + e.timeStamp), true);
(function log() {
  const shown = window.crgame.world.shown;
  if (shown) frameTimes.push([performance.timeOrigin + performance.now(), shown.t]);
  if (frameTimes.length > 2000) frameTimes.splice(0, 1000);
  requestAnimationFrame(log);
})();
"""
KEYS = {1.0: ('KeyA', 'a', 65), -1.0: ('KeyD', 'd', 68)}


class Browser:
    """
    A real Chromium that shows the page.

    :param page: its address.
    """

    def __init__(self, page: str) -> None:
        options = webdriver.ChromeOptions()
        for flag in FLAGS:
            options.add_argument(flag)
        options.binary_location = '/usr/bin/chromium'
        self.driver = webdriver.Chrome(options=options,
                                       service=Service('/usr/bin/chromedriver'))
        self.driver.get(page)
        self.wait_for('return !!(window.crgame && crgame.store.scene && crgame.world.shown)')

    def wait_for(self, script: str, limit_s: float = 30.0) -> None:
        """Wait until a script returns a true value."""
        until_s = time.monotonic() + limit_s
        while not self.driver.execute_script(script):
            if time.monotonic() > until_s:
                raise SystemExit(f'the page did not come so far: {script}')
            time.sleep(0.05)

    def drive(self, seat: str) -> None:
        """Claim a seat."""
        self.driver.execute_script(
            f"crgame.connection.request({{type: 'claim', seat: '{seat}'}})")
        self.wait_for(f"return crgame.store.seats.seats?.{seat}?.source === 'cockpit'"
                      f" || crgame.store.seats.{seat}?.source === 'cockpit'")

    def key(self, direction: float, down: bool) -> None:
        """Press or release a steering key."""
        code, key, number = KEYS[direction]
        self.driver.execute_cdp_cmd('Input.dispatchKeyEvent', {
            'type': 'keyDown' if down else 'keyUp', 'code': code, 'key': key,
            'windowsVirtualKeyCode': number})

    def processor_s(self, kind: str = '') -> float:
        """
        Return the processor time that the browser's processes have used so far [s].

        :param kind: of those that count, such as `gpu-process`, which draws; all where empty.
        """
        driver = psutil.Process(self.driver.service.process.pid)
        times = [process.cpu_times() for process in driver.children(recursive=True)
                 if not kind or f'--type={kind}' in process.cmdline()]
        return sum(item.user + item.system for item in times)

    def close(self) -> None:
        """End the browser."""
        self.driver.quit()


class DrivenPage:
    """
    A graph that runs, and its page; everything ends with the `with` block.

    :param folder: of the run.
    :param arguments: further arguments of the launcher.
    :param source: the checkout whose program runs; None for this one.
    """

    def __init__(self, folder: Path, arguments: Sequence[str],
                 source: Path | None = None) -> None:
        self._folder = folder
        self._arguments, self._source = arguments, source
        self._browser: Browser | None = None
        self._probe: OdometryProbe | None = None

    def __enter__(self) -> Self:
        self._graph = LiveGraph(self._folder, [
            *self._arguments, '--driver', 'idle', '--duration', '100000', '--port',
            str(free_port())], headless=False, source=self._source)
        self.control = RemoteControl()
        try:
            self.control.wait_until_running()
            self._browser = Browser(self._graph.page())
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    @property
    def browser(self) -> Browser:
        """Return the browser that shows the page."""
        assert self._browser is not None
        return self._browser

    def sit_down(self, logger: str) -> None:
        """
        Take hv0's seat.

        :param logger: script that notes keys in `keyTimes` and pictures in `frameTimes`, each
            with when it was and which simulation time it shows.
        """
        self.control.deafen()
        self.browser.drive('hv0')
        self.browser.driver.execute_script(logger)

    def measure_keys(self, trials: int) -> tuple[list[float], list[float]]:
        """Press steering keys; return latencies to odometry and to the picture [ms]."""
        if self._probe is None:
            self._probe = OdometryProbe()
            self._probe.listen(1.0)
        offset_s = self.browser.driver.execute_script(
            'return crgame.store.scene.time.clock_offset_s')
        return press_keys(self.browser, self._probe, trials, offset_s)

    def stop(self) -> dict[str, Any]:
        """Close the browser, end the graph in good order; return the last run's timing report."""
        self.browser.close()
        self._browser = None
        self._graph.stop()
        files = sorted(self._folder.glob('timing*.json'))
        result: dict[str, Any] = json.loads(files[-1].read_text())
        return result

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if self._browser is not None:
            self._browser.close()
        if self._probe is not None:
            self._probe.close()
        self.control.close()
        self._graph.kill()


def press_keys(browser: Browser, probe: OdometryProbe, trials: int,
               offset_s: float) -> tuple[list[float], list[float]]:
    """Press steering keys at random times; return latencies to odometry and picture [ms]."""
    draw = random.Random(7)
    odometry, picture = [], []
    for trial in range(trials):
        direction = 1.0 if trial % 2 else -1.0
        browser.driver.execute_script('keyTimes.length = 0; frameTimes.length = 0;')
        probe.listen(0.3 + 0.2 * draw.random())
        browser.key(direction, True)
        found = probe.wait_for_turn(direction)
        probe.listen(0.15)
        browser.key(direction, False)
        keys = browser.driver.execute_script('return keyTimes')
        frames = browser.driver.execute_script('return frameTimes')
        if found is None or not keys:
            print(f'trial {trial}: nothing came', flush=True)
            continue
        stamp, arrived_s = found
        odometry.append(arrived_s * 1e3 - keys[0])
        shown = [at for at, t in frames if at > keys[0] and t >= stamp * 1e-9 - offset_s - 1e-6]
        if shown:
            picture.append(shown[0] - keys[0])
    return odometry, picture


def report(name: str, values: Sequence[float], wanted: str) -> None:
    """Print quantiles of a series."""
    p50, p99 = np.percentile(values, (50, 99))
    print(f'{name:34} p50 {p50:7.2f}  p99 {p99:7.2f}  worst {max(values):7.2f}  '
          f'n {len(values):4}  wanted: {wanted}', flush=True)


def free_port() -> int:
    """Find a port that is free now."""
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])
