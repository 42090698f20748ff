# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Train manoeuvres by MaskablePPO of Stable-Baselines3, and draw the learning curve.

    pip install stable-baselines3 sb3-contrib     # and PyTorch; nothing else here needs them
    python examples/train_sb3.py                  # writes trained_sb3.zip and .png beside it
    ./run.sh scenarios/cut_in.yaml --driver cockpit --planner policy:examples/train_sb3.py:load

The human overtakes, cuts in and brakes to a stop. Every half second, the AV behind chooses to keep
on, to change lanes, or to drive faster or slower; nothing brakes for it. After every tenth of the
training, the policy drives 20 starts that it is never trained on.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
import sys
import time

from crgame_ros.gym.driving_env import DrivingEnv
from crgame_ros.policy.observation import Observed
from crgame_ros.policy.policy_file import Policy
import numpy as np
from numpy.typing import NDArray

try:
    from sb3_contrib import MaskablePPO
    from stable_baselines3.common.vec_env import DummyVecEnv
    import torch
except ImportError as _error:
    raise SystemExit(f'{_error.name} is missing: pip install stable-baselines3 sb3-contrib'
                     ) from _error

WEIGHTS = Path(__file__).with_name('trained_sb3.zip')
OBSERVATION = {'parts': ['state', 'objects'], 'objects': 4, 'scaled': True,
               'history': {'objects': 2}}
REWARD = {'progress': 0.02, 'speeding': -0.02, 'acceleration': -0.005, 'collision': -20.0,
          'off_road': -20.0}
VARY = {'speed': 4.0, 'along': 15.0}
TICKS, GAMES, POINTS = 5, 8, 10
# Seeds of the starts that show how well a policy drives; training draws others.
HELD_OUT = range(100_000, 100_020)
Decide = Callable[[Observed], int]


def make() -> DrivingEnv:
    """Return the environment."""
    return DrivingEnv(game='cut_in', action='manoeuvre', observation=OBSERVATION, reward=REWARD,
                      vary=VARY, ticks=TICKS)


def decides(model: MaskablePPO) -> Decide:
    """Return what a model does, without exploration."""
    def act(seen: Observed) -> int:
        return int(model.predict(seen, action_masks=seen['mask'] > 0.5, deterministic=True)[0])
    return act


def load() -> Policy:
    """Return the trained policy: what `policy:train_sb3.py:load` in a game file calls."""
    if not WEIGHTS.exists():
        raise FileNotFoundError(f'{WEIGHTS} is missing: run {Path(__file__).name} first')
    torch.set_num_threads(1)
    return Policy(decides(MaskablePPO.load(WEIGHTS, device='cpu')), 'manoeuvre', OBSERVATION,
                  TICKS)


def judge(env: DrivingEnv, decide: Decide) -> tuple[float, float]:
    """Drive the held-out starts; return the mean sum of rewards, and the share of contacts."""
    totals, contacts = [], 0
    for seed in HELD_OUT:
        seen, _ = env.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            seen, reward, terminated, truncated, info = env.step(np.int64(decide(seen)))
            total, over = total + reward, terminated or truncated
        totals.append(total)
        contacts += bool(info['hit'])
    return float(np.mean(totals)), contacts / len(HELD_OUT)


def train(steps: int, seed: int) -> tuple[MaskablePPO, NDArray[np.float64]]:
    """Train; return the model and rows of decisions, mean sum of rewards, share of contacts."""
    torch.set_num_threads(1)
    env = make()
    model = MaskablePPO('MultiInputPolicy', DummyVecEnv([make] * GAMES), n_steps=64,
                        batch_size=128, gamma=0.97, ent_coef=0.01, learning_rate=1e-3, seed=seed,
                        device='cpu')
    rows = [(0.0, *judge(env, decides(model)))]
    for _ in range(POINTS):
        model.learn(max(1, steps // POINTS), reset_num_timesteps=False)
        rows.append((float(model.num_timesteps), *judge(env, decides(model))))
        print(f'seed {seed}: {rows[-1][0]:.0f} decisions, reward {rows[-1][1]:.2f}, '
              f'{rows[-1][2]:.0%} end in a contact', flush=True)
    return model, np.array(rows)


def draw(curves: dict[int, NDArray[np.float64]], chance: float, path: Path) -> None:
    """Draw the curves, and the mean of random manoeuvres."""
    from matplotlib.figure import Figure
    figure = Figure(figsize=(7.0, 3.6), layout='constrained')
    axes = figure.subplots()
    for seed, rows in curves.items():
        axes.plot(rows[:, 0], rows[:, 1], marker='.', label=f'seed {seed}')
    axes.axhline(chance, color='gray', linestyle='--', label='random manoeuvres')
    axes.set_xlabel('decisions')
    axes.set_ylabel(f'mean reward of {len(HELD_OUT)} held-out starts')
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=120)


def main() -> int:
    """Train for each seed, draw the curves, and keep the best policy."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--steps', type=int, default=10_240, help='decisions for each seed')
    parser.add_argument('--seeds', type=int, nargs='+', default=[1, 2, 3])
    parser.add_argument('--picture', type=Path, default=WEIGHTS.with_suffix('.png'))
    values = parser.parse_args()
    random = np.random.default_rng(0)
    chance = judge(make(), lambda seen: int(random.choice(np.flatnonzero(seen['mask']))))
    print(f'random manoeuvres: reward {chance[0]:.2f}, {chance[1]:.0%} end in a contact')
    best, curves = -np.inf, {}
    for seed in values.seeds:
        began_s = time.process_time()
        model, curves[seed] = train(values.steps, seed)
        print(f'seed {seed}: {time.process_time() - began_s:.0f} s of processor time')
        if curves[seed][-1, 1] > best:
            best = curves[seed][-1, 1]
            model.save(WEIGHTS)
    draw(curves, chance[0], values.picture)
    print(f'{WEIGHTS} and {values.picture}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
