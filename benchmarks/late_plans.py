#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Check that an AV's motion is one motion, however late its planner answers.

    python benchmarks/late_plans.py
    python benchmarks/late_plans.py scenarios/cut_in.yaml --planner idm --latencies 0 20 40
    python benchmarks/late_plans.py FOLDER/*.xml --time-steps 0.04 0.2
    python benchmarks/late_plans.py scenarios/cut_in.yaml --live

Each game runs offline, also with scenarios of other time steps. In a CommonRoad scenario with a
planning problem, an AV drives among reactive traffic. With `--live` the whole graph runs: planners
with their default options wait before they answer. Of the AVs the table gives the largest
difference between the speed and the displacement, over a simulation step and over a scenario step,
the largest step to the side, the refused and the realigned plans, and the transitions that the
drivability checker refuses.
"""

import argparse
from pathlib import Path
import sys
import tempfile
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]

from commonroad.common.file_reader import CommonRoadFileReader  # noqa: E402, I100
from commonroad.common.util import Interval  # noqa: E402
from commonroad.prediction.prediction import TrajectoryPrediction  # noqa: E402
from commonroad.scenario.obstacle import DynamicObstacle  # noqa: E402
from commonroad.scenario.state import CustomState, InitialState  # noqa: E402
from commonroad.scenario.trajectory import Trajectory  # noqa: E402
from continuous_motion import disagreement  # noqa: E402
import crgame_ros  # noqa: E402
from crgame_ros.errors import CrgameError  # noqa: E402
from crgame_ros.game.game import Game, parse_game  # noqa: E402
from crgame_ros.geometry.angles import wrap_pi_array  # noqa: E402
from crgame_ros.schema.writing import write  # noqa: E402
from crgame_ros.simulation.setup import build_setup  # noqa: E402
from crgame_ros.verdict.copies import write_exactly  # noqa: E402
from live_graph import LiveGraph  # noqa: E402
import numpy as np  # noqa: E402
from placed_runs import played_values  # noqa: E402
import yaml  # noqa: E402

LATENCIES = (0, 1, 5, 10, 12, 20, 40, 70, 100)
HEAD = f'{"game":20} {"dt":>5} {"late":>4} {"av":5} {"dv step":>8} {"dv tick":>8} {"aside":>8} ' \
    f'{"refused":>7} {"realigned":>9} {"infeasible":>10}'


def resample(obstacle: DynamicObstacle, ratio: float) -> None:
    """
    Give an obstacle states at other time steps, interpolated between its own.

    :param ratio: new time steps in an old one
    """
    if not isinstance(obstacle.prediction, TrajectoryPrediction):
        return
    states = [obstacle.initial_state, *obstacle.prediction.trajectory.state_list]
    known = np.array([state.time_step for state in states]) * ratio
    steps = np.arange(np.ceil(known[0]), np.floor(known[-1]) + 1.0)
    x, y, yaw, speed = (np.interp(steps, known, values) for values in (
        [state.position[0] for state in states], [state.position[1] for state in states],
        np.unwrap([state.orientation for state in states]),
        [state.velocity for state in states]))
    yaw = wrap_pi_array(yaw)
    first, *later = [{
        'time_step': int(step), 'position': np.array((x[i], y[i])),
        'orientation': yaw[i], 'velocity': speed[i]}
        for i, step in enumerate(steps)]
    obstacle.initial_state = InitialState(**first)
    obstacle.prediction = TrajectoryPrediction(Trajectory(later[0]['time_step'], [
        CustomState(**values) for values in later]), obstacle.obstacle_shape)


def game_at(path: Path, time_step_s: float | None, folder: Path) -> Game:
    """
    Return a game whose scenario has another time step.

    :param path: of a game, or of a CommonRoad scenario, as in `played_values`.
    :param time_step_s: None for that of the scenario.
    :param folder: where the scenario is written.
    """
    values = played_values(path)
    if time_step_s is not None:
        source = path.parent / values['scenario']
        scenario, problems = CommonRoadFileReader(str(source)).open()
        ratio = scenario.dt / time_step_s
        for obstacle in scenario.dynamic_obstacles:
            resample(obstacle, ratio)
        for light in scenario.lanelet_network.traffic_lights:
            cycle = light.traffic_light_cycle
            for element in cycle.cycle_elements if cycle else ():
                element.duration = max(1, round(element.duration * ratio))
        for problem in problems.planning_problem_dict.values():
            problem.initial_state.time_step = round(problem.initial_state.time_step * ratio)
            for state in problem.goal.state_list:
                state.time_step = Interval(round(state.time_step.start * ratio),
                                           round(state.time_step.end * ratio))
        scenario.dt = time_step_s
        values['scenario'] = write_exactly(
            scenario, problems, folder / f'{source.stem}_{time_step_s}.xml')
    return parse_game(values, str(path), path.parent)


def main() -> None:
    """Print one line for each game, time step, latency [steps] and AV."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('games', nargs='*', type=Path,
                        help='games or scenarios; all games of scenarios/')
    parser.add_argument('--planner', help="of all AVs, instead of the game's")
    parser.add_argument('--latencies', nargs='+', type=int, default=LATENCIES, metavar='STEPS')
    parser.add_argument('--time-steps', nargs='+', type=float, default=(None,), metavar='SECONDS',
                        help='of the scenario, instead of its own')
    parser.add_argument('--duration', type=float, default=10.0, help='of each run [s]')
    parser.add_argument('--feasibility', action='store_true',
                        help='with the drivability checker, which takes seconds for each run')
    parser.add_argument('--live', action='store_true',
                        help='the whole graph, whose planners answer so much later')
    given = parser.parse_args()
    print(HEAD)
    games = given.games or sorted(path for path in (ROOT / 'scenarios').glob('*.yaml')
                                  if path.name.count('.') == 1)
    with tempfile.TemporaryDirectory() as folder:
        for path in games:
            for time_step_s in given.time_steps:
                try:
                    game = game_at(path, time_step_s, Path(folder))
                    for latency in given.latencies:
                        measure(path.stem, game, latency, given, Path(folder))
                except CrgameError as error:
                    print(f'{path.stem}: {error}', flush=True)


def measure(name: str, game: Game, latency: int, given: argparse.Namespace, folder: Path) -> None:
    """Print the lines of a run."""
    setup = build_setup(game)
    if given.live:
        run = live_run(game, given.planner, latency * setup.scheduler.dt_s, given.duration, folder)
        states, planners = run.recorded_traces(), run.timing['planners']
    else:
        run = crgame_ros.run(game, planner=given.planner, latency_steps=latency,
                             duration_s=given.duration)
        states = {av.id: run.result.states_of(av.id) for av in setup.avs}
        planners = {av: vars(record.counters) for av, record in run.result.planners.items()}
    scores = run.scores() if given.feasibility else {}
    for av in setup.avs:
        every = setup.scheduler.steps_per_tick
        step, aside = disagreement(states[av.id], setup.scheduler.dt_s)
        tick, _ = disagreement(states[av.id][::every], setup.scheduler.time_step_s)
        score = scores[av.id].commonroad if scores else None
        infeasible = score.feasibility.infeasible if score else '-'
        print(f'{name:20} {setup.scheduler.time_step_s:5} {latency:4} {av.id:5} {step:8.3f} '
              f'{tick:8.3f} {aside:8.3f} {planners[av.id]["refused"]:7} '
              f'{planners[av.id]["realigned"]:9} {infeasible:>10}', flush=True)


def live_run(game: Game, planner: str | None, latency_s: float, duration_s: float,
             folder: Path) -> Any:
    """Run the whole graph with late planners, and return the recorded run."""
    values = write(game, game.base)
    for av in values['avs']:
        av['options'] = {'planner': planner or av['planner'], 'latency': latency_s}
        av['planner'] = f'{ROOT}/benchmarks/late_planner.py:LatePlanner'
    file = folder / 'late.yaml'
    file.write_text(yaml.safe_dump(values))
    runs = folder / f'{len(list(folder.iterdir()))}'
    LiveGraph(runs, [str(file), '--duration', f'{duration_s:g}', '--no-report']).wait()
    return crgame_ros.read_run(runs)


if __name__ == '__main__':
    main()
