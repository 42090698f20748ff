#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Print the state hash of every game in scenarios/, to compare two versions of the program.

    python benchmarks/state_hashes.py > before.txt
    (change something that must not change behaviour)
    python benchmarks/state_hashes.py | diff before.txt -

Each game runs offline for --duration seconds with each planner and latency below.
"""

import argparse
from pathlib import Path

import crgame_ros

ROOT = Path(__file__).resolve().parents[1]
PLANNERS, LATENCIES = (None, 'idm', 'reactive'), (0, 5)


def main() -> None:
    """Print one line for each game, planner and latency [steps]."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--duration', type=float, default=10.0, help='of each run [s]')
    duration_s = parser.parse_args().duration
    for game in sorted(path for path in (ROOT / 'scenarios').glob('*.yaml')
                       if path.name.count('.') == 1):
        for planner in PLANNERS:
            for latency in LATENCIES:
                run = crgame_ros.run(game, planner=planner, latency_steps=latency,
                                     duration_s=duration_s)
                print(game.stem, planner or 'own', latency, run.state_hash, flush=True)


if __name__ == '__main__':
    main()
