# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How many people can drive at once on this machine, each in a run of their own at another machine.

    python benchmarks/sessions_at_once.py --most 6

Each run is a cut-in against `idm`, with its recorder and all monitors, as in a session of
`crgame study serve`. Its driver is a client that sends and receives what a page does; the pictures
are drawn on the participants' machines. A run holds if it keeps the bounds on timing that a study
has by default.
"""

import argparse
from collections.abc import Iterator
from contextlib import ExitStack, redirect_stdout
import io
import json
import os
from pathlib import Path
import signal
import statistics
import sys
import tempfile
import time
from typing import Any

TESTS = Path(__file__).resolve().parents[1] / 'test'
sys.path[:0] = [str(TESTS), str(TESTS / 'live')]

from crgame_ros.paths import scenarios_directory  # noqa: E402, I100
from crgame_ros.study.quality import QualityBounds, TIMING  # noqa: E402
from live_support import Launcher, wait_until  # noqa: E402
from page_client import PageClient  # noqa: E402

DRIVE_S = 20.0


def driven(count: int, folder: Path) -> list[dict[str, Any]]:
    """Drive so many runs at once; return table I and the rate of states of each."""
    game = scenarios_directory() / 'cut_in.yaml'
    with ExitStack() as stack:
        # The launchers' lines are no part of the table.
        stack.enter_context(redirect_stdout(io.StringIO()))
        launchers = [stack.enter_context(Launcher(
            [game, '--driver', 'cockpit', '--duration', f'{DRIVE_S}', '--countdown', '0'],
            folder / f'{count}-{number}', headless=False)) for number in range(count)]
        rates_hz = _drive([PageClient(launcher.page) for launcher in launchers])
        for launcher in launchers:
            launcher.signal(signal.SIGINT)
        for launcher in launchers:
            launcher.wait()
    return [{**json.loads((launcher.out / 'timing.json').read_text()), 'frames_hz': rate_hz}
            for launcher, rate_hz in zip(launchers, rates_hz, strict=True)]


def _drive(pages: list[PageClient]) -> list[float]:
    """Drive all runs to their end; return the rates of states while all of them go on [Hz]."""
    for page in pages:
        wait_until(lambda page=page: page.request('claim', seat='hv0', device='')['ok'], 'a seat')
        page.hold_keys('hv0', [1, 0, 0, 0])
    for page in pages:
        page.request('control', action='start')
    wait_until(lambda: all(page.documents['status']['run'] == 'running' for page in pages),
               'all to run')
    before, began_s = [len(page.frames) for page in pages], time.monotonic()
    # While all of them drive.
    time.sleep(0.5 * DRIVE_S)
    passed_s = time.monotonic() - began_s
    rates_hz = [(len(page.frames) - first) / passed_s
                for page, first in zip(pages, before, strict=True)]
    for page in pages:
        wait_until(lambda page=page: page.documents['status']['run'] == 'ended', 'the end',
                   10.0 * DRIVE_S)
        page.close()
    return rates_hz


def lines(count: int, runs: list[dict[str, Any]], bounds: QualityBounds) -> Iterator[str]:
    """Yield the row of a number of runs: the worst of them."""
    error_ms = max(run['max_cumulative_error_ms'] for run in runs)
    late = max(run['timeout_ratio'] for run in runs)
    ratio = min(run['real_time_ratio']['final'] for run in runs)
    hold = sum(not bounds.excesses({
        'max_cumulative_error_s': 1e-3 * run['max_cumulative_error_ms'],
        'timeout_ratio': run['timeout_ratio'], 'resets': run['resets'],
        'real_time_ratio_final': run['real_time_ratio']['final']}, TIMING) for run in runs)
    yield (f'{count:>5} {error_ms:>12.1f} {100.0 * late:>9.2f} {ratio:>10.3f} '
           f'{statistics.median(run["frames_hz"] for run in runs):>8.1f} {hold:>6} of {count}')


def main() -> int:
    """Drive more and more runs at once, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--most', type=int, default=4, metavar='N', help='runs at once')
    values = parser.parse_args()
    print(f'{os.cpu_count()} processors; the worst of all runs of a row')
    print(f'{"runs":>5} {"error [ms]":>12} {"late [%]":>9} {"real time":>10} {"states":>8} '
          f'{"hold":>6}')
    with tempfile.TemporaryDirectory(prefix='crgame_at_once_') as folder:
        for count in range(1, values.most + 1):
            for line in lines(count, driven(count, Path(folder)), QualityBounds()):
                print(line, flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
