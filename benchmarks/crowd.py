# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The 100 Hz loop beside 50 agents, perception and a browser: step error, and causes of lateness.

A bare sleeping loop beside it measures the host's own effect on deadlines. `--seconds 7200` is
the long one: no reset that the host does not explain. Needs Debian's chromium and chromium-driver.
"""

import argparse
from pathlib import Path
import tempfile
import time

from bare_loop import BareLoop
from cockpit import Browser, free_port
from crgame_ros.paths import scenarios_directory
from live_graph import LiveGraph
from timing import print_late_steps

# The human's script is that of half a minute: afterwards there is no driver.
GAME = """
scenario: {scenarios}/ZAM_DenseMerge-1_1_T-1.xml
duration: 1000000
humans:
  - {{id: hv0, driver: idle, spawn: {{lanelet: 51, s: 255.0, d: 0.0, speed: 20.0}}}}
avs:
  - {{id: av0, planning_problem: 100, planner: idm, perception: {{}}}}
traffic: {{agents: 50, flow: 900, seed: 17}}
drivability: {{collision: true, road: true, stop: false}}
"""
TOLD_S = 60.0


def resident_mb(pid: int) -> float:
    """Return the memory of a process [MB]."""
    pages = int(Path(f'/proc/{pid}/statm').read_text().split()[1])
    return pages * 4096 / 1e6


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=120.0)
    parser.add_argument('--no-browser', action='store_true')
    values = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        game = folder / 'crowd.yaml'
        game.write_text(GAME.format(scenarios=scenarios_directory()))
        bare = BareLoop(0.01)
        graph = LiveGraph(folder / 'run', [str(game), '--port', str(free_port())],
                          headless=values.no_browser)
        browser = None
        try:
            if not values.no_browser:
                browser = Browser(graph.page())
            graph.wait_for('recording into')
            pid = graph.node_pids()['sim_node']
            bare.listen(True)
            began_s = time.monotonic()
            while (passed_s := time.monotonic() - began_s) < values.seconds and graph.running:
                print(f'{passed_s:.0f} s: sim_node has {resident_mb(pid):.0f} MB', flush=True)
                time.sleep(min(TOLD_S, values.seconds - passed_s))
            print(f'at the end {resident_mb(pid):.0f} MB')
            bare.listen(False)
            report = graph.stop()
        finally:
            bare.stop()
            if browser is not None:
                browser.close()
            graph.kill()
        print(f'step error p50 {report["step_error_p50_ms"]:.3f} ms, p99 '
              f'{report["step_error_p99_ms"]:.3f} ms (wanted p99 <= 0.5); worst lag '
              f'{report["worst_lag_ms"]:.1f} ms beside {bare.worst_ms:.1f} ms of a bare loop; '
              f'busy p50 {report["busy_p50_ms"]:.2f} ms, p99 {report["busy_p99_ms"]:.2f} ms')
        print_late_steps(report)


if __name__ == '__main__':
    main()
