# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Train a small driving policy with numpy alone, in a minute or two; then drive against it.

    python examples/train_policy.py               # trains, and writes trained_policy.npz beside it
    python examples/train_policy.py --watch       # shows a drive of it in the cockpit's page
    ./run.sh scenarios/cut_in.yaml --driver cockpit --planner policy:examples/train_policy.py:load

The human overtakes, cuts in and brakes to a stop; the policy drives the AV behind. It is linear
in 12 features of what it sees, and the cross-entropy method (Rubinstein 1999) finds the weights:
draw some, keep those that drive best, draw again around them. All that are drawn drive at once,
each in a game of its own, from the same start.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
import sys
import time

from crgame_ros.gym.driving_env import DrivingEnv
from crgame_ros.gym.games_together import GamesTogether
from crgame_ros.policy.policy_file import Policy
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WEIGHTS = Path(__file__).with_name('trained_policy.npz')
OBSERVATION = {'parts': ['state', 'objects'], 'objects': 4}
REWARD = {'progress': 0.05, 'offset': -0.1, 'heading': -0.5, 'speeding': -0.1, 'jerk': -0.0003,
          'acceleration': -0.003, 'collision': -30.0, 'off_road': -30.0}
# How the start of the AV varies, so that the drive is not learned by heart.
VARY = {'speed': 3.0, 'along': 10.0}
PEDAL, STEERING = 7, 5
# No leader counts as a leader far ahead at the same speed: distance [m].
CLEAR = 80.0


def features(seen: Mapping[str, NDArray[np.float32]]) -> tuple[Array, Array]:
    """
    Return what pedal and steering depend on, of B observations.

    :return: (B, 7) and (B, 5), all of the order of 1
    """
    speed, _, _, _, offset, heading, curvature, limit, _ = np.moveaxis(
        seen['state'].astype(np.float64), -1, 0)
    rows = seen['objects'].astype(np.float64)
    in_way = (rows[..., 0] > 0.5) & (rows[..., 1] > 4.0) & (np.abs(rows[..., 2]) < 2.2)
    away = np.where(in_way, rows[..., 1] - 5.0, CLEAR)
    nearest = away.argmin(axis=-1)[..., None]
    gap = np.minimum(np.take_along_axis(away, nearest, -1)[..., 0], CLEAR)
    closing = np.where(gap < CLEAR, speed - np.take_along_axis(rows[..., 4], nearest, -1)[..., 0],
                       0.0)
    one = np.ones_like(speed)
    # Braking that just avoids contact, and how short the way is at this speed [s].
    needed = np.maximum(closing, 0.0) ** 2 / (2.0 * np.maximum(gap, 0.5)) / 4.0
    headway = np.maximum(0.0, 1.0 - gap / np.maximum(2.0 * speed, 4.0))
    pedal = np.stack((one, (limit - speed) / 10.0, closing / 10.0, np.minimum(needed, 3.0),
                      headway, np.minimum(gap, 40.0) / 40.0, speed / 20.0), axis=-1)
    # The share of the curvature that the road itself needs at this speed.
    bend = curvature * np.maximum(speed, 3.0) ** 2 / 5.0
    steering = np.stack((one * 0.1, offset, heading * 10.0, bend, heading * speed), axis=-1)
    return pedal, steering


def actions(weights: Array, seen: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
    """Let policies with weights (B, 12) decide: (B, 2)."""
    pedal, steering = features(seen)
    chosen = np.stack((np.einsum('...i,...i->...', weights[..., :PEDAL], pedal),
                       np.einsum('...i,...i->...', weights[..., PEDAL:], steering)), axis=-1)
    return np.tanh(chosen).astype(np.float32)


def load() -> Policy:
    """Return the trained policy: what `policy:train_policy.py:load` in a game file calls."""
    if not WEIGHTS.exists():
        raise FileNotFoundError(f'{WEIGHTS} is missing: run {Path(__file__).name} first')
    weights: Array = np.load(WEIGHTS)['weights']
    return Policy(lambda seen: actions(weights, seen), 'acceleration', OBSERVATION)


def returns(games: GamesTogether, weights: Array, seed: int) -> Array:
    """Return the sum of rewards (B) of one episode of each policy, all from the same start."""
    seen, _ = games.reset(seed=[seed] * len(weights))
    total, going = np.zeros(len(weights)), np.ones(len(weights), dtype=bool)
    while going.any():
        seen, reward, terminated, truncated, _ = games.step(actions(weights, seen))
        total += np.where(going, reward, 0.0)
        going &= ~(terminated | truncated)
    return total


def train(generations: int, population: int, seed: int) -> Array:
    """Find the weights (12) that drive best."""
    games = GamesTogether(population, game='cut_in', observation=OBSERVATION, reward=REWARD,
                          vary=VARY)
    random = np.random.default_rng(seed)
    # A hint of what pedals and wheels are for: more speed below the limit, back to the lane.
    mean = np.array((0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.1, -0.1, 0.5, 0.0))
    spread = np.array((0.5, 0.5, 1.0, 1.5, 1.5, 0.5, 0.5, 0.1, 0.1, 0.1, 0.5, 0.05))
    best = max(2, population // 5)
    for generation in range(generations):
        drawn = mean + spread * random.standard_normal((population, len(mean)))
        drawn[0] = mean
        scores = returns(games, drawn, seed + generation)
        kept = drawn[np.argsort(scores)[::-1][:best]]
        mean, spread = kept.mean(axis=0), kept.std(axis=0) + 0.05 / (1 + generation)
        print(f'generation {generation + 1}: best {scores.max():.1f}, '
              f'mean {scores.mean():.1f}', flush=True)
    games.close()
    return mean


def drive(weights: Array, seed: int, render_mode: str | None = None) -> tuple[float, str]:
    """Drive an episode; give its sum of rewards, and how it ended."""
    env = DrivingEnv(game='cut_in', observation=OBSERVATION, reward=REWARD, vary=VARY,
                     render_mode=render_mode)
    seen, _ = env.reset(seed=seed)
    total = 0.0
    while True:
        seen, reward, terminated, truncated, info = env.step(actions(weights, seen))
        total += reward
        if terminated or truncated:
            env.close()
            return total, 'time' if truncated else f'contact with {info["hit"]}' \
                if info['hit'] else 'off the road' if info['off_road'] else 'goal'


def main() -> int:
    """Train, write the weights, and drive starts that were not trained on."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--generations', type=int, default=10)
    parser.add_argument('--population', type=int, default=16)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--watch', action='store_true', help='show the trained policy instead')
    values = parser.parse_args()
    if values.watch:
        print(*drive(np.load(WEIGHTS)['weights'], 1000, 'human'))
        return 0
    began_s = time.process_time()
    weights = train(values.generations, values.population, values.seed)
    np.savez(WEIGHTS, weights=weights)
    print(f'{WEIGHTS} after {time.process_time() - began_s:.0f} s of processor time')
    ends = [drive(weights, seed) for seed in range(1000, 1005)]
    for total, end in ends:
        print(f'a new start: {total:.1f}, ended by {end}')
    return int(any(end.startswith(('contact', 'off')) for _, end in ends))


if __name__ == '__main__':
    sys.exit(main())
