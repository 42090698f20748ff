# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solution of a scenario that the AVs of a run have driven, and the benchmark's verdict."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from datetime import datetime
import math
from typing import NamedTuple

from commonroad.common.solution import (
    CostFunction,
    PlanningProblemSolution,
    Solution,
    SupportedCostFunctions,
    VehicleModel,
)
from commonroad.scenario.state import KSState
from crgame_ros.analysis.scores.driven_states import (
    choose_type,
    driven_states,
    goal_step,
    point_mass_states,
    until_goal,
)
from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
from crgame_ros.analysis.scores.scored_solution import judge_solution
from crgame_ros.analysis.scores.solution_file import dated, ROOT, solution_text
from crgame_ros.analysis.scores.solution_judge import SolutionScores
from crgame_ros.errors import InputError
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.scenario import guard
from crgame_ros.scenario.export_network import solution_schema_errors
from crgame_ros.scenario.loading import LoadedScenario, parse_scenario
import numpy as np

# In the ids of scenarios whose traffic the benchmark's server simulates.
_INTERACTIVE = 'I'


class BenchmarkChoice(NamedTuple):
    """The part of a benchmark's id that the user chooses: vehicle model and cost function."""

    model: str = 'KS'
    cost: str = 'JB1'

    def check(self) -> None:
        """
        Refuse a cost function that the model does not support.

        :raises InputError: naming those that it supports.
        """
        known = [cost.name for cost in SupportedCostFunctions[self.model].value]
        if self.cost not in known:
            raise InputError(f'{self.cost} is not defined for the model {self.model}', '--cost',
                             f'give one of {", ".join(known)}')


@dataclass(frozen=True)
class JudgedSolution:
    """
    A solution with what CommonRoad's tools say of it.

    :param benchmark_id: vehicles, cost functions, scenario and version, as the benchmark names it.
    :param states: number of its states, of all planning problems.
    :param cost: sum over its planning problems; None where it cannot be computed.
    :param faults: why it would be refused, one line each; empty for a valid solution.
    :param remarks: notes, one line each.
    """

    scenario_id: str
    benchmark_id: str
    states: int
    cost: float | None
    faults: tuple[str, ...]
    remarks: tuple[str, ...]
    xml_text: str

    @property
    def is_valid(self) -> bool:
        """Return whether nothing is wrong with it."""
        return not self.faults


def judged_run(log: RunTrajectories, choice: BenchmarkChoice,
               when: datetime | None) -> JudgedSolution:
    """
    Make the solution of a run, and judge it against the scenario as it was published.

    Unlike scores of runs, this knows neither humans nor other objects of the game, and no obstacle
    is left out: the benchmark's server has the scenario alone.

    :param when: date of the run, for the file; None leaves it out.
    :raises InputError: if no AV solves a planning problem, or CommonRoad's tools cannot judge it.
    """
    loaded = parse_scenario(log.xml_text, log.game.benchmark_id)
    scenario_id = loaded.scenario.scenario_id
    parts = list(_parts(log, loaded, choice))
    if not parts:
        raise InputError('no AV of it has a planning problem', str(scenario_id),
                         'give a run with one')
    solution = dated(Solution(scenario_id, [solved for solved, _ in parts]), when)
    text = solution_text(solution)
    scores = judge_solution(ScoredScenario(loaded), solution)
    root = guard.parse_hardened(text, 'solution', ROOT)
    faults = [*(f'schema: {error}' for error in solution_schema_errors(root)), *_faults(scores)]
    if scenario_id.obstacle_behavior == _INTERACTIVE:
        faults.insert(0, "interactive: the benchmark's server simulates other traffic than the "
                      'one in the file')
    remarks = [remark for _, remark in parts if remark]
    if any('obstacle_collision' in score.checks.failed for score in scores):
        remarks += _own_obstacles(loaded, solution.planning_problem_ids)
    totals = [score.costs[0].total for score in scores]
    return JudgedSolution(
        str(scenario_id), solution.benchmark_id,
        sum(len(solved.trajectory.state_list) for solved, _ in parts),
        None if None in totals else sum(total for total in totals if total is not None),
        tuple(dict.fromkeys(faults)), tuple(remarks), text)


def _parts(log: RunTrajectories, loaded: LoadedScenario,
           choice: BenchmarkChoice) -> Iterator[tuple[PlanningProblemSolution, str]]:
    """Yield the solution of each planning problem that an AV has, with a note or an empty text."""
    problems = {problem.planning_problem_id: problem for problem in loaded.planning_problems}
    numbers = {vehicle.id: number for number, vehicle in enumerate(log.vehicles)}
    for av in log.game.avs:
        problem = problems.get(av.planning_problem)
        if problem is None:
            continue
        kind = choose_type(av.vehicle)
        states = driven_states(log, numbers[av.id], kind.kind, int(log.ks[0]))
        states = states[max(0, problem.initial_state.time_step - states[0].time_step):]
        if not states:
            continue
        _join_headings(states, problem.initial_state.orientation)
        modelled = states if choice.model == VehicleModel.KS.name \
            else point_mass_states(states, kind.kind)
        kept = until_goal(modelled, goal_step(problem, modelled))
        yield (
            PlanningProblemSolution(av.planning_problem, VehicleModel[choice.model], kind.kind,
                                    CostFunction[choice.cost], kept),
            '' if kind.is_exact else
            f'no vehicle type of CommonRoad has the dimensions of {av.id}: type {kind.kind.value} '
            f'is nearest, {kind.difference:.2f} m off in all')


def _join_headings(states: list[KSState], start: float) -> None:
    """
    Let headings begin near that of the problem, and change without a jump.

    The checks compare headings as numbers, and published problems have any of -2 pi to 2 pi,
    beyond which CommonRoad allows none.

    :param states: changed in place.
    :param start: heading of the planning problem [rad]
    """
    headings = np.unwrap([start, *(state.orientation for state in states)])[1:]
    if np.abs(headings).max() <= 2.0 * math.pi:
        for state, heading in zip(states, headings, strict=True):
            state.orientation = float(heading)


def _own_obstacles(loaded: LoadedScenario, problems: Collection[int]) -> Iterator[str]:
    """Yield a note for each obstacle that stands where an AV starts."""
    for problem, obstacle in ScoredScenario.from_file(loaded).own.items():
        if problem in problems:
            yield (f'obstacle {obstacle} of the file starts where planning problem {problem} '
                   'does: every solution collides with it')


def _faults(scores: list[SolutionScores]) -> Iterator[str]:
    for score in scores:
        where = '' if len(scores) == 1 else f'problem {score.solved.planning_problem_id}: '
        shared = ('solved_all_problems', 'ego_collision')
        for name, reason in score.checks.failed.items():
            yield f'{"" if name in shared else where}{name}: {reason}'
        for cost in score.costs:
            if cost.total is None:
                yield f'{where}no {cost.name}: {cost.reason}'
