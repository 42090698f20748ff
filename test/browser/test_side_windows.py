# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Side screens: real windows beside the seat's own, in step with it during the run."""

from collections.abc import Iterator
import os
from pathlib import Path

from browser_support import Browser, skip_without_three
from crgame_ros.paths import scenarios_directory
import numpy as np
import pytest
from world_support import RecordedRun, RunBackend, Served, served

pytestmark = pytest.mark.exhaustive

# Notes each picture's arrival by the machine's clock [ms] and its shown time [s].
NOTE = """
window.noted = [];
let frames = -1;
const look = (now) => {
  const { stats } = crgame.view3d;
  if (stats.frames !== frames && crgame.store.latest !== undefined) {
    frames = stats.frames;
    window.noted.push([performance.timeOrigin + now, stats.t]);
  }
  requestAnimationFrame(look);
};
requestAnimationFrame(look);
"""
RUN_S = 40.0
PICTURES = 40


@pytest.fixture(scope='module')
def cockpit() -> Iterator[Served]:
    with served(RunBackend(RecordedRun(scenarios_directory() / 'merge.yaml', RUN_S))) as running:
        yield running


def test_two_side_windows_show_the_time_of_the_main_one(
        cockpit: Served, browser: Browser, tmp_path: Path) -> None:
    """At any moment the three pictures are at most one picture apart."""
    skip_without_three()
    driver = browser.driver
    main = driver.current_window_handle
    browser.resize(480, 300)
    browser.open(cockpit.address)
    browser.wait('crgame.ready && crgame.store.scene && crgame.store.latest')
    assert browser.run_async('return await crgame.view3d.show(true)')
    windows = [main]
    try:
        for yaw in (60, -60):
            driver.switch_to.new_window('window')
            windows.append(driver.current_window_handle)
            browser.resize(480, 300)
            browser.open(f'{cockpit.address}?view=driver&yaw={yaw}')
            browser.wait('crgame.ready && crgame.view3d.on && crgame.view3d.stats.frames > 0')
        cockpit.control('start')
        for window in windows:
            driver.switch_to.window(window)
            browser.run(NOTE)
        noted = []
        for window in (*windows[1:], main, *windows):
            driver.switch_to.window(window)
            browser.wait('window.noted.length > arguments[0]', arguments=(PICTURES,))
        for name, window in zip(('main', 'left', 'right'), windows, strict=True):
            driver.switch_to.window(window)
            noted.append(np.array(browser.run('return window.noted'), dtype=float))
            if folder := os.environ.get('CRGAME_SCREENSHOTS'):
                browser.screenshot(Path(folder) / f'side_{name}.png')
    finally:
        cockpit.control('pause')
        for window in windows[1:]:
            driver.switch_to.window(window)
            driver.close()
        driver.switch_to.window(main)
    first = noted[0]
    assert first[-1, 1] > first[0, 1]
    one_picture_s = float(np.max(np.diff(first[:, 1])))
    for side in noted[1:]:
        both = (side[:, 0] > first[0, 0]) & (side[:, 0] < first[-1, 0])
        assert np.count_nonzero(both) > 10
        # The main window's shown times at the moments of the side window's pictures.
        apart = side[both, 1] - np.interp(side[both, 0], first[:, 0], first[:, 1])
        assert np.max(np.abs(apart)) <= one_picture_s + 1e-3
