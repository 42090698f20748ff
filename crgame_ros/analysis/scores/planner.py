# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scores of everybody who drove in a run, or of the solutions of a scenario."""

from dataclasses import dataclass
from typing import Any

from commonroad.common.solution import CostFunction, PlanningProblemSolution, Solution
from commonroad.scenario.scenario import ScenarioID
from crgame_ros.analysis.scores.commonroad_costs import checker_version, COSTS, TrajectoryCost
from crgame_ros.analysis.scores.solution_checks import SolutionChecks
from crgame_ros.analysis.scores.trajectory_feasibility import TrajectoryFeasibility
from crgame_ros.analysis.scores.vehicle import VehicleScores

REMARKS = (
    'costs are those of the code: its weights and the table of the benchmark site differ; '
    'SM1, SM2 and WX1 take the path length in the code',)


@dataclass(frozen=True)
class SolutionScores:
    """
    What CommonRoad's tools say of the solution of one planning problem.

    :param solved: the solution; its cost function is one of several.
    :param exact_type: whether its vehicle type has the vehicle's dimensions.
    :param costs: by function; empty where the trajectory cannot be had.
    :param checks: those of `valid_solution`.
    :param feasibility: against the vehicle model.
    """

    solved: PlanningProblemSolution
    exact_type: bool
    costs: tuple[TrajectoryCost, ...]
    checks: SolutionChecks
    feasibility: TrajectoryFeasibility

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {
            'planning_problem': self.solved.planning_problem_id,
            'vehicle': self.solved.vehicle_id, 'exact_vehicle_type': self.exact_type,
            'states': len(self.solved.trajectory.state_list),
            'costs': {cost.name: cost.as_dict() for cost in self.costs},
            **self.checks.as_dict(), 'feasibility': self.feasibility.as_dict()}

    def solutions(self, scenario_id: ScenarioID) -> dict[str, Solution]:
        """Return a solution for each cost function that the vehicle model may be judged by."""
        found = self.solved
        return {name: Solution(scenario_id, [PlanningProblemSolution(
            found.planning_problem_id, found.vehicle_model, found.vehicle_type,
            CostFunction[name], found.trajectory)]) for name in COSTS}


@dataclass(frozen=True)
class PlannerScores:
    """
    The scores of a run, or of solutions.

    :param scenario_id: of the scenario against which was judged.
    :param xml_text: that scenario.
    :param vehicles: one after the other.
    :param remarks: one line each.
    """

    scenario_id: ScenarioID
    xml_text: str
    vehicles: tuple[VehicleScores, ...]
    remarks: tuple[str, ...] = REMARKS

    def as_dict(self) -> dict[str, Any]:
        """Return what was found, as JSON has it: SI units, times since the start."""
        return {'scenario': str(self.scenario_id), 'checker': checker_version(),
                'vehicles': [each.as_dict() for each in self.vehicles],
                'remarks': list(self.remarks)}
