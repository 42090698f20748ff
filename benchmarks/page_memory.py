# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether the page's memory stays the same, however long a person drives.

A person sits at the page of a motorway with 50 vehicles and steers now and then; the views are
shown in turns. After each minute, garbage is collected and what is left is read from the browser:
the memory of the page's script, and its nodes and listeners. The slope is that of a line through
all minutes after the first few, in which histories fill up.

Needs Debian's chromium and chromium-driver, and three.js for views other than the map.
"""

import argparse
from pathlib import Path
import sys
import tempfile
import time
from typing import Any

from crgame_ros.paths import scenarios_directory
from crowd import GAME
from driven_page import DrivenPage
import numpy as np

VIEWS = ('map', 'driver', 'chase')
# Growth that counts as none: [MB an hour], and nodes and listeners an hour.
STEADY_MB, STEADY = 2.0, 100.0


def left(driver: Any) -> tuple[float, int, int]:
    """Return what a page keeps: memory of its script [MB], its nodes, and its listeners."""
    # Twice: what finalisers release is collected by the second.
    for _ in range(2):
        driver.execute_cdp_cmd('HeapProfiler.collectGarbage', {})
    used = driver.execute_cdp_cmd('Runtime.getHeapUsage', {})['usedSize']
    counters = driver.execute_cdp_cmd('Memory.getDOMCounters', {})
    return used / 1e6, counters['nodes'], counters['jsEventListeners']


def drive(page: DrivenPage, minutes: int) -> list[tuple[float, int, int]]:
    """Drive for some minutes; return what the page keeps after each."""
    browser, found = page.browser, []
    browser.wait_for('return Boolean(window.crgame?.ready && crgame.view3d)')
    begun_s = time.monotonic()
    for minute in range(minutes):
        view = VIEWS[minute % len(VIEWS)]
        browser.driver.execute_script(
            f"crgame.view3d.viewpoint = '{view}'; crgame.view3d.show(true)" if view != 'map'
            else 'crgame.view3d.show(false)')
        side = 1.0 if minute % 2 else -1.0
        while time.monotonic() < begun_s + 60.0 * (minute + 1):
            browser.key(side, True)
            time.sleep(0.1)
            browser.key(side, False)
            time.sleep(4.0)
            side = -side
        found.append(left(browser.driver))
        print('{:4} min: {:7.2f} MB, {} nodes, {} listeners'.format(minute + 1, *found[-1]),
              flush=True)
    return found


def main() -> int:
    """Run the benchmark; 1 where something grows."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--minutes', type=int, default=60)
    parser.add_argument('--filled', type=int, default=6, help='minutes that do not count')
    values = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        game = Path(name) / 'crowd.yaml'
        game.write_text(GAME.format(scenarios=scenarios_directory()))
        with DrivenPage(Path(name) / 'run', [str(game)]) as page:
            page.control.deafen()
            page.browser.drive('hv0')
            kept = np.array(drive(page, values.minutes)[values.filled:], dtype=float)
    hours = np.arange(len(kept)) / 60.0
    slopes = [float(np.polyfit(hours, column, 1)[0]) for column in kept.T]
    print('growth an hour: {:.2f} MB, {:.0f} nodes, {:.0f} listeners'.format(*slopes))
    return int(slopes[0] > STEADY_MB or max(slopes[1:]) > STEADY)


if __name__ == '__main__':
    sys.exit(main())
