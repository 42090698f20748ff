# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scores of one vehicle: nuPlan's and CommonRoad's, with its goal and its plans."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from crgame_ros.analysis.scores.goal_record import GoalRecord
from crgame_ros.analysis.scores.measures import SCORE_MEASURES
from crgame_ros.analysis.scores.nuplan import NuplanScore
from crgame_ros.recording.plan_outcome import PlanOutcome

if TYPE_CHECKING:  # The checker takes a second to import, and reports of runs do without it.
    from crgame_ros.analysis.scores.solution_judge import SolutionScores


@dataclass(frozen=True)
class VehicleScores:
    """
    The scores of one vehicle.

    :param vehicle_id: id of the vehicle; for a solution the name of its file.
    :param role: human, autonomous or solution.
    :param planner: name of an AV's planner; empty otherwise.
    :param nuplan: nuPlan's score; None where it cannot be computed.
    :param commonroad: results of CommonRoad's tools; None where they were not run.
    :param goal: its way to the goal; None likewise.
    :param plans: its planner's answers; None without a planner, or where they are unknown.
    :param remarks: notes, one line each.
    """

    vehicle_id: str
    role: str
    planner: str
    nuplan: NuplanScore | None
    commonroad: 'SolutionScores | None'
    goal: GoalRecord | None
    plans: PlanOutcome | None
    remarks: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, object]:
        """Return the fields as a JSON-compatible dictionary."""
        return {
            'vehicle': self.vehicle_id, 'role': self.role, 'planner': self.planner,
            **{name: None if part is None else part.as_dict() for name, part in (
                ('commonroad', self.commonroad), ('nuplan', self.nuplan), ('goal', self.goal))},
            'plans': None if self.plans is None else {
                'accepted_share': self.plans.accepted_share, **self.plans.as_dict()},
            'remarks': list(self.remarks)}

    def values(self) -> dict[str, float | None]:
        """Return each score of `SCORE_MEASURES`, the median for spreads; None if there is none."""
        found: dict[str, float | None] = dict.fromkeys(SCORE_MEASURES)
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
            for name, spread in (('latency_ms', self.plans.latency_ms),
                                 ('age_ms', self.plans.age_ms)):
                found[name] = None if spread is None else spread['p50']
        return found
