# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where the time of games in one process goes: the table in docs/decisions.md.

    python benchmarks/gym_shares.py [--games N] [--steps N]

Processor time of each part without that of parts within it, the best of several rounds. The last
column is how many times faster a step would be at most, if all parts that are the same in every
game (plans, motion, commands, contacts, rewards, observations) cost nothing.
"""

import argparse
from collections import defaultdict
from collections.abc import Callable
import functools
import sys
import time
from typing import Any

from crgame_ros.gym.agent_game import AgentGame
from crgame_ros.gym.driving_game import ContactSearch, DrivingGame
from crgame_ros.gym.games_together import GamesTogether
from crgame_ros.simulation.engine import Simulation
import numpy as np

PARTS: dict[str, tuple[tuple[type[Any], str], ...]] = {
    'plans': ((DrivingGame, '_plan'),), 'motion': ((Simulation, 'move'),),
    'commands': ((DrivingGame, '_commands'),),
    'contacts': ((ContactSearch, 'hits'), (DrivingGame, 'off_road')),
    'rewards': ((AgentGame, 'outcomes'),), 'observations': ((GamesTogether, '_seen'),),
    'world': ((Simulation, 'conclude'),), 'rest': ((GamesTogether, 'step'),)}
# What differs between games, and the loop itself, would stay.
STAYING = ('world', 'rest')
ROUNDS = 7


class Stopwatch:
    """Adds up the processor time of parts, each without the parts that it calls."""

    def __init__(self) -> None:
        self.spent_s: defaultdict[str, float] = defaultdict(float)
        self._within: list[float] = []

    def time(self, owner: type[Any], name: str, part: str) -> None:
        """Measure a method from now on."""
        method: Callable[..., object] = getattr(owner, name)

        @functools.wraps(method)
        def timed(*given: object, **named: object) -> object:
            start_s = time.thread_time()
            self._within.append(0.0)
            try:
                return method(*given, **named)
            finally:
                took_s = time.thread_time() - start_s
                self.spent_s[part] += took_s - self._within.pop()
                if self._within:
                    self._within[-1] += took_s

        setattr(owner, name, timed)


def main() -> int:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--games', type=int, default=16)
    parser.add_argument('--steps', type=int, default=10)
    values = parser.parse_args()
    watch = Stopwatch()
    for part, methods in PARTS.items():
        for owner, name in methods:
            watch.time(owner, name, part)
    print('| game | step [ms] | ' + ' | '.join(PARTS) + ' | at most |')
    print('|---' * (len(PARTS) + 3) + '|')
    for game in ('cut_in', 'merge', 'dense_merge'):
        games = GamesTogether(values.games, game=game, worlds=1)
        still = np.zeros((values.games, 2), np.float32)
        games.reset(seed=0)
        games.step(still)
        rounds = []
        for _ in range(ROUNDS):
            watch.spent_s.clear()
            for _ in range(values.steps):
                games.step(still)
            rounds.append(dict(watch.spent_s))
        best = min(rounds, key=lambda spent: sum(spent.values()))
        whole_s = sum(best.values())
        shares = {part: best.get(part, 0.0) / whole_s for part in PARTS}
        print(f'| {game} | {1e3 * whole_s / values.steps / values.games:.2f} | '
              + ' | '.join(f'{share:.0%}' for share in shares.values())
              + f' | {1.0 / sum(shares[part] for part in STAYING):.1f} |')
    return 0


if __name__ == '__main__':
    sys.exit(main())
