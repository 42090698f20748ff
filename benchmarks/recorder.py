# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A long run: no message lost, and the memory of every node over time."""

import argparse
from pathlib import Path
import re
import tempfile
import time

from live_graph import LiveGraph

SAMPLE_S = 10.0
# Queues, caches and the first chunks fill in the first part of the run, which doesn't count.
WARM_UP = 0.2


def resident_mib(pid: int) -> float:
    """Return the memory of a process that no other shares [MiB]; 0 if it has ended."""
    try:
        text = Path(f'/proc/{pid}/smaps_rollup').read_text(encoding='ascii')
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return sum(int(value) for value in re.findall(
        r'^Private_(?:Clean|Dirty):\s+(\d+) kB', text, re.MULTILINE)) / 1024.0


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--duration', type=float, default=600.0, help='seconds')
    parser.add_argument('--game', nargs='+', default=[], help='launcher arguments')
    values = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        graph = LiveGraph(Path(name) / 'run', [*values.game, '--duration', str(values.duration)])
        samples: dict[str, list[float]] = {}
        pids: dict[str, int] = {}
        start = time.monotonic()
        while graph.running and time.monotonic() < start + values.duration:
            time.sleep(min(SAMPLE_S, values.duration / 10.0))
            pids = pids or graph.node_pids()
            for node, pid in pids.items():
                size = resident_mib(pid)
                if size:
                    samples.setdefault(node, []).append(size)
        report = graph.wait()
    print(f'{report["cycles"]} cycles, {report["gaps"]} lost')
    print(f'{"node":20}{"first [MiB]":>12}{"last [MiB]":>12}{"growth":>9}  wanted < 5')
    for node, sizes in samples.items():
        settled = sizes[int(len(sizes) * WARM_UP):]
        print(f'{node:20}{settled[0]:12.1f}{settled[-1]:12.1f}{settled[-1] - settled[0]:9.2f}')


if __name__ == '__main__':
    main()
