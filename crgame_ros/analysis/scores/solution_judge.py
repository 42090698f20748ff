# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Judges solutions of planning problems with CommonRoad's tools, check by check."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from commonroad.common.solution import (
    CostFunction,
    PlanningProblemSolution,
    Solution,
    vehicle_parameters,
)
from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
from commonroad.scenario.scenario import Scenario, ScenarioID
from commonroad.scenario.state import TraceState
from commonroad.scenario.trajectory import Trajectory
from crgame_ros.analysis.scores.commonroad_costs import COSTS, evaluate_costs, TrajectoryCost
from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
from crgame_ros.analysis.scores.trajectory_feasibility import (
    check_feasibility,
    TrajectoryFeasibility,
)
from crgame_ros.errors import one_line
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.boundary import RoadBoundary
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class SolutionChecks:
    """
    The results of the checks.

    :param failed: reason of each failed check, by its name in the checker.
    :param passed: names of the others.
    """

    failed: dict[str, str]
    passed: tuple[str, ...]

    @property
    def is_valid(self) -> bool:
        """Return whether all checks passed."""
        return not self.failed

    def as_dict(self) -> dict[str, object]:
        """Return the fields as a JSON-compatible dictionary."""
        return {'valid': self.is_valid, 'failed': self.failed, 'passed': list(self.passed)}


def _check_solution(scenario: Scenario, problem: PlanningProblem,
                    found: PlanningProblemSolution, poses: NDArray[np.float64],
                    feasibility: TrajectoryFeasibility, boundary: RoadBoundary,
                    earlier: Mapping[str, str]) -> SolutionChecks:
    """
    Check the solution of one problem, as `valid_solution` does.

    `valid_solution` stops at the first failure. Its road boundary needs the package triangle,
    which is not free, and has crashed on a roundabout. Therefore each check runs by itself, with
    the project's own road check: no part of the footprint may be off the union of the lanelets.

    :param scenario: the scenario without the vehicle itself.
    :param poses: (K, 3) poses of the centre.
    :param earlier: failures of checks of the whole solution, by name.
    """
    from crgame_ros.analysis.scores.checker import solution_checker
    problems = PlanningProblemSet([problem])
    solution = Solution(scenario.scenario_id, [found])
    checks: dict[str, Callable[[], object]] = {
        'goal_reached': lambda: solution_checker.goal_reached(scenario, problems, solution),
        'starts_at_correct_state': lambda: solution_checker.starts_at_correct_state(
            solution, problems),
        'obstacle_collision': lambda: solution_checker.obstacle_collision(
            scenario, problems, solution)}
    failed = {**earlier, **failures(checks)}
    known = vehicle_parameters[found.vehicle_type]
    off = np.flatnonzero(boundary.are_off_road(poses, Shape.rectangle(known.l, known.w)))
    if len(off):
        failed['boundary_collision'] = f'off the road from time step {off[0]} of the trajectory on'
    if not feasibility.feasible:
        failed['solution_feasible'] = feasibility.reason
    names = (*checks, 'boundary_collision', 'solution_feasible')
    return SolutionChecks(failed, tuple(name for name in names if name not in failed))


def failures(checks: Mapping[str, Callable[[], object]]) -> dict[str, str]:
    """Run checks, and return the reasons of those that fail by their names."""
    failed = {}
    for name, check in checks.items():
        try:
            check()
        except Exception as error:  # the checker can raise any exception
            failed[name] = one_line(str(error) or type(error).__name__)
    return failed


@dataclass(frozen=True)
class SolutionScores:
    """
    The results of CommonRoad's tools for the solution of one planning problem.

    :param solved: the solution; its cost function is one of several.
    :param exact_type: whether its vehicle type has the vehicle's dimensions.
    :param costs: costs by function; empty without a trajectory.
    :param checks: checks of `valid_solution`.
    :param feasibility: feasibility with the vehicle model.
    """

    solved: PlanningProblemSolution
    exact_type: bool
    costs: tuple[TrajectoryCost, ...]
    checks: SolutionChecks
    feasibility: TrajectoryFeasibility

    def as_dict(self) -> dict[str, object]:
        """Return the fields as a JSON-compatible dictionary."""
        return {
            'planning_problem': self.solved.planning_problem_id,
            'vehicle': self.solved.vehicle_id, 'exact_vehicle_type': self.exact_type,
            'states': len(self.solved.trajectory.state_list),
            'costs': {cost.name: cost.as_dict() for cost in self.costs},
            **self.checks.as_dict(), 'feasibility': self.feasibility.as_dict()}

    def solutions(self, scenario_id: ScenarioID) -> dict[str, Solution]:
        """Return a solution for each cost function that the vehicle model supports."""
        found = self.solved
        return {name: Solution(scenario_id, [PlanningProblemSolution(
            found.planning_problem_id, found.vehicle_model, found.vehicle_type,
            CostFunction[name], found.trajectory)]) for name in COSTS}


class SolutionJudge:
    """Judges solutions of one scenario."""

    def __init__(self, scored: ScoredScenario) -> None:
        self._scored = scored
        self._boundary = RoadBoundary(scored.loaded.scenario.lanelet_network)

    def judge(self, found: PlanningProblemSolution, driven: Trajectory, *,
              exact_type: bool = True, failed: Mapping[str, str] | None = None,
              others: frozenset[int] = frozenset(), costs: Sequence[str] = tuple(COSTS),
              progress: Callable[[float], object] = lambda _: None) -> SolutionScores:
        """
        Judge one solution.

        :param driven: its states; if it holds inputs, the states that result from these.
        :param exact_type: whether its vehicle type has the vehicle's dimensions.
        :param failed: failures of other checks of the solution, by name.
        :param others: planning problems that are solved together with it.
        :param costs: names of the cost functions to evaluate.
        :param progress: called with the share done so far, 0 to 1.
        """
        problem = self._scored.problem(found.planning_problem_id)
        scenario = self._scored.without_own({found.planning_problem_id, *others})
        feasibility = check_feasibility(found, problem, float(scenario.dt), progress)
        checks = _check_solution(scenario, problem, found, poses_of(driven.state_list),
                                 feasibility, self._boundary, failed or {})
        return SolutionScores(
            found, exact_type,
            evaluate_costs(scenario, problem, driven, found.vehicle_type, costs), checks,
            feasibility)


def poses_of(states: list[TraceState]) -> FloatArray:
    """Return the poses (K, 3) of the centre; a point mass heads in its direction of motion."""
    return np.array([(*state.position, heading_of(state)) for state in states])


def speeds_of(states: list[TraceState]) -> FloatArray:
    """Return the speeds (K) of states [m/s]; those of a point mass are never negative."""
    return np.array([np.hypot(state.velocity, state.velocity_y)
                     if getattr(state, 'orientation', None) is None else state.velocity
                     for state in states])


def heading_of(state: TraceState) -> float:
    """Return the heading of a state [rad]."""
    if getattr(state, 'orientation', None) is None:
        return float(np.arctan2(state.velocity_y, state.velocity))
    return float(state.orientation)
