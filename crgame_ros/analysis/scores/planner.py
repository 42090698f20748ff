# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scores of all driven vehicles of a run, or of the solutions of a scenario."""

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

    def as_dict(self) -> dict[str, Any]:
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


@dataclass(frozen=True)
class PlannerScores:
    """
    The scores of a run, or of solutions.

    :param scenario_id: id of the scenario that the vehicles or solutions drove in.
    :param xml_text: that scenario.
    :param vehicles: scores of each vehicle.
    :param remarks: notes, one line each.
    """

    scenario_id: ScenarioID
    xml_text: str
    vehicles: tuple[VehicleScores, ...]
    remarks: tuple[str, ...] = REMARKS

    def as_dict(self) -> dict[str, Any]:
        """Return the scores as a JSON-compatible dictionary: SI units, times since the start."""
        return {'scenario': str(self.scenario_id), 'checker': checker_version(),
                'vehicles': [each.as_dict() for each in self.vehicles],
                'remarks': list(self.remarks)}
