# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""How fast the offline runner is: vehicle steps per second, and the cut-in game of 20 s."""

import argparse
import statistics
import time

from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.human_vehicle import HumanVehicle
from crgame_ros.vehicle.kinematic_single_track import integrate
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import VehicleState

STEPS = 20_000


def microseconds_per_call(work: object, rounds: int) -> list[float]:
    """Time rounds of STEPS calls; give the microseconds a call for each round."""
    assert callable(work)
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        for _ in range(STEPS):
            work()
        times.append((time.perf_counter() - start) / STEPS * 1e6)
    return times


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rounds', type=int, default=7)
    rounds = parser.parse_args().rounds
    parameters = load_vehicle_parameters()
    vehicle = HumanVehicle(parameters, VehicleState(0.0, 0.0, 0.0, 10.0))
    command = DriverCommand(0.2, 0.0, 0.1)
    setup = build_setup(effective_game(RunRequest()))
    games = {True: [], False: []}
    hashes = set()
    for _ in range(rounds):
        for checked, times in games.items():
            start = time.perf_counter()
            result = run_offline(setup, duration_s=20.0, check_drivability=checked)
            times.append(time.perf_counter() - start)
            hashes.add(result.state_hash)
    rows = (
        ('KS model step (CRG 2-4) [us]', microseconds_per_call(
            lambda: integrate(0.0, 0.0, 0.0, 10.0, 0.1, 1.0, 0.1, 2.58, 0.01), rounds), '< 5'),
        ('human vehicle step, pedals to pose [us]',
         microseconds_per_call(lambda: vehicle.step(command, 0.01), rounds), '< 5'),
        ('cut-in game, 20 s, idm [s]', games[False], '< 0.4'),
        ('the same with drivability at 100 Hz [s]', games[True], '< 0.4'))
    print(f'{"":42}{"median":>9}{"worst":>9}  wanted')
    for name, values, wanted in rows:
        print(f'{name:42}{statistics.median(values):9.3f}{max(values):9.3f}  {wanted}')
    steps = 20.0 / setup.scheduler.dt_s * len(setup.vehicle_ids)
    print(f'{steps / statistics.median(games[False]):,.0f} vehicle steps per second in the game; '
          f'{len(hashes)} distinct state hash(es) over {2 * rounds} runs')


if __name__ == '__main__':
    main()
