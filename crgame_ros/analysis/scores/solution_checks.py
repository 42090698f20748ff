# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks whether a solution is valid with the drivability checker, each check with its result."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from commonroad.common.solution import PlanningProblemSolution, Solution
from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
from commonroad.scenario.scenario import Scenario
from crgame_ros.analysis.scores.trajectory_feasibility import (
    TrajectoryFeasibility,
)
from crgame_ros.errors import one_line
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.boundary import RoadBoundary
import numpy as np
from numpy.typing import NDArray


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


def check_solution(scenario: Scenario, problem: PlanningProblem,
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
    :param feasibility: result of the feasibility check.
    :param boundary: boundary of the road.
    :param earlier: failures of checks of the whole solution, by name.
    """
    from commonroad_dc.feasibility import solution_checker
    problems = PlanningProblemSet([problem])
    solution = Solution(scenario.scenario_id, [found])
    checks: dict[str, Callable[[], object]] = {
        'goal_reached': lambda: solution_checker.goal_reached(scenario, problems, solution),
        'starts_at_correct_state': lambda: solution_checker.starts_at_correct_state(
            solution, problems),
        'obstacle_collision': lambda: solution_checker.obstacle_collision(
            scenario, problems, solution)}
    failed = dict(earlier)
    for name, check in checks.items():
        try:
            check()
        except Exception as error:  # the checker can raise any exception
            failed[name] = one_line(str(error) or type(error).__name__)
    shape = _shape(found)
    off = np.flatnonzero(boundary.are_off_road(poses, shape))
    if len(off):
        failed['boundary_collision'] = f'off the road from time step {off[0]} of the trajectory on'
    if not feasibility.feasible:
        failed['solution_feasible'] = feasibility.reason
    names = (*checks, 'boundary_collision', 'solution_feasible')
    return SolutionChecks(failed, tuple(name for name in names if name not in failed))


def _shape(found: PlanningProblemSolution) -> Shape:
    from commonroad_dc.feasibility import solution_checker
    known = solution_checker.VehicleParameterMapping.from_vehicle_type(found.vehicle_type)
    return Shape.rectangle(float(known.l), float(known.w))
