# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scores solutions from any source against their scenario."""

from collections.abc import Callable, Mapping
import copy
from dataclasses import dataclass, replace

from commonroad.common.solution import (
    PlanningProblemSolution,
    Solution,
    TrajectoryType,
    vehicle_parameters,
)
from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
from commonroad.scenario.trajectory import Trajectory
from crgame_ros.analysis.scores.nuplan import NuplanScorer
from crgame_ros.analysis.scores.scored_drive import drive_among, ScoredDrive, Track
from crgame_ros.analysis.scores.scored_run import score_drive
from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
from crgame_ros.analysis.scores.solution_judge import (
    failures,
    poses_of,
    SolutionJudge,
    SolutionScores,
    speeds_of,
)
from crgame_ros.analysis.scores.trajectory_feasibility import check_feasibility, simulated
from crgame_ros.analysis.scores.vehicle import find_goal, PlannerScores, REMARKS, VehicleScores
from crgame_ros.errors import InputError, one_line
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.geometry.shape import Shape
import numpy as np


@dataclass(frozen=True)
class _Part:
    """One planning problem's solution: its states, or those that result from its inputs."""

    found: PlanningProblemSolution
    driven: Trajectory


def score_solutions(scored: ScoredScenario, solutions: Mapping[str, Solution],
                    progress: Callable[[float], object] = lambda _: None) -> PlannerScores:
    """
    Score solutions of a scenario.

    :param solutions: solutions by the name used in the scores.
    :param progress: called with the share done so far, 0 to 1.
    :raises InputError: if one is for another scenario, or cannot be driven at all.
    """
    judge, nuplan = SolutionJudge(scored), NuplanScorer(scored.loaded)
    vehicles: list[VehicleScores] = []
    for number, (name, solution) in enumerate(solutions.items()):
        vehicles += _score(scored, judge, nuplan, name, solution)
        progress((number + 1) / len(solutions))
    return PlannerScores(scored.loaded.scenario.scenario_id, scored.loaded.xml_text,
                         tuple(vehicles), (*REMARKS, *scored.loaded.notices))


def judge_solution(scored: ScoredScenario, solution: Solution) -> list[SolutionScores]:
    """
    Judge a solution with CommonRoad's tools alone, by its own cost function.

    :return: the results for each planning problem that it solves.
    :raises InputError: if it is for another scenario, or cannot be driven at all.
    """
    judge, failed = SolutionJudge(scored), _failures(scored, solution)
    parts = [_part(scored, found, solution.benchmark_id)
             for found in solution.planning_problem_solutions]
    solved = frozenset(part.found.planning_problem_id for part in parts)
    return [judge.judge(part.found, part.driven, failed=failed, others=solved,
                        costs=(part.found.cost_function.name,)) for part in parts]


def _score(scored: ScoredScenario, judge: SolutionJudge, nuplan: NuplanScorer, name: str,
           solution: Solution) -> list[VehicleScores]:
    parts = [_part(scored, found, name) for found in solution.planning_problem_solutions]
    remarks = [] if str(solution.scenario_id) == str(scored.loaded.scenario.scenario_id) else [
        one_line(f'it was made for the scenario {solution.scenario_id}')]
    failed = _failures(scored, solution)
    solved = frozenset(part.found.planning_problem_id for part in parts)
    drives = [_drive(scored, part, solved) for part in parts]
    result = []
    for number, part in enumerate(parts):
        problem = scored.problem(part.found.planning_problem_id)
        told = list(remarks)
        others = [_track(other, mate, drives[number], part) for mate, other
                  in zip(parts, drives, strict=True) if mate is not part]
        drive = replace(drives[number], tracks=(*drives[number].tracks, *others))
        who = name if len(parts) == 1 else f'{name}, problem {problem.planning_problem_id}'
        judged = judge.judge(part.found, part.driven, failed=failed, others=solved)
        if judged.feasibility.feasible is False and _has_rear_axles(part.found, problem, drive):
            told.append('its positions seem to be those of the rear axle, as in files of 2021: '
                        'read in this way, it is feasible')
        nuplan_score = score_drive(nuplan, drive, scored, problem,
                                   int(part.driven.state_list[0].time_step), told)
        result.append(VehicleScores(
            who, 'solution', '', nuplan_score, judged,
            find_goal(problem, part.driven.state_list, drive.dt_s), None, tuple(told)))
    return result


def _part(scored: ScoredScenario, found: PlanningProblemSolution, name: str) -> _Part:
    problem = scored.problem(found.planning_problem_id)
    try:
        return _Part(found, simulated(found, problem, scored.loaded.time_step_s))
    except ValueError as error:
        raise InputError(f'planning problem {found.planning_problem_id}: {error}', name,
                         'give a solution that can be driven') from error


def _failures(scored: ScoredScenario, solution: Solution) -> dict[str, str]:
    """Run the checks that concern a solution as a whole; return failures by name."""
    from crgame_ros.analysis.scores.checker import solution_checker
    problems = PlanningProblemSet(list(scored.loaded.planning_problems))
    return failures({
        'solved_all_problems': lambda: solution_checker.solved_all_problems(problems, solution),
        'ego_collision': lambda: solution_checker.ego_collision(
            scored.loaded.scenario, problems, solution)})


def _has_rear_axles(found: PlanningProblemSolution, problem: PlanningProblem,
                    drive: ScoredDrive) -> bool:
    """Return whether a trajectory is feasible if its positions are of the rear axle."""
    if found.trajectory_type is not TrajectoryType.KS:
        return False
    moved = copy.deepcopy(found.trajectory.state_list)
    for state, pose in zip(moved, shifted(drive.poses, drive.rear_to_center), strict=True):
        state.position = pose[:2]
    return check_feasibility(
        PlanningProblemSolution(found.planning_problem_id, found.vehicle_model, found.vehicle_type,
                                found.cost_function, Trajectory(moved[0].time_step, moved)),
        problem, drive.dt_s).feasible is True


def _drive(scored: ScoredScenario, part: _Part, solved: frozenset[int]) -> ScoredDrive:
    kind = vehicle_parameters[part.found.vehicle_type]
    states = part.driven.state_list
    return drive_among(
        f'problem {part.found.planning_problem_id}', Shape.rectangle(kind.l, kind.w),
        float(kind.b), poses_of(states), speeds_of(states), int(states[0].time_step),
        scored.loaded, sorted(scored.own_obstacles(solved)))


def _track(other: ScoredDrive, mate: _Part, mine: ScoredDrive, part: _Part) -> Track:
    """Build the track of a vehicle solved together with one, at the steps of the latter."""
    rows = np.arange(len(mine.poses)) + int(
        part.driven.state_list[0].time_step - mate.driven.state_list[0].time_step)
    known = (rows >= 0) & (rows < len(other.poses))
    poses, speeds = np.full((len(rows), 3), np.nan), np.full(len(rows), np.nan)
    poses[known], speeds[known] = other.poses[rows[known]], np.abs(other.speeds[rows[known]])
    return Track(other.vehicle_id, 'vehicle', other.shape, poses, speeds)
