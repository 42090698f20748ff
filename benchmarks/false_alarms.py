#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Count how often a comparison of equal planners tells any of 15 measures apart.

    python3 benchmarks/false_alarms.py [--comparisons 2000]

5 % is what chance is allowed to do, over all measures together. With participants, each of them
drives in two of three scenarios.
"""

import argparse
from pathlib import Path
import sys

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test' / 'evaluation' / 'summary')]

from test_cluster_means import alarms  # noqa: E402, I100

DRAWS, SCENARIOS = ('heavy tails', 'skewed', 'events'), (3, 5, 6, 10, 20, 50)
PARTICIPANTS = (0, 3, 10, 30)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--comparisons', type=int, default=2000)
    comparisons = parser.parse_args().comparisons
    print(f'share of {comparisons} comparisons of equals with a measure told apart')
    print(f'{"participants":>12} {"scenarios":>12}', *(f'{count:>6}' for count in SCENARIOS))
    for participants in PARTICIPANTS:
        for draw in DRAWS:
            random = np.random.default_rng(1)
            shares = [sum(alarms(random, count, draw, participants) for _ in range(comparisons))
                      / comparisons for count in SCENARIOS]
            print(f'{participants:12} {draw:>12}', *(f'{100.0 * share:5.1f}%'
                                                     for share in shares), flush=True)


if __name__ == '__main__':
    main()
