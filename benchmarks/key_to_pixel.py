# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""
What the page's sound costs: from a key to the picture, and processor time, with and without.

One graph and one browser; blocks with sound and without take turns, each a drive from the same
start under full throttle. Times from key to picture are those of `cockpit.py`. Processor time is
that of all processes of the browser, over the block's wall time.
"""

import argparse
from pathlib import Path
import statistics
import tempfile
import time

from cockpit import Browser, free_port, LOGGER, measure_keys, report
from crgame_ros.paths import scenarios_directory
from live_graph import LiveGraph, RemoteControl
from odometry_probe import OdometryProbe
import psutil

THROTTLE = {'code': 'KeyW', 'key': 'w', 'windowsVirtualKeyCode': 87}
SOUND = {'code': 'KeyM', 'key': 'm', 'windowsVirtualKeyCode': 77}


def press(browser: Browser, kind: str, key: dict[str, object]) -> None:
    """Press a key, or let it go, as a person does: it counts as a gesture."""
    browser.driver.execute_cdp_cmd('Input.dispatchKeyEvent', {'type': kind, **key})


def turn(browser: Browser, sound: bool) -> None:
    """Turn the sound on or off."""
    if browser.driver.execute_script('return crgame.sound.wanted') != sound:
        press(browser, 'keyDown', SOUND)
        press(browser, 'keyUp', SOUND)
    browser.wait_for(f'return crgame.sound.on === {str(sound).lower()}')


def processor_s(browser: Browser) -> float:
    """Give the processor time that the browser's processes have used so far [s]."""
    driver = psutil.Process(browser.driver.service.process.pid)
    times = [process.cpu_times() for process in driver.children(recursive=True)]
    return sum(item.user + item.system for item in times)


class Blocks:
    """
    Drives from the same start, one after the other.

    :param browser: whose page drives.
    :param control: of the simulation.
    :param trials: keys in each block.
    """

    def __init__(self, browser: Browser, control: RemoteControl, trials: int) -> None:
        self._browser, self._control, self._trials = browser, control, trials
        self._probe = OdometryProbe()
        self.picture_ms: dict[bool, list[float]] = {False: [], True: []}
        self.processor: dict[bool, list[float]] = {False: [], True: []}

    def drive(self, sound: bool) -> None:
        """Drive one block."""
        browser = self._browser
        self._control.call('reset')
        turn(browser, sound)
        press(browser, 'keyDown', THROTTLE)
        # A loaded machine takes a while to begin anew.
        wanted = 'hv0' if sound else ''
        browser.wait_for('const { run, t } = crgame.store.status;'
                         "const heard = crgame.sound.heard?.own.id ?? '';"
                         f"return run === 'running' && t > 1 && heard === '{wanted}'")
        offset_s = browser.driver.execute_script('return crgame.store.scene.time.clock_offset_s')
        before_s, used_s = time.monotonic(), processor_s(browser)
        _, picture_ms = measure_keys(browser, self._probe, self._trials, offset_s)
        used_s = processor_s(browser) - used_s
        self.processor[sound].append(100.0 * used_s / (time.monotonic() - before_s))
        self.picture_ms[sound] += picture_ms
        press(browser, 'keyUp', THROTTLE)

    def close(self) -> None:
        """Leave the graph."""
        self._probe.close()


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rounds', type=int, default=6, help='blocks of each kind')
    parser.add_argument('--trials', type=int, default=20, help='keys in each block')
    values = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        graph = LiveGraph(Path(name) / 'sound', [
            str(scenarios_directory() / 'cut_in.yaml'), '--driver', 'idle', '--duration',
            '100000', '--port', str(free_port())], headless=False)
        control = RemoteControl()
        browser = None
        try:
            control.wait_until_running()
            control.deafen()
            browser = Browser(graph.page())
            browser.wait_for('return crgame.ready')
            browser.drive('hv0')
            browser.driver.execute_script(LOGGER)
            blocks = Blocks(browser, control, values.trials)
            for number in range(values.rounds):
                # Who goes first changes: neither has the warmer browser.
                for sound in (number % 2 == 1, number % 2 == 0):
                    blocks.drive(sound)
            blocks.close()
        finally:
            if browser is not None:
                browser.close()
            control.close()
            graph.kill()
    for sound in (False, True):
        words = 'with sound' if sound else 'without sound'
        report(f'key to picture, {words} [ms]', blocks.picture_ms[sound], 'p50 <= 50')
        shares = blocks.processor[sound]
        print(f'{f"browser, {words} [% of one core]":34} median {statistics.median(shares):.1f}, '
              f'blocks {", ".join(f"{share:.1f}" for share in shares)}', flush=True)


if __name__ == '__main__':
    main()
