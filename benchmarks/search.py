#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Count the runs until a search finds a failure, and those that random sampling needs.

    python benchmarks/search.py
    python benchmarks/search.py --planners idm --seeds 3

The game is the cut-in family of scenarios/, its gaps so large that hardly a variant fails. Three
planners: idm, idm with weak brakes, and reactive. For each, ten searches with different seeds, and
random variants; on two cores it takes 20 minutes for idm, and two hours for reactive. With
--speed, one search of 2,000 runs instead: its time, beside the one that it states, and its memory.
"""

import argparse
from collections.abc import Iterator
import json
from pathlib import Path
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = Path(__file__).resolve().parents[1]
FAMILY = ROOT / 'scenarios' / 'cut_in_family.yaml'
# Name: planner, options, and range of gaps [m] in which about one variant of 300 fails.
PLANNERS = {'idm': ('idm', (), (15, 60)),
            'weak': ('idm', ('b_max=6',), (24, 70)),
            'reactive': ('reactive', (), (10.5, 60))}


def main() -> None:
    """Print a line for each planner."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add('--planners', nargs='+', choices=PLANNERS, default=list(PLANNERS))
    add('--seeds', type=int, default=10)
    add('--budget', type=int, default=100, help='of a search')
    add('--random', type=int, default=1000, help='random runs')
    add('--sampler', default='tpe')
    add('--speed', action='store_true', help='measure one search of 2,000 runs instead')
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if given.speed:
            speed(Path(folder))
            return
        print(f'{"planner":10} {"runs to the first failure: median":>34} {"worst":>6} '
              f'{"random, mean":>13}', flush=True)
        for name in given.planners:
            game = game_of(name, Path(folder))
            firsts = [next(failing(game, name, given.sampler, given.budget, seed), given.budget)
                      for seed in range(given.seeds)]
            random = list(failing(game, name, 'random', given.random, 1000))
            mean = f'{given.random / len(random):.0f}' if random else f'> {given.random}'
            print(f'{name:10} {statistics.median(firsts):34.0f} {max(firsts):6} {mean:>13}  '
                  f'{firsts}, {len(random)} of {given.random}', flush=True)


def game_of(name: str, folder: Path) -> Path:
    """Write the game for a planner."""
    low, high = PLANNERS[name][2]
    text = FAMILY.read_text().replace('scenario: ', f'scenario: {FAMILY.parent}/')
    text = text.replace('duration: 8', 'duration: 5').replace(
        '{name: gap, from: 2, to: 60', f'{{name: gap, from: {low}, to: {high}').replace(
        '{name: difference, from: 0, to: 15', '{name: difference, from: 0, to: 10')
    path = folder / f'{name}.yaml'
    path.write_text(text)
    return path


def failing(game: Path, name: str, sampler: str, budget: int, seed: int) -> Iterator[int]:
    """Search, and yield the numbers of the runs that failed, from 1."""
    out = game.with_name(f'{name}-{sampler}-{seed}')
    planner, options, _ = PLANNERS[name]
    subprocess.run(
        [sys.executable, '-m', 'crgame_ros.cli', 'search', game, '--minimise', 'min_distance',
         '--planner', planner, *(f'--option={option}' for option in options), '--budget',
         str(budget), '--explore-only', '--unavoidable', '--keep', '0', '--sampler', sampler,
         '--seed', str(seed), '--out', out], check=True, capture_output=True)
    outcomes = json.loads((out / 'results.json').read_text())['outcomes']
    yield from (number for number, outcome in enumerate(outcomes, 1)
                if outcome['verdict'] == 'failure')


def speed(folder: Path) -> None:
    """Print the time of a search of 2,000 runs, and the memory of its process at its quarters."""
    begin_s = time.monotonic()
    with subprocess.Popen(
            [sys.executable, '-m', 'crgame_ros.cli', 'search', FAMILY, '--minimise',
             'min_distance', '--budget', '2000', '--out', folder / 'search'],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            found = re.search(r'VmRSS:\s+(\d+)',
                              Path(f'/proc/{process.pid}/status').read_text())
            megabytes = int(found[1]) // 1024 if found else 0
            print(f'{time.monotonic() - begin_s:7.1f} s {megabytes:5} MB  {line.rstrip()}',
                  flush=True)
    most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024
    print(f'{time.monotonic() - begin_s:.0f} s in all, at most {most} MB in one process')


if __name__ == '__main__':
    main()
