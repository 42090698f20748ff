# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The speed of the offline runner: vehicle steps per second, the cut-in game, and cells of batches.

A cell is one run of a game from its file on: loading, placing all vehicles, the first step. It is
cold in a process that has run nothing yet, and warm where this scenario has been run before. CPU
time of one process, all kinds in turns. `regressions.py --only offline` compares two versions.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
import statistics
import subprocess
import sys
import tempfile
import time

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.run_tables import write_tables
from crgame_ros.evaluation.cell_grid import make_grid
from crgame_ros.evaluation.cell_run import compute_cell
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.plan import EvaluationPlan, PlannerChoice
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.offline import observed_run, run_offline
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.human_vehicle import HumanVehicle
from crgame_ros.vehicle.models import integrate
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import VehicleState

STEPS = 20_000
COLD_STARTS = 3


def seconds(work: Callable[[], object]) -> float:
    """Return the CPU time of a call [s]."""
    start = time.process_time()
    work()
    return time.process_time() - start


def microseconds_per_call(work: Callable[[], object], rounds: int) -> list[float]:
    """Time rounds of STEPS calls; return the microseconds a call for each round."""
    return [seconds(lambda: [work() for _ in range(STEPS)]) / STEPS * 1e6 for _ in range(rounds)]


def start_cell() -> Setup:
    """Start a cell: load game and scenario, place all vehicles, do the first step."""
    setup = build_setup(effective_game(RunRequest()))
    run_offline(setup, duration_s=setup.scheduler.dt_s)
    return setup


def run_cell() -> None:
    """Run a cell of 10 s with criticality, measures of driving, and its rows of all tables."""
    result = run_offline(build_setup(effective_game(RunRequest())), duration_s=10.0)
    with tempfile.TemporaryDirectory() as folder:
        write_tables([Run('cell', result=result)], Path(folder) / 'tables', 'parquet')


def cold_start() -> float:
    """Start a cell in a process of its own, which has loaded the program and run nothing [s]."""
    told = subprocess.run([sys.executable, __file__, '--cold'], check=True, capture_output=True,
                          text=True)
    return float(told.stdout)


class Work:
    """
    The kinds of work that are timed in turns, each ready to be done once.

    :ivar kinds: by name, with the time that is wanted [s]
    :ivar hashes: of the states of all games so far.
    """

    def __init__(self) -> None:
        self.setup, self.hashes = start_cell(), set[str]()
        self._folder = tempfile.TemporaryDirectory()
        store = ContentStore(Path(self._folder.name))
        cell, = make_grid(EvaluationPlan(
            (str(scenarios_directory() / 'cut_in.yaml'),), (),
            planners=(PlannerChoice('idm'),), seeds=1, duration=10.0, base=Path.cwd()), store)
        compute_cell(cell, store.folder)
        run_cell()
        self.kinds: dict[str, tuple[Callable[[], object], str]] = {
            'start of a cell, warm [s]': (start_cell, '<= 0.05'),
            'cut-in game, 20 s, idm [s]': (lambda: self._game(False, False), ''),
            'the same with drivability at 100 Hz [s]': (lambda: self._game(True, False), ''),
            'the same with criticality too [s]': (lambda: self._game(True, True), '<= 0.25'),
            'a cell of an evaluation, 10 s [s]': (
                lambda: compute_cell(cell, store.folder), '<= 0.2'),
            'a cell of 10 s, all measures and rows [s]': (run_cell, '<= 0.3')}

    def _game(self, checked: bool, measured: bool) -> None:
        observers = [Criticality(observed_run(self.setup))] if measured else []
        self.hashes.add(run_offline(self.setup, duration_s=20.0, check_drivability=checked,
                                    observers=observers).state_hash)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--rounds', type=int, default=7)
    parser.add_argument('--cold', action='store_true', help='start one cell, and say how long [s]')
    values = parser.parse_args()
    if values.cold:
        print(seconds(start_cell))
        return
    rounds, work = values.rounds, Work()
    vehicle = HumanVehicle(load_vehicle_parameters(), VehicleState(0.0, 0.0, 0.0, 10.0))
    command = DriverCommand(0.2, 0.0, 0.1)
    times: dict[str, list[float]] = {name: [] for name in work.kinds}
    for _ in range(rounds):
        for name, (kind, _) in work.kinds.items():
            times[name].append(seconds(kind))
    rows = [
        ('KS model step (CRG 2-4) [us]', microseconds_per_call(
            lambda: integrate(0.0, 0.0, 0.0, 10.0, 0.1, 1.0, 0.1, 2.58, 0.01), rounds), '< 5'),
        ('human vehicle step, pedals to pose [us]',
         microseconds_per_call(lambda: vehicle.step(command, 0.01), rounds), '< 5'),
        ('start of a cell, cold [s]', [cold_start() for _ in range(COLD_STARTS)], ''),
        *((name, times[name], wanted) for name, (_, wanted) in work.kinds.items())]
    print(f'{"":42}{"least":>9}{"median":>9}{"worst":>9}  wanted')
    for name, found, wanted in rows:
        print(f'{name:42}{min(found):9.4f}{statistics.median(found):9.4f}{max(found):9.4f}  '
              f'{wanted}')
    steps = 20.0 / work.setup.scheduler.dt_s * len(work.setup.vehicle_ids)
    plain = statistics.median(times['cut-in game, 20 s, idm [s]'])
    print(f'{steps / plain:,.0f} vehicle steps per second in the game; '
          f'{len(work.hashes)} distinct state hash(es) over {3 * rounds} runs')


if __name__ == '__main__':
    main()
