# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The cost of criticality at a scenario step, by scenario: median, 99 % and worst.

    python benchmarks/criticality.py [SCENARIO.xml …]

Without a file it is the game with dense traffic. CPU time of one process; a profile with
--profile.
"""

import argparse
import cProfile
from pathlib import Path
import pstats
import statistics
import time

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.game.objects import ObjectStates
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_setup
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.offline import observed_run, OfflineResult, run_offline
import numpy as np

ROUNDS = 3


def measure(result: OfflineResult) -> tuple[list[float], list[int], int]:
    """Observe a run; return each tick's time [s], its number of pairs, and the vehicles."""
    criticality = Criticality(observed_run(result.setup))
    per_tick, times_s, pairs = result.setup.scheduler.steps_per_tick, [], []
    for k, (poses, velocities) in enumerate(zip(
            result.object_poses, result.object_velocities, strict=True)):
        objects = ObjectStates(poses, velocities)
        began_s = time.process_time()
        criticality.observe(k * per_tick, 0.0, result.vehicle_states[k * per_tick], objects)
        times_s.append(time.process_time() - began_s)
        pairs.append(sum(len(tick.others) for tick in criticality.latest))
    return times_s, pairs, criticality.vehicles


def main() -> None:
    """Measure each scenario, and print a line of it."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('scenarios', nargs='*', type=Path, metavar='SCENARIO.xml')
    parser.add_argument('--duration', type=float, default=5.0, metavar='S')
    parser.add_argument('--profile', action='store_true', help='where the time goes')
    values = parser.parse_args()
    requests = [RunRequest(scenario=path, driver='idle') for path in values.scenarios] or [
        RunRequest(game=scenarios_directory() / 'dense_merge.yaml')]
    print('vehicles  objects  pairs  median [ms]  99 % [ms]  worst [ms]  scenario')
    for request in requests:
        setup = effective_setup(request)
        result = run_offline(setup, duration_s=values.duration, check_drivability=False)
        rounds = [measure(result) for _ in range(ROUNDS)]
        # The quietest of several, tick by tick: other processes only ever add.
        times_s = np.min([times for times, _, _ in rounds], axis=0)[1:]
        _, pairs, vehicles = rounds[0]
        here = int(np.isfinite(result.object_poses[:, :, 0]).sum(axis=1).max(initial=0))
        print(f'{vehicles:8}  {here:7}  {statistics.mean(pairs):5.0f}  '
              f'{1e3 * np.median(times_s):11.2f}  {1e3 * np.percentile(times_s, 99):9.2f}  '
              f'{1e3 * times_s.max():10.2f}  {setup.loaded.scenario.scenario_id}')
        if values.profile:
            with cProfile.Profile() as profile:
                measure(result)
            pstats.Stats(profile).sort_stats('tottime').print_stats(25)


if __name__ == '__main__':
    main()
