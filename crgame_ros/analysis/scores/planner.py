# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scores of all driven vehicles of a run, or of the solutions of a scenario."""

from dataclasses import dataclass

from commonroad.scenario.scenario import ScenarioID
from crgame_ros.analysis.scores.commonroad_costs import checker_version
from crgame_ros.analysis.scores.vehicle import VehicleScores

REMARKS = (
    'costs are those of the code: its weights and the table of the benchmark site differ; '
    'SM1, SM2 and WX1 take the path length in the code',)


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

    def as_dict(self) -> dict[str, object]:
        """Return the scores as a JSON-compatible dictionary: SI units, times since the start."""
        return {'scenario': str(self.scenario_id), 'checker': checker_version(),
                'vehicles': [each.as_dict() for each in self.vehicles],
                'remarks': list(self.remarks)}
