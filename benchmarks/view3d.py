# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The 3D view beside the map: its rate and time of drawing, key to picture, and table I.

Each view has a live run of its own in a real browser, in turns, and so has each version where
`--against` names another one. What rendered it is stated: a browser without a graphics card draws
on the processor that the simulation needs, too. Needs what benchmarks/cockpit.py needs, and
three.js (`crgame page-libraries`).
"""

import argparse
import os
from pathlib import Path
import statistics
import tempfile
import time
from typing import Any

from crgame_ros.paths import scenarios_directory
from driven_page import Browser, DrivenPage, report
import numpy as np

VIEWS = ('map', 'driver', 'chase', 'bird')
# The picture in each animation frame: its time, and the simulation time that it shows.
LOGGER = """
window.keyTimes = []; window.frameTimes = []; window.scriptTimes = [];
addEventListener('keydown', e => keyTimes.push(performance.timeOrigin + e.timeStamp), true);
let last = -1;
(function log() {
  const { view3d, world } = window.crgame;
  const frames = view3d.on ? view3d.stats.frames : world.stats.frames;
  if (frames !== last) {
    last = frames;
    frameTimes.push([performance.timeOrigin + performance.now(),
      view3d.on ? view3d.stats.t : world.shown.t]);
    scriptTimes.push(view3d.on ? view3d.stats.frame_ms
      : world.stats.frame_ms[(frames + world.stats.frame_ms.length - 1)
        % world.stats.frame_ms.length]);
  }
  requestAnimationFrame(log);
})();
"""
# The same moment is drawn repeatedly: processor time does not depend on other load.
REDRAW = """
const [count, sharp] = arguments;
const { picture } = crgame.view3d;
const shown = crgame.store.displayed(performance.now());
const context = document.querySelector('#view3d').getContext('webgl2');
picture.sharp = sharp;
for (let i = 0; i < count; i += 1) {
  picture.draw(shown, 0, { viewpoint: crgame.view3d.viewpoint, index: 0, aside: 0, height: 0.8,
    mirrors: true, plans: false });
  context.readPixels(0, 0, 1, 1, context.RGBA, context.UNSIGNED_BYTE, new Uint8Array(4));
}
return [picture.stats.ratio, picture.stats.triangles];
"""
REDRAWN = 60
TABLE = ('mean_step_error_ms', 'max_cumulative_error_ms', 'timeout_ratio', 'busy_p50_ms',
         'busy_p99_ms')


def measure(folder: Path, game: Path, view: str, trials: int, seconds: float,
            source: Path | None) -> dict[str, Any]:
    """Run the game once with a view open; print its costs and return its table I."""
    with DrivenPage(folder, [str(game)], source) as page:
        show(page.browser, view)
        # Before the seat is taken: a seat's holder would have to press start after it.
        page.control.call('reset')
        page.control.wait_until_running()
        page.sit_down(LOGGER)
        used_s = page.browser.processor_s()
        time.sleep(seconds)
        tell(page.browser, view, page.browser.processor_s() - used_s)
        if trials > 0:
            _, picture = page.measure_keys(trials)
            if not picture:
                raise SystemExit(f'{view}: no key came to a picture')
            report(f'{view}: key to picture [ms]', picture, 'p50 <= 50')
        if view != 'map':
            for sharp in (False, True):
                redraw(page.browser, sharp)
        return page.stop()


def show(browser: Browser, view: str) -> None:
    """Open a view, and wait until it has found its resolution."""
    if view != 'map':
        browser.wait_for('return Boolean(window.crgame?.ready && crgame.view3d)')
        browser.driver.execute_script(
            f"crgame.view3d.viewpoint = '{view}'; crgame.view3d.show(true)")
        browser.wait_for('return crgame.view3d.on && crgame.view3d.stats.frames > 0')
    time.sleep(5.0)


def redraw(browser: Browser, sharp: bool) -> None:
    """Print the drawing process's processor time for a picture."""
    count = REDRAWN // 4 if sharp else REDRAWN
    browser.driver.set_script_timeout(300.0)
    # The changes since the last picture are handed over first.
    browser.driver.execute_script(REDRAW, 6, sharp)
    used_s = browser.processor_s('gpu-process')
    ratio, triangles = browser.driver.execute_script(REDRAW, count, sharp)
    used_ms = 1e3 * (browser.processor_s('gpu-process') - used_s) / count
    print(f'{"drawn again and again":34} {used_ms:.1f} ms of processor time a picture at '
          f'{ratio:.2f}, {triangles} triangles in the last', flush=True)


def tell(browser: Browser, view: str, used_s: float) -> None:
    """Print the pictures since the logger began, and their processor time [s]."""
    frames, scripts, stats, objects = browser.driver.execute_script(
        'return [frameTimes, scriptTimes, crgame.view3d.stats,'
        ' crgame.store.scene.vehicles.length + crgame.store.scene.objects.length]')
    times = np.array([at for at, _ in frames])
    report(f'{view}: from picture to picture [ms]', list(np.diff(times)), 'p50 <= 50')
    report(f'{view}: script of a picture [ms]', scripts, '<= 8')
    rate = (len(times) - 1) / max(times[-1] - times[0], 1.0) * 1e3
    used = 1e3 * used_s
    line = (f'{rate:.1f} pictures/s; the browser uses {used / (times[-1] - times[0]):.2f} cores, '
            f'{used / len(times):.1f} ms a picture; {objects} vehicles and objects')
    if view != 'map':
        cost = 'not measured' if stats['cost_ms'] is None else f'{stats["cost_ms"]:.1f} ms'
        line += (f'; {stats["draw_calls"]} draw calls, {stats["triangles"]} triangles, '
                 f'{stats["width"]}x{stats["height"]} at {stats["ratio"]:.2f}, one picture '
                 f'{cost} until it is done, by {stats["renderer"]}')
    print(f'{"":34} {line}', flush=True)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--game', type=Path, default=scenarios_directory() / 'dense_merge.yaml')
    parser.add_argument('--views', nargs='+', choices=VIEWS, default=['map', 'driver'])
    parser.add_argument('--trials', type=int, default=40, help='key presses in each view')
    parser.add_argument('--seconds', type=float, default=20.0, help='of drawing in each view')
    parser.add_argument('--against', type=Path, metavar='CHECKOUT',
                        help='another version of this repository, in turns with this one')
    parser.add_argument('--rounds', type=int, default=1, help='of all views')
    values = parser.parse_args()
    versions = {'': None} if values.against is None else {'other ': values.against, '': None}
    tables: dict[str, list[dict[str, Any]]] = {}
    with tempfile.TemporaryDirectory() as name:
        for number in range(values.rounds):
            for view in values.views:
                for words, source in versions.items():
                    load = ' '.join(f'{value:.1f}' for value in os.getloadavg()[:2])
                    print(f'{words}{view}: {values.seconds:.0f} s, then {values.trials} keys; '
                          f'load {load} …', flush=True)
                    tables.setdefault(words + view, []).append(measure(
                        Path(name) / f'{words.strip()}{view}{number}', values.game, view,
                        values.trials, values.seconds, source))
    print(f'\nmedian (worst) of {values.rounds}')
    for key in TABLE:
        cells = []
        for words, rows in tables.items():
            column = [float(row[key]) for row in rows]
            cells.append(f'{words} {statistics.median(column):.4f} ({max(column):.4f})')
        print(f'{key:28}' + '  '.join(cells), flush=True)


if __name__ == '__main__':
    main()
