# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Judges solutions of planning problems with CommonRoad's tools."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from commonroad.common.solution import CostFunction, PlanningProblemSolution, Solution
from commonroad.scenario.scenario import ScenarioID
from commonroad.scenario.state import TraceState
from commonroad.scenario.trajectory import Trajectory
from crgame_ros.analysis.scores.commonroad_costs import COSTS, evaluate_costs, TrajectoryCost
from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
from crgame_ros.analysis.scores.solution_checks import check_solution, SolutionChecks
from crgame_ros.analysis.scores.trajectory_feasibility import (
    check_feasibility,
    TrajectoryFeasibility,
)
from crgame_ros.roads.boundary import RoadBoundary
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


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
    """
    Judges solutions of one scenario.

    :param scored: the scenario.
    """

    def __init__(self, scored: ScoredScenario) -> None:
        self._scored = scored
        self._boundary = RoadBoundary(scored.loaded.scenario.lanelet_network)

    def judge(self, found: PlanningProblemSolution, driven: Trajectory, *,
              exact_type: bool = True, failed: Mapping[str, str] | None = None,
              others: frozenset[int] = frozenset(), costs: Sequence[str] = tuple(COSTS),
              progress: Callable[[float], object] = lambda _: None) -> SolutionScores:
        """
        Judge one solution.

        :param found: the solution.
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
        checks = check_solution(scenario, problem, found, poses_of(driven.state_list),
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
