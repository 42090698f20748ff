# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame score`: print how well planners and people drove, as text or JSON."""

import argparse
from collections.abc import Iterator
from datetime import datetime
import json
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.library.lookup import find_scenario

if TYPE_CHECKING:  # A command that needs no engine starts without it.
    from crgame_ros.analysis.scores.nuplan import NuplanScore
    from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
    from crgame_ros.analysis.scores.solution_judge import SolutionScores
    from crgame_ros.analysis.scores.trajectory_feasibility import TrajectoryFeasibility
    from crgame_ros.analysis.scores.vehicle import GoalRecord, PlannerScores
    from crgame_ros.recording.progress import Progress
    from crgame_ros.recording.recorded_plans import PlanOutcome

DESCRIPTION = """\
Score the drivers of a run: CommonRoad's costs and checks, feasibility, nuPlan's closed-loop score,
and the planners' answers.

  crgame score runs/NAME                                     each vehicle of a run
  crgame score runs/NAME --expert runs/HUMAN                 progress compared with a human's run
  crgame score --scenario FILE.xml --solution SOLUTION.xml   published solutions of a scenario

docs/scores.md defines each score. With --out the scenario, a solution file for each vehicle and
cost function, and all numbers (scores.json) are written."""
NONE = '-'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument('run', nargs='?', type=Path, help='folder of a run, or its recording')
    parser.add_argument('--epoch', type=int, help='which run of a recording that holds several '
                        '(resets count them from 0; default: the last)')
    parser.add_argument('--scenario', type=find_scenario, metavar='FILE|ID',
                        help='CommonRoad file, or benchmark id, instead of a run, for --solution')
    parser.add_argument('--solution', type=Path, action='append', default=[], metavar='FILE',
                        help='solution file to score against the run as exported, or against '
                        '--scenario; may be repeated')
    parser.add_argument('--expert', type=Path, metavar='RUN',
                        help="run whose first human's progress is the measure (default: the "
                        'recorded obstacle that a planning problem replaced, else a free drive at '
                        'the speed limit)')
    parser.add_argument('--json', action='store_true', help='print it as JSON')
    parser.add_argument('--out', type=Path, metavar='DIR', help='folder to write files to')
    parser.set_defaults(command=score)


def score(values: argparse.Namespace) -> int:
    """Score a run or solutions, and print the scores."""
    if (values.run is None) == (values.scenario is None):
        raise InputError('give a run, or --scenario with --solution', 'crgame score',
                         'see --help')
    if values.scenario is not None and not values.solution:
        raise InputError('there is nothing to score', '--scenario', 'give --solution FILE')
    if values.scenario is not None and values.expert is not None:
        raise InputError('is for runs', '--expert', 'leave it out')
    found = _score_run(values) if values.run is not None else _score_file(values)
    if values.out is not None:
        _write(found, values.out)
    if values.json:
        print(_json(found))
    else:
        print('\n'.join(line for each in found for line in _lines(each)))
        if values.out is not None:
            print(f'files are in {values.out}')
    return 0


def _progress(what: str) -> 'Progress':
    from crgame_ros.recording.progress import on_stderr, Progress
    return Progress(on_stderr, what)


def _score_run(values: argparse.Namespace) -> 'list[PlannerScores]':
    from crgame_ros.analysis.scores.scored_run import expert_of_run, score_run
    from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
    from crgame_ros.recording.recorded_plans import plans_of_report
    from crgame_ros.recording.run_folder import recording_in
    from crgame_ros.recording.run_record import read_run_record
    from crgame_ros.recording.run_trajectories import read_trajectories
    from crgame_ros.recording.timing_report import timing_report
    bag = recording_in(values.run)
    record = read_run_record(bag, values.epoch, _progress(f'reading {values.run}'))
    expert = None if values.expert is None else expert_of_run(
        read_trajectories(recording_in(values.expert), None,
                          _progress(f'reading {values.expert}')),
        record.log, str(values.expert))
    plans = {}
    if record.log.game.avs:
        try:
            plans = plans_of_report(timing_report(bag, values.epoch, record.log,
                                                  _progress(f'reading plans of {values.run}')))
        except CrgameError as error:
            print(f'note: no plans: {error}', file=sys.stderr)
    found = [score_run(record, expert=expert, plans=plans,
                       progress=_progress(f'scoring {values.run}'))]
    if values.solution:
        found.append(_score_solutions(values, ScoredScenario.from_run(record.log)[0]))
    return found


def _score_file(values: argparse.Namespace) -> 'list[PlannerScores]':
    from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
    from crgame_ros.scenario.loading import load_scenario
    return [_score_solutions(values, ScoredScenario.from_file(load_scenario(values.scenario)))]


def _score_solutions(values: argparse.Namespace, scored: 'ScoredScenario') -> 'PlannerScores':
    from crgame_ros.analysis.scores.scored_solution import score_solutions
    from crgame_ros.analysis.scores.solution_file import read_solution
    return score_solutions(scored, {str(path): read_solution(path) for path in values.solution},
                           _progress('scoring solutions'))


def _write(found: 'list[PlannerScores]', out: Path) -> None:
    """Write the scenario, the solutions of a run's vehicles, and all scores."""
    from crgame_ros.analysis.scores.solution_file import dated, solution_name, solution_text
    from crgame_ros.recording.export import prepare_folder
    from crgame_ros.whole_file import write_text
    prepare_folder(out)
    when = datetime.now()
    scores = found[0]
    write_text(scores.xml_text, out / f'{scores.scenario_id}.xml')
    for vehicle in scores.vehicles:
        if vehicle.commonroad is None or vehicle.role == 'solution':
            continue
        for solution in vehicle.commonroad.solutions(scores.scenario_id).values():
            write_text(solution_text(dated(solution, when)),
                       out / solution_name(solution, vehicle.vehicle_id))
    write_text(f'{_json(found)}\n', out / 'scores.json')


def _json(found: 'list[PlannerScores]') -> str:
    told = [each.as_dict() for each in found]
    return json.dumps(told[0] if len(told) == 1 else told, indent=2, allow_nan=False)


def _lines(found: 'PlannerScores') -> Iterator[str]:
    from crgame_ros.analysis.scores.commonroad_costs import checker_version
    yield f'{found.scenario_id}, {checker_version()}'
    for vehicle in found.vehicles:
        assert vehicle.commonroad is not None and vehicle.goal is not None
        planner = f', {vehicle.planner}' if vehicle.planner else ''
        yield ''
        yield f'{vehicle.vehicle_id} ({vehicle.role}{planner})'
        yield from (f'  {name:<12} {text}' for name, text in (
            *_nuplan(vehicle.nuplan), *_commonroad(vehicle.commonroad),
            *_goal(vehicle.goal), *_plans(vehicle.plans)))
        for remark in vehicle.remarks:
            yield f'  note: {remark}'
    yield ''
    for remark in found.remarks:
        yield f'note: {remark}'


def _nuplan(found: 'NuplanScore | None') -> Iterator[tuple[str, str]]:
    from crgame_ros.analysis.scores.nuplan import BOUNDS, WEIGHTS
    if found is None:
        return
    factors = ' x '.join(f'{name.replace("_", " ")} {_number(value)}'
                         for name, value in found.multipliers.items())
    mean = ', '.join(f'{name.replace("_", " ")} {_number(value)} (x{WEIGHTS[name]:g})'
                     for name, value in found.weighted.items())
    yield 'nuPlan', f'{found.score:.3f} of 1'
    yield '', f'= {factors}'
    yield '', f'x mean of {mean}'
    yield '', f'progress {found.own_progress:.0f} m, {found.expert}: {found.expert_progress:.0f} m'
    for each in found.collisions:
        fault = 'at fault' if each.at_fault else 'not at fault'
        yield '', (f'collision with {each.other_id} at {each.time_s:.1f} s: {each.kind}, '
                   f'{fault}')
    comfort = found.comfort
    beyond = [f'{name.replace("_", " ")} {comfort.lowest[name]:.2f} to '
              f'{comfort.highest[name]:.2f} {BOUNDS[name].unit}' for name in comfort.exceeded]
    if beyond:
        yield '', f'not comfortable: {"; ".join(beyond)}'
    for remark in found.remarks:
        yield '', f'note: {remark}'


def _commonroad(found: 'SolutionScores') -> Iterator[tuple[str, str]]:
    valid, solved = 'valid' if found.checks.is_valid else 'not valid', found.solved
    yield 'CommonRoad', (f'{valid} as {solved.vehicle_id}, problem {solved.planning_problem_id}, '
                         f'{len(solved.trajectory.state_list)} states')
    for name, reason in found.checks.failed.items():
        yield '', f'{name}: {reason}'
    costs = [f'{cost.name} {cost.total:.4g}' for cost in found.costs if cost.total is not None]
    if costs:
        yield '', '  '.join(costs)
    reasons: dict[str, list[str]] = {}
    for cost in found.costs:
        if cost.total is None:
            reasons.setdefault(cost.reason, []).append(cost.name)
    for reason, names in reasons.items():
        yield '', f'no {", ".join(names)}: {reason}'
    yield 'feasibility', _feasibility(found.feasibility)


def _feasibility(found: 'TrajectoryFeasibility') -> str:
    if found.feasible is None:
        return f'unknown: {found.reason}'
    if found.feasible:
        return f'feasible, {found.transitions} transitions'
    return (f'not from time step {found.first_step} on, {found.infeasible} of '
            f'{found.transitions} transitions: {found.reason}')


def _goal(found: 'GoalRecord') -> Iterator[tuple[str, str]]:
    if found.reached_s is not None:
        yield 'goal', f'reached after {found.reached_s:.1f} s'
    elif found.last_distance is not None:
        yield 'goal', (f'not reached, {found.last_distance:.1f} m away at the end '
                       f'({found.least_distance:.1f} m at best)')
    else:
        yield 'goal', 'not reached'


def _plans(found: 'PlanOutcome | None') -> Iterator[tuple[str, str]]:
    if found is None:
        return
    if found.accepted_share is None:
        yield 'plans', 'not recorded'
        return
    yield 'plans', (f'{100.0 * found.accepted_share:.1f} % accepted and no fallback, of '
                    f'{_number(found.plans)}; '
                    f'{_number(found.fallback)} fallbacks, {_number(found.refused)} '
                    f'refused, {_number(found.steps_without_plan)} steps without a plan')
    for reason, count in (found.fallback_reasons or {}).items():
        yield '', f'{count} x {reason}'
    for name, spread in (('latency', found.latency_ms), ('age', found.age_ms),
                         ('plan time', found.plan_time_ms)):
        if spread is not None:
            yield '', f'{name} {spread["p50"]:.0f} ms, at worst {spread["max"]:.0f} ms'
    if found.worst_tracking_errors:
        yield 'tracking', 'at worst ' + ', '.join(
            f'{name} {value:.2f} {_TRACKING_UNITS.get(name, "")}'
            for name, value in found.worst_tracking_errors.items())


_TRACKING_UNITS = {'lateral': 'm', 'along': 'm', 'heading': 'rad', 'speed': 'm/s', 'lane': 'm'}


def _number(value: float | None) -> str:
    return NONE if value is None else f'{value:.3g}'
