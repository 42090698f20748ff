# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which AVs reach their goals in published scenarios, and the reason for each that does not.

Drives each scenario offline with AVs alone, until the latest time that a goal allows. The first
reason that applies counts:

contact     it touched something or somebody
off road    it left the road
off route   no way leads from its lane at the end to the goal's lanes
state       it was in the goal's area, but not at the time, speed or heading that the goal wants
blocked     it stood for the last 3 s
time        it was still on its way
"""

import argparse
from collections import Counter
import gc
import math
import multiprocessing
from pathlib import Path
import sys

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.analysis.scores.driven_states import choose_type, driven_states
from crgame_ros.analysis.scores.vehicle import find_goal
from crgame_ros.errors import CrgameError
from crgame_ros.game.game import Game
from crgame_ros.recording.run_record import run_record_of
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.simulation.av_assignment import adapt_game
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import QUEUEING, StateColumn
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
REASONS = ('reached', 'contact', 'off road', 'off route', 'state', 'blocked', 'time')
# A vehicle that has stood for this long at the end is blocked [s].
STOOD_S = 3.0
# A goal without a time, and the longest drive [s].
USUAL_S, LONGEST_S = 30.0, 60.0


def default_files() -> list[Path]:
    """List the scenarios beside the project that have planning problems."""
    shared = ROOT.parent / 'shared' / 'scenarios'
    return [path for folder in (shared, shared / 'more') for path in sorted(folder.glob('*.xml'))
            if '<planningProblem ' in path.read_text(encoding='utf-8', errors='replace')]


def time_for(problems: list[PlanningProblem], dt_s: float) -> float:
    """Return the latest time that a goal allows [s]."""
    latest = [state.time_step.end if hasattr(state.time_step, 'end') else state.time_step
              for problem in problems for state in problem.goal.state_list
              if getattr(state, 'time_step', None) is not None]
    return min(LONGEST_S, max(latest) * dt_s) if latest else USUAL_S


def is_on_route(network: RoadNetwork, problem: PlanningProblem, pose: np.ndarray) -> bool:
    """Return whether a way leads from a pose to the lanes of a goal; True if it names none."""
    named = problem.goal.lanelets_of_goal_position or {}
    goals = {lanelet for lanelets in named.values() for lanelet in lanelets}
    for state in problem.goal.state_list:
        center = getattr(getattr(state, 'position', None), 'center', None)
        if center is not None:
            goals.add(network.nearest_lanelet(float(center[0]), float(center[1])))
    pending = [network.nearest_lanelet(*(float(value) for value in pose))]
    seen = set(pending)
    while pending:
        lanelet = pending.pop()
        beside = (network.left_of(lanelet), network.right_of(lanelet))
        for onward in (*network.successors(lanelet), *beside):
            if onward is not None and onward not in seen:
                seen.add(onward)
                pending.append(onward)
    return not goals or bool(goals & seen)


def reason_of(result: OfflineResult, number: int) -> str:
    """Return why an AV, by its number, did not reach its goal, or `reached`."""
    setup, log = result.setup, run_record_of(result).log
    av = setup.avs[number]
    column = setup.vehicle_ids.index(av.spec.id)
    states = driven_states(log, column, choose_type(av.vehicle).kind)
    goal = find_goal(av.planning_problem, states, setup.scheduler.time_step_s)
    if goal.reached_s is not None:
        return 'reached'
    if any(av.spec.id in (item.vehicle_id, item.other_id) for item in contacts_of(result)):
        return 'contact'
    if any(item.vehicle_id == av.spec.id and item.off_road for item in result.violations):
        return 'off road'
    if goal.least_distance is not None and goal.least_distance <= 0.0:
        return 'state'
    own = log.vehicle_states[:, column]
    network = RoadNetwork(setup.loaded.scenario.lanelet_network)
    if not is_on_route(network, av.planning_problem, own[-1, :3]):
        return 'off route'
    last = own[-math.ceil(STOOD_S / setup.scheduler.time_step_s):, StateColumn.SPEED]
    return 'blocked' if (last < QUEUEING).all() else 'time'


Task = tuple[Path, str]


def run(task: Task) -> tuple[Task, list[tuple[str, str]], str]:
    """Drive one scenario; return each AV with its reason, or an error."""
    path, planner = task
    try:
        loaded = load_scenario(path)
        game = adapt_game(Game(path.resolve(), humans=()), loaded, seed=0, planner=planner)
        setup = build_setup(game, loaded)
        result = run_offline(setup, duration_s=time_for(
            [av.planning_problem for av in setup.avs], loaded.time_step_s))
        return task, [(av.spec.id, reason_of(result, number))
                      for number, av in enumerate(setup.avs)], ''
    except CrgameError as error:
        return task, [], str(error)
    finally:
        # A planner's library would report the objects of the last run as leaked.
        gc.collect()


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('files', nargs='*', type=Path, metavar='FILE')
    parser.add_argument('--planners', default='idm,reactive')
    parser.add_argument('--jobs', type=int, default=1)
    parser.add_argument('--verbose', action='store_true', help='print every AV')
    values = parser.parse_args()
    planners = values.planners.split(',')
    tasks = [(path, planner) for path in values.files or default_files() for planner in planners]
    counts = {planner: Counter[str]() for planner in planners}
    with multiprocessing.get_context('spawn').Pool(values.jobs, maxtasksperchild=8) as pool:
        for (path, planner), found, error in pool.imap(run, tasks):
            counts[planner].update(reason for _, reason in found)
            if error:
                print(f'{path.stem} {planner}: {error}', flush=True)
            for av, reason in found if values.verbose else ():
                print(f'{path.stem} {planner} {av}: {reason}', flush=True)
    print(f'{"planner":12}{"AVs":>5}' + ''.join(f'{reason:>12}' for reason in REASONS))
    for planner, count in counts.items():
        total = count.total()
        print(f'{planner:12}{total:5}' + ''.join(
            f'{count[reason]:5} {count[reason] / max(total, 1):5.0%} ' for reason in REASONS))
    return 0


if __name__ == '__main__':
    sys.exit(main())
