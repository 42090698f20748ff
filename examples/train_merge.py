# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Train an AV to merge into dense traffic, from nothing, in five minutes on two cores.

    python examples/train_merge.py                # writes trained_merge.npz and .png beside it
    ./run.sh examples/train_merge.yaml --planner policy:examples/train_merge.py:load

Every half second, the AV keeps on, changes to the motorway's lane, or drives faster or slower;
nothing else brakes for it. It changes where there is more room than one weight says. A score that
is linear in 3 features of what it sees decides whether to drive faster or slower. The weights
begin at 0. The cross-entropy method (Rubinstein 1999) finds them: draw some, keep those that drive
best, draw again around them.

A drive succeeds ("merged") if the centre of the AV is on a lane of the motorway beyond the end of
the ramp within 30 s, and until then the AV has touched nothing, no part of it has left the road,
and it has never been slower than 2 m/s. The test is traffic that it was never trained on.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
import math
import multiprocessing
from pathlib import Path
import resource
import sys
import time
from typing import NamedTuple, NoReturn

from crgame_ros.game.game import load_game
from crgame_ros.gym.driving_env import DrivingEnv
from crgame_ros.policy.manoeuvres import FASTER, KEEP, LEFT, SLOWER
from crgame_ros.policy.observation import Observed
from crgame_ros.policy.policy_file import Policy
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Decide = Callable[[Observed], int]
GAME = Path(__file__).with_suffix('.yaml')
WEIGHTS = Path(__file__).with_name('trained_merge.npz')
OBSERVATION = {'parts': ['state', 'objects'], 'objects': 12}
# The start varies by 4 m/s; traffic, its drivers and speeds are placed anew by every seed.
TICKS, VARY = 5, {'speed': 4.0}
DECISION_S = 0.1 * TICKS
# Training knows traffic of the seeds below this; the test's are drawn from 2^31. Their starts are
# drawn by the seeds 0, 1, ... and by seeds from here on.
WORLDS, TEST = 512, 1_000_000
MERGED, SLOWEST = 'merged', 2.0
# Each generation draws so many weights, drives each from so many starts, and keeps the best few;
# the first one looks everywhere, later ones tell good from better. The last one is repeated.
GENERATIONS = ((32, 2, 8), (24, 4, 6), (16, 8, 5), (12, 12, 4), (12, 16, 4))
# How far the weights of the first generation are spread; later ones by that of the best and this.
SPREAD, MORE, LESS_EACH = 0.8, 0.3, 0.8
WEIGHT_COUNT = 4
REWARD = {'goal': 10.0, 'collision': -10.0, 'off_road': -10.0}
# A score for driving faster or slower that is closer to 0 keeps the speed.
STEADY = 0.25
# Each decision costs what room on the own lane is less than this. Of drives that fail, each metre
# on the motorway is worth so much: the later end is the better one.
NARROW, PER_METRE = 0.5, 0.03
# Width of a lane and half of what counts as one, centre of the AV ahead of its rear axle, half of
# its length [m].
LANE, HALF_LANE, CENTER, HALF_LENGTH = 3.75, 1.9, 1.4, 2.3
# Others this close ahead or behind are beside the AV [m].
NEAR = 60.0
# Others are predicted this long with constant speed [s]; a gap that counts as 1 [m].
AHEAD_S, FREE = 2.0, 20.0
# Before this distance to the goal, the acceleration lane has no neighbour [m].
BESIDE = 262.0
# Where the goal begins, the motorway running along x [m].
GOAL_X = 300.0
BASELINES = ('random', 'keep', 'idm')
# Speed on the motorway, and a difference of speeds that counts as 1 [m/s].
MOTORWAY, DIFFERENT = 27.8, 5.0


class Around(NamedTuple):
    """
    The lanes around the AV; room is the least gap there will be, 1 for 20 m and more.

    :param before: room on its lane.
    :param behind: likewise.
    :param left_before: room on the next lane to the left.
    :param left_behind: likewise.
    :param left_faster: mean speed there, more than the own [m/s]
    """

    before: float
    behind: float
    left_before: float
    left_behind: float
    left_faster: float


def look(seen: Observed) -> Around:
    """Return the lanes around the AV."""
    speed = float(seen['state'][0])
    rows = seen['objects'][seen['objects'][:, 0] > 0.5].astype(np.float64)
    _, x, y, heading, along, _, length, _ = rows.T
    # Ahead and to the left of the AV, as seen in the direction in which the other one drives.
    ahead = x * np.cos(heading) + y * np.sin(heading) - CENTER
    left = y * np.cos(heading) - x * np.sin(heading)
    gap = np.abs(ahead) - HALF_LENGTH - 0.5 * length

    def room(lane: float, side: float) -> float:
        there = (np.abs(left - lane) < HALF_LANE) & (side * ahead > 0.0)
        later = gap[there] + AHEAD_S * side * (along[there] - speed)
        return min(max(float(later.min(initial=FREE)) / FREE, -1.0), 1.0)

    beside = along[(np.abs(left - LANE) < HALF_LANE) & (np.abs(ahead) < NEAR)]
    return Around(room(0.0, 1.0), room(0.0, -1.0), room(LANE, 1.0), room(LANE, -1.0),
                  float(beside.mean()) - speed if len(beside) else 0.0)


def features(seen: Observed) -> tuple[float, Array]:
    """Return the room to change into, and what it depends on to drive faster or slower (3)."""
    around, speed = look(seen), float(seen['state'][0])
    # Whoever will be before it on the motorway counts on the ramp already.
    before = min(around.before, around.left_before) if on_ramp(seen) else around.before
    pace = np.array(((MOTORWAY - speed) / DIFFERENT, around.left_faster / DIFFERENT,
                     2.0 * (before - 1.0)))
    return min(around.left_before, around.left_behind), np.clip(pace, -3.0, 3.0)


def on_ramp(seen: Observed) -> bool:
    """Return whether the AV is on the ramp: its route leads onto the motorway at once."""
    return bool(seen['state'][4] < -HALF_LANE or seen['state'][8] > BESIDE)


def decide(weights: Array, seen: Observed) -> int:
    """Return the manoeuvre that weights (4) choose: the first one is the room to change into."""
    room, pace = features(seen)
    if seen['mask'][LEFT] and on_ramp(seen) and room > weights[0]:
        return LEFT
    faster = float(weights[1:] @ pace)
    return FASTER if faster > STEADY else SLOWER if faster < -STEADY else KEEP


def load() -> Policy:
    """Return the trained policy: what `policy:train_merge.py:load` in a game file calls."""
    if not WEIGHTS.exists():
        raise FileNotFoundError(f'{WEIGHTS} is missing: run {Path(__file__).name} first')
    weights: Array = np.load(WEIGHTS)['weights']
    return Policy(lambda seen: decide(weights, seen), 'manoeuvre', OBSERVATION, TICKS)


class Drive(NamedTuple):
    """A drive: how well, how it ended, and the number of its decisions."""

    total: float
    end: str
    decisions: int


def make(worlds: int | None = None) -> DrivingEnv:
    """Return the environment, with so many placements of traffic."""
    return DrivingEnv(game=load_game(GAME), action='manoeuvre', observation=OBSERVATION,
                      reward=REWARD, vary=VARY, ticks=TICKS, worlds=worlds)


def drive(env: DrivingEnv, choose: Decide, seed: int) -> Drive:
    """Drive an episode."""
    seen, _ = env.reset(seed=seed)
    total, driven_m, decisions, end = 0.0, 0.0, 0, ''
    while not end:
        seen, reward, _, truncated, info = env.step(np.int64(choose(seen)))
        around = look(seen)
        total += reward - max(0.0, NARROW - min(around.before, around.behind))
        driven_m += 0.0 if on_ramp(seen) else DECISION_S * float(seen['state'][0])
        decisions += 1
        end = ('contact' if info['hit'] else 'off the road' if info['off_road'] else
               'standing' if seen['state'][0] < SLOWEST else MERGED if info['goal'] else
               'too late' if truncated else '')
    if end != MERGED:
        total += PER_METRE * driven_m + (REWARD['collision'] if end == 'standing' else 0.0)
    return Drive(total, end, decisions)


# The environment of this process.
_ENV: list[DrivingEnv] = []


def _begin(worlds: int | None = None) -> None:
    """Make the environment of a process."""
    _ENV[:] = [make(worlds)]


def _drive(task: tuple[Array, int]) -> Drive:
    weights, seed = task
    return drive(_ENV[0], lambda seen: decide(weights, seen), seed)


def sizes_of(generation: int) -> tuple[int, int, int]:
    """Return how many weights a generation draws, from how many starts, and how many it keeps."""
    return GENERATIONS[min(generation, len(GENERATIONS) - 1)]


def train(minutes: float, steps: int | None, seed: int, cores: int) -> tuple[Array, Array]:
    """
    Train from weights that are 0.

    :param minutes: of the clock, unless `steps` is given.
    :param steps: number of decisions after which no more generation begins; equal seeds then give
        equal weights.
    :return: (4) weights, and rows of the curve: minutes, decisions, share of merges
    """
    began_s, started, driven, decisions = time.monotonic(), 0, 0, 0
    rows = list[tuple[float, int, float]]()
    random = np.random.default_rng(seed)
    mean, spread = np.zeros(WEIGHT_COUNT), np.full(WEIGHT_COUNT, SPREAD)
    with multiprocessing.get_context('fork').Pool(cores, _begin, (WORLDS,)) as pool:
        while True:
            draws, count, best = sizes_of(len(rows))
            drawn = mean + spread * random.standard_normal((draws, WEIGHT_COUNT))
            starts = range(started, started + count)
            started, driven = started + count, driven + draws * count
            drives = pool.map(_drive, [(weights, start) for weights in drawn for start in starts],
                              chunksize=1)
            scores = np.array([item.total for item in drives]).reshape(draws, count).mean(axis=1)
            kept = drawn[np.argsort(-scores, kind='stable')[:best]]
            mean = kept.mean(axis=0)
            spread = kept.std(axis=0) + MORE * LESS_EACH ** len(rows)
            decisions += sum(item.decisions for item in drives)
            spent_s = time.monotonic() - began_s
            merged = sum(item.end == MERGED for item in drives)
            rows.append((spent_s / 60.0, decisions, merged / len(drives)))
            print(f'generation {len(rows)}: {spent_s:.0f} s, {decisions} decisions, {merged} of '
                  f'{len(drives)} drives merged', flush=True)
            # Another generation has to fit into the time.
            next_s = spent_s / driven * math.prod(sizes_of(len(rows))[:2])
            if decisions >= steps if steps is not None else spent_s + next_s > 60.0 * minutes:
                return mean, np.array(rows)


def by_planner(planner: str, seed: int) -> str:
    """Return how an AV drives from the same start by a planner that the package has."""
    _ENV[0].reset(seed=seed)
    agent = _ENV[0].agent
    game = load_game(GAME)
    assert game.avs is not None
    av = replace(game.avs[0], planner=planner, speed=agent.seats[0].state.speed)
    run = run_offline(build_setup(replace(game, seed=agent.game.setup.game.seed, avs=(av,)),
                                  agent.setups.base.loaded))
    states = run.states_of('av0')
    # The motorway runs along x there; the goal is behind the ramp's end.
    there = np.flatnonzero(states[:, 0] + CENTER > GOAL_X)
    last = int(there[0]) if len(there) else len(states) - 1
    bad = [item for item in run.violations if item.n <= last and (item.collision or item.off_road)]
    if bad:
        return 'contact' if bad[0].collision else 'off the road'
    if states[:last + 1, 3].min() < SLOWEST:
        return 'standing'
    return MERGED if len(there) else 'too late'


def _baseline(task: tuple[str, int]) -> str:
    name, seed = task
    if name not in ('random', 'keep'):
        return by_planner(name, seed)
    random = np.random.default_rng(seed)
    return drive(_ENV[0], lambda seen: KEEP if name == 'keep' else int(
        random.choice(np.flatnonzero(seen['mask']))), seed).end


def told(name: str, ends: Sequence[str]) -> tuple[float, float, float]:
    """Print how drives ended; return the share of merges and its 95 % interval (Wilson 1927)."""
    counts, n, z = Counter(ends), len(ends), 1.96
    share = counts.pop(MERGED, 0) / n
    middle = (share + z * z / (2.0 * n)) / (1.0 + z * z / n)
    half = z / (1.0 + z * z / n) * math.sqrt(share * (1.0 - share) / n + (z / (2.0 * n)) ** 2)
    low, high = max(middle - half, 0.0), middle + half
    print(f'{name}: {share:.1%} of {n} merged ({low:.1%} to {high:.1%})' + ''.join(
        f', {number} {end}' for end, number in sorted(counts.items())), flush=True)
    return share, low, high


def draw(rows: Array, tested: tuple[float, float, float], path: Path) -> None:
    """Draw the curve, and the test with its interval."""
    from matplotlib.figure import Figure
    figure = Figure(figsize=(7.0, 3.6), layout='constrained')
    axes = figure.subplots()
    axes.plot(rows[:, 0], 100.0 * rows[:, 2], marker='.', label='drives of a generation')
    share, low, high = (100.0 * number for number in tested)
    axes.errorbar(rows[-1, 0], share, [[share - low], [high - share]], marker='s', capsize=4,
                  color='black', label='test: unseen traffic, 95 % interval')
    axes.set(xlabel='time of training [min]', ylabel='merged [%]', ylim=(0.0, 103.0), xlim=0.0)
    axes.grid(alpha=0.3)
    axes.legend(loc='lower right')
    figure.savefig(path, dpi=120)


class _Parser(argparse.ArgumentParser):
    """A parser that says in one line what is wrong."""

    def error(self, message: str) -> NoReturn:
        """Exit with one line."""
        self.exit(2, f'{Path(__file__).name}: {message}\n')


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f'{text!r} is not a whole number from 1')
    return int(text)


def _minutes(text: str) -> float:
    try:
        minutes = float(text)
    except ValueError:
        minutes = math.nan
    if not 0.0 < minutes < math.inf:
        raise argparse.ArgumentTypeError(f'{text!r} is not a positive number of minutes')
    return minutes


def main() -> int:
    """Train, write the weights, test them, and draw the curve."""
    parser = _Parser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--minutes', type=_minutes, default=5.0, help='of training, by the clock')
    parser.add_argument('--steps', type=_positive,
                        help='decisions of training, instead of minutes: equal seeds give equal '
                             'weights')
    parser.add_argument('--seed', type=int, default=0, help='of exploration')
    parser.add_argument('--cores', type=_positive, default=2)
    parser.add_argument('--tests', type=_positive, default=200, help='drives in unseen traffic')
    parser.add_argument('--baselines', action='store_true', help='test others there, too')
    values = parser.parse_args()
    weights, rows = train(values.minutes, values.steps, values.seed, values.cores)
    np.savez(WEIGHTS, weights=weights)
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f'trained in {rows[-1, 0]:.1f} min, {rows[-1, 1]:.0f} decisions, '
          f'{spent.ru_utime + spent.ru_stime:.0f} s of processor time')
    seeds = range(TEST, TEST + values.tests)
    with multiprocessing.get_context('fork').Pool(values.cores, _begin) as pool:
        ends = [item.end for item in pool.imap(
            _drive, [(weights, seed) for seed in seeds])]
        tested = told('policy', ends)
        for name in BASELINES if values.baselines else ():
            told(name, pool.map(_baseline, [(name, seed) for seed in seeds], chunksize=1))
    draw(rows, tested, WEIGHTS.with_suffix('.png'))
    print(f'{WEIGHTS} and {WEIGHTS.with_suffix(".png")}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
