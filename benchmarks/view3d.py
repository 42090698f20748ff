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
The 3D view beside the map: how often and how fast it is drawn, key to picture, and table I.

Each view has a live run of its own in a real browser, in turns. What rendered it is stated: a
browser without a graphics card draws on the processor that the simulation needs, too. Needs what
benchmarks/cockpit.py needs, and three.js (`crgame cockpit-3d`).
"""

import argparse
import json
from pathlib import Path
import tempfile
import time
from typing import Any

from cockpit import Browser, free_port, measure_keys, report
from crgame_ros.paths import scenarios_directory
from live_graph import LiveGraph, RemoteControl
import numpy as np
from odometry_probe import OdometryProbe

VIEWS = ('map', 'driver', 'chase', 'bird')
# What was drawn, in each animation frame: when, and the simulation time that it shows.
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
TABLE = ('mean_step_error_ms', 'max_cumulative_error_ms', 'timeout_ratio', 'busy_p50_ms',
         'busy_p99_ms')


def measure(folder: Path, game: Path, view: str, trials: int, seconds: float) -> dict[str, Any]:
    """Run the game once with a view open; print what it took and give its table I."""
    graph = LiveGraph(folder / view, [
        str(game), '--driver', 'idle', '--duration', '100000', '--port', str(free_port())],
        headless=False)
    control = RemoteControl()
    browser = None
    try:
        control.wait_until_running()
        browser = Browser(graph.page())
        show(browser, view)
        # Before somebody holds the seat: a seat's holder would have to press start after it.
        control.call('reset')
        control.wait_until_running()
        control.deafen()
        browser.drive('hv0')
        browser.driver.execute_script(LOGGER)
        time.sleep(seconds)
        tell(browser, view)
        if trials > 0:
            offset_s = browser.driver.execute_script(
                'return crgame.store.scene.time.clock_offset_s')
            probe = OdometryProbe()
            probe.listen(1.0)
            _, picture = measure_keys(browser, probe, trials, offset_s)
            probe.close()
            if not picture:
                raise SystemExit(f'{view}: no key came to a picture')
            report(f'{view}: key to picture [ms]', picture, 'p50 <= 50')
        browser.close()
        browser = None
        graph.stop()
        files = sorted((folder / view).glob('timing*.json'))
        result: dict[str, Any] = json.loads(files[-1].read_text())
        return result
    finally:
        if browser is not None:
            browser.close()
        control.close()
        graph.kill()


def show(browser: Browser, view: str) -> None:
    """Open a view, and let it find its resolution."""
    if view != 'map':
        browser.wait_for('return Boolean(window.crgame?.ready && crgame.view3d)')
        browser.driver.execute_script(
            f"crgame.view3d.viewpoint = '{view}'; crgame.view3d.show(true)")
        browser.wait_for('return crgame.view3d.on && crgame.view3d.stats.frames > 0')
    time.sleep(5.0)


def tell(browser: Browser, view: str) -> None:
    """Print what was drawn since the logger began."""
    frames, scripts, stats, objects = browser.driver.execute_script(
        'return [frameTimes, scriptTimes, crgame.view3d.stats,'
        ' crgame.store.scene.vehicles.length + crgame.store.scene.objects.length]')
    times = np.array([at for at, _ in frames])
    report(f'{view}: from picture to picture [ms]', list(np.diff(times)), 'p50 <= 50')
    report(f'{view}: script of a picture [ms]', scripts, '<= 8')
    rate = (len(times) - 1) / max(times[-1] - times[0], 1.0) * 1e3
    line = f'{rate:.1f} pictures/s, {objects} vehicles and objects'
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
    values = parser.parse_args()
    tables = {}
    with tempfile.TemporaryDirectory() as name:
        for view in values.views:
            print(f'{view}: {values.seconds:.0f} s, then {values.trials} keys …', flush=True)
            tables[view] = measure(Path(name), values.game, view, values.trials, values.seconds)
    print(f'\n{"":28}' + ''.join(f'{view:>12}' for view in values.views))
    for key in TABLE:
        print(f'{key:28}' + ''.join(f'{float(tables[view][key]):12.4f}'
                                    for view in values.views), flush=True)


if __name__ == '__main__':
    main()
