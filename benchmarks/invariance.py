#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Check that a run does not depend on where its map lies: turned, in UTM coordinates, mirrored.

    python benchmarks/invariance.py
    python benchmarks/invariance.py scenarios/merge.yaml --angles 45 --duration 20
    python benchmarks/invariance.py FOLDER/*.xml

In a CommonRoad scenario with a planning problem, an AV drives among reactive traffic. Each game
runs offline as it is and placed anew, with its planners, perception and traffic. In a mirrored map
vehicles keep to the other side of the road; noise is not mirrored. The table gives the largest
difference of positions, yaws and speeds, after the placement is undone.
"""

import argparse
from pathlib import Path
import sys
import tempfile

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]

from crgame_ros.errors import CrgameError  # noqa: E402, I100
from crgame_ros.verdict.copies import Placement, UTM  # noqa: E402
from placed_runs import difference, run_placed  # noqa: E402


def main() -> None:
    """Print one line for each game and placement."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('games', nargs='*', type=Path,
                        help='games or scenarios; all games of scenarios/')
    parser.add_argument('--angles', nargs='+', type=float, default=(30.0, 45.0, 137.0),
                        metavar='DEGREES')
    parser.add_argument('--duration', type=float, default=10.0, help='of each run [s]')
    given = parser.parse_args()
    games = given.games or sorted(path for path in (ROOT / 'scenarios').glob('*.yaml')
                                  if path.name.count('.') == 1)
    places = [*map(Placement, given.angles), Placement(offset=UTM), Placement(mirrored=True)]
    print(f'{"game":20} {"placed":>8} {"position":>10} {"yaw":>10} {"speed":>10}')
    with tempfile.TemporaryDirectory() as folder:
        for game in games:
            try:
                first, *others = (
                    run_placed(game, Path(folder, place.name), place, given.duration)
                    for place in (Placement(), *places))
            except CrgameError as error:
                print(error, flush=True)
                continue
            for place, other in zip(places, others, strict=True):
                print(f'{game.stem:20} {place.name:>8}',
                      *(f'{each:10.1e}' for each in difference(first, other, place)), flush=True)


if __name__ == '__main__':
    main()
