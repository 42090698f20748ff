# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The cockpit in a real browser: key to odometry, key to picture, script time, and its costs.

Needs Debian's chromium and chromium-driver. Keys go through the browser's input pipeline, times
are those of the key event in the page, of the odometry's arrival at another process, and of the
end of the first drawn frame that shows a state at least as late as that odometry.
"""

import argparse
from collections.abc import Callable
import json
from pathlib import Path
import statistics
import tempfile
import threading
import time
from typing import Any
from urllib.parse import urlsplit

from crgame_ros.paths import scenarios_directory
from driven_page import Browser, DrivenPage, free_port, LOGGER, report
from live_graph import LiveGraph, RemoteControl
import websocket


def latency_run(folder: Path, trials: int) -> None:
    """Measure from the key to odometry and picture."""
    with DrivenPage(folder / 'keys', [str(scenarios_directory() / 'cut_in.yaml')]) as page:
        page.sit_down(LOGGER)
        odometry, picture = page.measure_keys(trials)
    report('key to odometry [ms]', odometry, 'p50 <= 15, p99 <= 30')
    report('key to picture [ms]', picture, 'p50 <= 50')


def script_run(folder: Path, scenario: Path, seconds: float) -> None:
    """Measure the script time of a frame, following a vehicle and with the whole map in view."""
    with DrivenPage(folder / 'script', ['--scenario', str(scenario)]) as page:
        driver = page.browser.driver
        size = driver.execute_script(
            'return [crgame.store.scene.lanelets.length, crgame.store.scene.objects.length]')
        for view, script in (('following', 'crgame.world.follow(crgame.store.scene.vehicles[0].id'
                              ', true)'), ('whole map', 'crgame.world.fit()')):
            driver.execute_script(script)
            time.sleep(2.0)
            before = driver.execute_script('return crgame.world.stats.frames')
            time.sleep(seconds)
            stats = driver.execute_script(
                'return [crgame.world.stats.frames, Array.from(crgame.world.stats.frame_ms)]')
            # A ring of the latest frames.
            kept = len(stats[1])
            times = [stats[1][frame % kept]
                     for frame in range(max(before, stats[0] - kept), stats[0])]
            report(f'script a frame, {view} [ms]', times, '<= 8')
            print(f'{"":34} {(stats[0] - before) / seconds:.1f} frames/s; {scenario.stem}: '
                  f'{size[0]} lanelets, {size[1]} objects', flush=True)


class Listener:
    """A WebSocket client; one that never reads leaves everything in its socket's buffer."""

    def __init__(self, page: str, reads: bool) -> None:
        netloc = urlsplit(page).netloc
        self._socket = websocket.create_connection(
            f'ws://{netloc}/ws', origin=f'http://{netloc}', timeout=60)
        if reads:
            threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        try:
            while True:
                self._socket.recv_data()
        except (OSError, websocket.WebSocketException):
            return

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


def timing_block(folder: Path, seconds: float, watched: bool) -> dict[str, Any]:
    """Run the game once, with viewers or without a cockpit; return its timing report."""
    game = str(scenarios_directory() / 'cut_in.yaml')
    graph = LiveGraph(folder, [game, '--duration', '100000', '--port', str(free_port())],
                      headless=not watched)
    closers: list[Callable[[], None]] = []
    try:
        if watched:
            page = graph.page()
            closers.append(Browser(page).close)
            closers += [Listener(page, reads).close for reads in (True, False)]
        control = RemoteControl()
        control.wait_until_running()
        # Values from the start-up are left to the bag before the reset.
        time.sleep(2.0)
        control.call('reset')
        control.deafen()
        time.sleep(seconds + 2.0)
        control.close()
        graph.stop()
        reports = sorted(folder.glob('timing*.json'))
        result: dict[str, Any] = json.loads(reports[-1].read_text())
        return result
    finally:
        for close in closers:
            close()
        graph.kill()


def timing_run(folder: Path, runs: int, seconds: float) -> None:
    """Compare table I with viewers and without, in turns."""
    rows: dict[bool, list[dict[str, Any]]] = {False: [], True: []}
    for run in range(runs):
        for watched in (False, True):
            print(f'run {run + 1} of {runs}, {"watched" if watched else "headless"}: '
                  f'{seconds:.0f} s …', flush=True)
            rows[watched].append(timing_block(folder / f'timing{run}{watched}', seconds, watched))
    print(f'\n{"":28}{"headless":>12}{"(worst)":>12}{"watched":>12}{"(worst)":>12}')
    for key in ('mean_step_error_ms', 'max_cumulative_error_ms', 'final_error_ms',
                'timeout_ratio', 'busy_p50_ms', 'busy_p99_ms'):
        cells = ''
        for watched in (False, True):
            values = [float(item[key]) for item in rows[watched]]
            cells += f'{statistics.median(values):12.4f}{max(values):12.4f}'
        print(f'{key:28}{cells}', flush=True)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--trials', type=int, default=100, help='key presses')
    parser.add_argument('--scenario', type=Path, default=scenarios_directory() /
                        'ZAM_Traffic-1_1_T-1.xml', help='a large one, for the script time')
    parser.add_argument('--runs', type=int, default=3, help='of each kind, for the timing')
    parser.add_argument('--seconds', type=float, default=30.0, help='of each timing run')
    parser.add_argument('--only', choices=('keys', 'script', 'timing'))
    values = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if values.only in (None, 'keys'):
            latency_run(folder, values.trials)
        if values.only in (None, 'script'):
            script_run(folder, values.scenario, 10.0)
        if values.only in (None, 'timing'):
            timing_run(folder, values.runs, values.seconds)


if __name__ == '__main__':
    main()
