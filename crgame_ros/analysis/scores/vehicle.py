# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scores of one vehicle: nuPlan's, CommonRoad's, of its goal and of its plans."""

from dataclasses import dataclass
from typing import Any, TYPE_CHECKING

from crgame_ros.analysis.scores.measures import MEASURES
from crgame_ros.analysis.scores.nuplan import NuplanScore
from crgame_ros.analysis.scores.plan_record import GoalRecord, PlanRecord

if TYPE_CHECKING:  # The checker takes a second to import, and reports of runs do without it.
    from crgame_ros.analysis.scores.planner import SolutionScores


@dataclass(frozen=True)
class VehicleScores:
    """
    The scores of one vehicle.

    :param vehicle_id: who it was; of a solution the name of its file.
    :param role: human, autonomous or solution.
    :param planner: name of an AV's planner; empty otherwise.
    :param nuplan: nuPlan's score; None where it cannot be had.
    :param commonroad: by CommonRoad's tools; None where they were not asked.
    :param goal: how it came to its goal; None likewise.
    :param plans: what its planner answered; None of who has none, or where it is not known.
    :param remarks: one line each.
    """

    vehicle_id: str
    role: str
    planner: str
    nuplan: NuplanScore | None
    commonroad: 'SolutionScores | None'
    goal: GoalRecord | None
    plans: PlanRecord | None
    remarks: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {
            'vehicle': self.vehicle_id, 'role': self.role, 'planner': self.planner,
            **{name: None if part is None else part.as_dict() for name, part in (
                ('commonroad', self.commonroad), ('nuplan', self.nuplan), ('goal', self.goal),
                ('plans', self.plans))},
            'remarks': list(self.remarks)}

    def values(self) -> dict[str, float | None]:
        """Return each score of `MEASURES`, of spreads the median; None where there is none."""
        found: dict[str, float | None] = dict.fromkeys(MEASURES)
        if self.nuplan is not None:
            found |= {'nuplan_score': self.nuplan.score, **self.nuplan.multipliers,
                      **self.nuplan.weighted}
        if self.commonroad is not None:
            found |= {cost.name: cost.total for cost in self.commonroad.costs}
            found |= {'valid': self.commonroad.checks.is_valid,
                      'feasible': self.commonroad.feasibility.feasible}
        if self.goal is not None:
            found |= {'reached_s': self.goal.reached_s, 'last_distance_m': self.goal.last_distance}
        if self.plans is not None:
            found['accepted_share'] = self.plans.accepted_share
            for name in ('latency_ms', 'age_ms'):
                spread = self.plans.spreads[name]
                found[name] = None if spread is None else spread['p50']
        return found
