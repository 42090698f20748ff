# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The cost of the page's sound: from a key to the picture, and processor time, with and without.

One graph and one browser; blocks with sound and without take turns, each a drive from the same
start under full throttle. Times from key to picture are those of `cockpit.py`. Processor time is
that of all processes of the browser, over the block's wall time.
"""

import argparse
from pathlib import Path
import statistics
import tempfile
import time

from crgame_ros.paths import scenarios_directory
from driven_page import Browser, DrivenPage, LOGGER, report

THROTTLE = {'code': 'KeyW', 'key': 'w', 'windowsVirtualKeyCode': 87}
SOUND = {'code': 'KeyM', 'key': 'm', 'windowsVirtualKeyCode': 77}


def press(browser: Browser, kind: str, key: dict[str, object]) -> None:
    """Press or release a key, as a person does: it counts as a gesture."""
    browser.driver.execute_cdp_cmd('Input.dispatchKeyEvent', {'type': kind, **key})


def turn(browser: Browser, sound: bool) -> None:
    """Turn the sound on or off."""
    if browser.driver.execute_script('return crgame.sound.wanted') != sound:
        press(browser, 'keyDown', SOUND)
        press(browser, 'keyUp', SOUND)
    browser.wait_for(f'return crgame.sound.on === {str(sound).lower()}')


class Blocks:
    """
    Drives from the same start, one after the other.

    :param page: a page with a seat.
    :param trials: keys in each block.
    """

    def __init__(self, page: DrivenPage, trials: int) -> None:
        self._page, self._trials = page, trials
        self.picture_ms: dict[bool, list[float]] = {False: [], True: []}
        self.processor: dict[bool, list[float]] = {False: [], True: []}

    def drive(self, sound: bool) -> None:
        """Drive one block."""
        browser = self._page.browser
        self._page.control.call('reset')
        turn(browser, sound)
        press(browser, 'keyDown', THROTTLE)
        # A loaded machine takes a while to begin anew.
        wanted = 'hv0' if sound else ''
        browser.wait_for('const { run, t } = crgame.store.status;'
                         "const heard = crgame.sound.heard?.own.id ?? '';"
                         f"return run === 'running' && t > 1 && heard === '{wanted}'")
        before_s, used_s = time.monotonic(), browser.processor_s()
        _, picture_ms = self._page.measure_keys(self._trials)
        used_s = browser.processor_s() - used_s
        self.processor[sound].append(100.0 * used_s / (time.monotonic() - before_s))
        self.picture_ms[sound] += picture_ms
        press(browser, 'keyUp', THROTTLE)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rounds', type=int, default=6, help='blocks of each kind')
    parser.add_argument('--trials', type=int, default=20, help='keys in each block')
    values = parser.parse_args()
    game = str(scenarios_directory() / 'cut_in.yaml')
    with tempfile.TemporaryDirectory() as name, DrivenPage(Path(name) / 'sound', [game]) as page:
        page.browser.wait_for('return crgame.ready')
        page.sit_down(LOGGER)
        blocks = Blocks(page, values.trials)
        for number in range(values.rounds):
            # The order changes: neither has the warmer browser.
            for sound in (number % 2 == 1, number % 2 == 0):
                blocks.drive(sound)
    for sound in (False, True):
        words = 'with sound' if sound else 'without sound'
        report(f'key to picture, {words} [ms]', blocks.picture_ms[sound], 'p50 <= 50')
        shares = blocks.processor[sound]
        print(f'{f"browser, {words} [% of one core]":34} median {statistics.median(shares):.1f}, '
              f'blocks {", ".join(f"{share:.1f}" for share in shares)}', flush=True)


if __name__ == '__main__':
    main()
