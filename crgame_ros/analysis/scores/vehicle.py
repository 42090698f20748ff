# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scores of one vehicle: their measures, nuPlan's and CommonRoad's, its goal and its plans."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.scenario import ScenarioID
from commonroad.scenario.state import KSState
from crgame_ros.analysis.scores.commonroad_costs import checker_version, COSTS
from crgame_ros.analysis.scores.driven_states import goal_step
from crgame_ros.analysis.scores.nuplan import NuplanScore
from crgame_ros.measures import Measure
from crgame_ros.recording.recorded_plans import PlanOutcome
from crgame_ros.scenario.exact_values import group_outline
import numpy as np
import shapely

if TYPE_CHECKING:
    from crgame_ros.analysis.scores.solution_judge import SolutionScores

REMARKS = (
    'costs are those of the code: its weights and the table of the benchmark site differ; '
    'SM1, SM2 and WX1 take the path length in the code',)


@dataclass(frozen=True)
class GoalRecord:
    """
    A vehicle's way to its goal.

    :param step: number of the first state that met the goal; None: none did.
    :param reached_s: time at which a state first met the goal, since the run's start; None: never
        [s]
    :param last_distance: from the centre to the goal's area at the end; None: it has no area [m]
    :param least_distance: smallest such distance of the run [m]
    """

    step: int | None
    reached_s: float | None
    last_distance: float | None
    least_distance: float | None

    def as_dict(self) -> dict[str, object]:
        """Return the fields as a JSON-compatible dictionary."""
        return {'reached_s': self.reached_s, 'last_distance_m': self.last_distance,
                'least_distance_m': self.least_distance}


def find_goal(problem: PlanningProblem, states: Sequence[KSState], dt_s: float) -> GoalRecord:
    """Find when a drive, from time step 0 on, reached its goal, and how near it came."""
    step = goal_step(problem, list(states))
    points = shapely.points([state.position for state in states])
    areas = [group_outline(state.position) for state in problem.goal.state_list
             if getattr(state, 'position', None) is not None]
    away = np.min([shapely.distance(points, area) for area in areas], axis=0) if areas else None
    return GoalRecord(step, None if step is None else step * dt_s,
                      None if away is None else float(away[-1]),
                      None if away is None else float(away.min()))


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


@dataclass(frozen=True)
class PlannerScores:
    """
    The scores of a run, or of solutions.

    :param scenario_id: id of the scenario that the vehicles or solutions drove in.
    :param xml_text: that scenario.
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


_NUPLAN = 'nuplan-devkit, closed loop'
_OURS = 'crgame_ros'
_SHORT = 'the run has fewer than 5 time steps'
_NO_PLANS = 'it has no planner, or its plans were not recorded'
_GOAL = 'of a human the goal is where its drive ended'


def _of_nuplan(label: str, definition: str, variant: str = _NUPLAN) -> Measure:
    return Measure('1', definition, variant, label=label, better=1, empty=_SHORT)


# nuPlan's multipliers, then what it weights.
NUPLAN_PARTS = {
    'no_collision_at_fault': _of_nuplan(
        'No collision at fault', '1, 0.5 after one collision at fault with an object, else 0'),
    'drivable_area': _of_nuplan(
        'On the road', '1 where no corner is off the road by 0.3 m or more',
        'road: union of the lanelets'),
    'driving_direction': _of_nuplan(
        'With the traffic', '1, 0.5 from 2 m, 0 from 6 m against the lane within 1 s',
        'steps at which the lane changes count too'),
    'making_progress': _of_nuplan('Made headway', '1 where progress is above 0.2'),
    'progress': _of_nuplan(
        'Progress', "way along the expert's route over the expert's way, 0 to 1",
        'without an expert: over that of a free drive at the speed limit; 1 where the expert has '
        'no route'),
    'time_to_collision': _of_nuplan(
        'Kept its distance', '1 where it is always above 0.95 s, sampled each 0.1 s within 3 s'),
    'speed_limit': _of_nuplan(
        'Kept the speed limit', '1 - mean excess / 2.23 m/s, 0 at least',
        f'{_NUPLAN}; 1 where no limit is known'),
    'comfort': _of_nuplan(
        'Comfort', '1 where accelerations, jerks and yaw are within bounds',
        'derivatives of speed and yaw')}
SCORE_MEASURES = {
    'nuplan_score': _of_nuplan(
        'nuPlan score, of 1', 'product of the multipliers times the weighted mean'),
    **NUPLAN_PARTS,
    **{name: Measure(
        '1', f'CommonRoad cost {name} as docs/scores.md has it: {cost.definition}', cost.variant,
        label=f'CommonRoad cost {name}', better=-1,
        empty='the checker finds no lane or lacks a state')
       for name, cost in COSTS.items()},
    'valid': Measure(
        '', 'whether all checks of valid_solution are passed',
        f'road: union of the lanelets; {_GOAL}',
        label='Valid solution', better=1),
    'feasible': Measure(
        '', 'whether the model KS can make every transition',
        'the checker, 2 cm and 0.03 rad, at 0.1 s', label='Feasible', better=1,
        empty='the checker was not available'),
    'accepted_share': Measure(
        '1', 'answers accepted that are no fallback, of all answers', _OURS,
        label='Plans accepted that are no braking plans', better=1,
        empty=f'{_NO_PLANS}, or it never answered'),
    'latency_ms': Measure(
        'ms', 'time from a request to its plan', _OURS, label='Latency of plans, median',
        better=-1, empty=_NO_PLANS),
    'age_ms': Measure(
        'ms', 'age of the plan in use, sampled once a second', _OURS,
        label='Age of the plan in use, median', better=-1, empty=_NO_PLANS),
    'reached_s': Measure(
        's', 'time until a state first meets the goal', _GOAL, label='Goal reached after',
        better=-1, empty='it never did'),
    'last_distance_m': Measure(
        'm', "distance from the centre to the goal's area at the end", _GOAL,
        label='Distance to the goal at the end', better=-1, empty='the goal has no position'),
}
