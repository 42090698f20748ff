#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Check that an AV's motion is one motion, however late its planner answers.

    python benchmarks/late_plans.py
    python benchmarks/late_plans.py scenarios/cut_in.yaml --planner idm --latencies 0 20 40

Each game runs offline. Of its AVs the table gives the largest difference between the speed and
the displacement, over a simulation step and over a scenario step, the largest step to the side,
the refused and the realigned plans, and the transitions that the drivability checker refuses.
"""

import argparse
from pathlib import Path

import crgame_ros
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
LATENCIES = (0, 1, 5, 10, 12, 20, 40, 70, 100)
HEAD = f'{"game":20} {"late":>4} {"av":5} {"dv step":>8} {"dv tick":>8} {"aside":>8} ' \
    f'{"refused":>7} {"realigned":>9} {"infeasible":>10}'


def disagreement(states: NDArray[np.float64], dt_s: float) -> tuple[float, float]:
    """
    Return how far displacements differ from what the speeds say [m/s], and go to the side [m/s].

    :param states: (N, 8) at the rear axle
    :param dt_s: between them
    """
    steps = np.diff(states[:, :2], axis=0) / dt_s
    yaws = np.unwrap(states[:, StateColumn.YAW])
    middle, speeds = 0.5 * (yaws[1:] + yaws[:-1]), states[:, StateColumn.SPEED]
    along = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    aside = steps[:, 1] * np.cos(middle) - steps[:, 0] * np.sin(middle)
    return (float(np.abs(along - 0.5 * (speeds[1:] + speeds[:-1])).max()),
            float(np.abs(aside).max()))


def main() -> None:
    """Print one line for each game, latency [steps] and AV."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('games', nargs='*', type=Path, help='game files; all of scenarios/')
    parser.add_argument('--planner', help="of all AVs, instead of the game's")
    parser.add_argument('--latencies', nargs='+', type=int, default=LATENCIES, metavar='STEPS')
    parser.add_argument('--duration', type=float, default=10.0, help='of each run [s]')
    parser.add_argument('--feasibility', action='store_true',
                        help='with the drivability checker, which takes seconds for each run')
    given = parser.parse_args()
    print(HEAD)
    games = given.games or sorted(path for path in (ROOT / 'scenarios').glob('*.yaml')
                                  if path.name.count('.') == 1)
    for game in games:
        for latency in given.latencies:
            run = crgame_ros.run(game, planner=given.planner, latency_steps=latency,
                                 duration_s=given.duration)
            setup = run.result.setup
            scores = run.scores() if given.feasibility else {}
            for av in setup.avs:
                states = run.result.states_of(av.id)
                every = setup.scheduler.steps_per_tick
                step, aside = disagreement(states, setup.scheduler.dt_s)
                tick, _ = disagreement(states[::every], setup.scheduler.time_step_s)
                counters = run.result.planners[av.id].counters
                score = scores[av.id].commonroad if scores else None
                infeasible = score.feasibility.infeasible if score else '-'
                print(f'{game.stem:20} {latency:4} {av.id:5} {step:8.3f} {tick:8.3f} {aside:8.3f} '
                      f'{counters.refused:7} {counters.realigned:9} {infeasible:>10}', flush=True)


if __name__ == '__main__':
    main()
