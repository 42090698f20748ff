# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Steps per second of our environments beside highway-env: the tables of docs/gym.md.

    python benchmarks/gym.py [--environment DIR] [--steps N] [--write]

One run, in turns, with as many vehicles, the same rates of decisions and of simulation, and an
observation of the nearest eight vehicles. Processor time: other load of the machine doesn't
count. highway-env is installed into an environment of its own (made once).
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
import json
from pathlib import Path
import re
import statistics
import subprocess
import sys
import time
from typing import Any
import venv

from crgame_ros.game.game import Game, load_game
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.gym.driving_env import DrivingEnv
from crgame_ros.gym.games_together import GamesTogether
from crgame_ros.gym.shipped_environments import ANY_GAME
from crgame_ros.paths import scenarios_directory
import gymnasium
from gymnasium.vector import SyncVectorEnv
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / 'docs' / 'gym.md'
PACKAGE = 'highway-env==1.10.1'
MARKS = '<!-- steps: begin -->', '<!-- steps: end -->'
# Vehicles, the agent's among them; decisions and simulation steps a second.
CASES = tuple((vehicles, 10, rate) for rate in (10, 100) for vehicles in (10, 20, 50))
ROUNDS, GAMES = 5, 16
WANTED = 10.0


def theirs(environment: Path) -> 'subprocess.Popen[str]':
    """Start the process in which highway-env runs; make its environment where it is not."""
    python = environment / 'bin' / 'python'
    if not python.exists():
        print(f'installing {PACKAGE} into {environment} …', file=sys.stderr, flush=True)
        venv.create(environment, with_pip=True)
        subprocess.run([python, '-m', 'pip', 'install', '-q', PACKAGE], check=True)
    return subprocess.Popen([python, str(Path(__file__).with_name('highway_steps.py'))],
                            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def asked(process: 'subprocess.Popen[str]', name: str, vehicles: int, decisions: int,
          rate: int, steps: int) -> float:
    """Return the processor time of a step of highway-env [s]."""
    config = {'lanes_count': 4, 'vehicles_count': vehicles - 1, 'simulation_frequency': rate,
              'policy_frequency': decisions, 'duration': 20,
              'action': {'type': 'ContinuousAction'},
              'observation': {'type': 'Kinematics', 'vehicles_count': 9}}
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write(json.dumps({'id': name, 'config': config, 'steps': steps}) + '\n')
    process.stdin.flush()
    return float(json.loads(process.stdout.readline()))


def motorway(vehicles: int, rate: int) -> Game:
    """Return the game of a motorway with so many vehicles, the agent's among them."""
    game = load_game(scenarios_directory() / 'dense_merge.yaml')
    # The numbers of spawning and leaving vehicles are equal.
    return replace(game, humans=(), duration=20.0,
                   timing=replace(game.timing, rate=float(rate)),
                   traffic=TrafficSpec(agents=vehicles - 1, flow=2000.0,
                                       capacity=vehicles - 1))


class Ours:
    """An environment, and its numbers of vehicles at its steps."""

    def __init__(self, game: Game) -> None:
        self.env = gymnasium.make(ANY_GAME, disable_env_checker=True, game=game, worlds=1)
        self.env.reset(seed=0)
        self.vehicles: list[int] = []

    def step_s(self, steps: int) -> float:
        """Return the processor time of a step, without resets [s]."""
        spent, action = 0.0, np.zeros(2, np.float32)
        for _ in range(steps):
            start = time.process_time()
            _, _, terminated, truncated, _ = self.env.step(action)
            spent += time.process_time() - start
            there = np.isfinite(self.env.unwrapped.agent.game.objects.poses[:, 0])
            self.vehicles.append(1 + int(there.sum()))
            if terminated or truncated:
                self.env.reset()
        return spent / steps


def beside(environment: Path, steps: int) -> list[str]:
    """Measure both in turns; return a table."""
    lines = ['| vehicles | decisions, simulation [Hz] | ours [steps/s] | highway-v0 | '
             'highway-fast-v0 | ours to highway-v0 |', '|---|---|---|---|---|---|']
    process = theirs(environment)
    for vehicles, decisions, rate in CASES:
        ours = Ours(motorway(vehicles, rate))
        ours.step_s(20)
        # The road may not hold as many: theirs must have as many as ours.
        vehicles = round(statistics.mean(ours.vehicles))
        ways: list[Callable[[int], float]] = [ours.step_s, *(
            lambda count, name=name, vehicles=vehicles, decisions=decisions, rate=rate: asked(
                process, name, vehicles, decisions, rate, count)
            for name in ('highway-v0', 'highway-fast-v0'))]
        for way in ways:
            way(10)
        times = [[way(steps) for way in ways] for _ in range(ROUNDS)]
        mine, plain, fast = (statistics.median(column) for column in zip(*times, strict=True))
        lines.append(
            f'| {vehicles} | {decisions}, {rate} | '
            f'{1.0 / mine:.0f} | {1.0 / plain:.0f} | {1.0 / fast:.0f} | {plain / mine:.1f} |')
        print(lines[-1], file=sys.stderr, flush=True)
    process.communicate()
    return lines


def together(steps: int) -> list[str]:
    """Measure games one after the other and together in one process; return a table."""
    lines = ['| 16 games in one process | one after the other [steps/s] | together [steps/s] | '
             'ratio |', '|---|---|---|---|']
    for name in ('cut_in', 'merge', 'dense_merge'):
        apart = SyncVectorEnv([lambda name=name: DrivingEnv(game=name, worlds=1)] * GAMES)
        many = GamesTogether(GAMES, game=name, worlds=1)
        times = [(_step_s(apart, steps), _step_s(many, steps)) for _ in range(ROUNDS)]
        mine, all_s = (statistics.median(column) for column in zip(*times, strict=True))
        lines.append(f'| {name} | {1.0 / mine:.0f} | {1.0 / all_s:.0f} | {mine / all_s:.2f} |')
        print(lines[-1], file=sys.stderr, flush=True)
    return lines


def _step_s(env: SyncVectorEnv | GamesTogether, steps: int) -> float:
    """Return the processor time of a step of one game, without resets [s]."""
    actions = np.zeros((env.num_envs, 2), np.float32)
    env.reset(seed=0)
    start = time.process_time()
    for _ in range(steps // 4):
        env.step(actions)
    return (time.process_time() - start) / (steps // 4 * env.num_envs)


def main() -> int:
    """Measure, print or write the tables; 1 where a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--environment', type=Path, default=ROOT / '.venv-highway')
    parser.add_argument('--steps', type=int, default=100)
    parser.add_argument('--write', action='store_true', help='into docs/gym.md')
    values: Any = parser.parse_args()
    lines = beside(values.environment, values.steps)
    text = '\n'.join((*lines, '', *together(values.steps)))
    if values.write:
        begin, end = MARKS
        PAGE.write_text(re.sub(
            f'{begin}.*{end}', lambda _: f'{begin}\n{text}\n{end}',
            PAGE.read_text(encoding='utf-8'), flags=re.DOTALL), encoding='utf-8')
    else:
        print(text)
    missed = [line for line in lines[2:] if float(line.split('|')[-2]) < WANTED]
    print(f'{len(lines) - 2 - len(missed)} of {len(lines) - 2} cases at {WANTED:g} times or more',
          file=sys.stderr)
    return int(bool(missed))


if __name__ == '__main__':
    sys.exit(main())
