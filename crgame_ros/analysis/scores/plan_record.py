# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The record of an AV's plans in a run, and of how it reached its goal."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from commonroad.geometry.shape import ShapeGroup
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.state import KSState
from crgame_ros.analysis.scores.driven_states import goal_step
from crgame_ros.recording.offline_outcome import planner_entries
from crgame_ros.recording.timing_report import PLAN_COUNTS
from crgame_ros.scenario.exact_values import group_outline
from crgame_ros.simulation.offline import OfflineResult
import numpy as np
import shapely

_COUNTS = (*PLAN_COUNTS, 'plans')


@dataclass(frozen=True)
class PlanRecord:
    """
    The plans of one AV.

    :param counts: by name; None where a count was not recorded.
    :param fallbacks: number of braking plans sent because the planner failed.
    :param reasons: number of fallbacks by reason, as far as reasons were recorded.
    :param last_refusal: reason of the last refusal of a plan.
    :param spreads: p50, p99 and max by name: latency_ms from request to plan, plan_time_ms of the
        planner itself, age_ms of the plan in use; None where it was not measured.
    :param tracking: worst errors of a tracked AV by name [m], [rad], [m/s]; None for an AV that
        follows its plans exactly.
    """

    counts: dict[str, int | None]
    fallbacks: int | None
    reasons: dict[str, int]
    last_refusal: str | None
    spreads: dict[str, dict[str, float] | None]
    tracking: dict[str, float] | None

    @property
    def accepted_share(self) -> float | None:
        """Return the share of answers that were accepted and no fallback; None without answers."""
        accepted, plans = self.counts['accepted'], self.counts['plans']
        if accepted is None or not plans:
            return None
        return max(0, accepted - (self.fallbacks or 0)) / plans

    def as_dict(self) -> dict[str, Any]:
        """Return the fields as a JSON-compatible dictionary."""
        return {'accepted_share': self.accepted_share, **self.counts,
                'fallbacks': self.fallbacks, 'fallback_reasons': self.reasons,
                'last_refusal': self.last_refusal, **self.spreads,
                'worst_tracking_errors': self.tracking}


@dataclass(frozen=True)
class GoalRecord:
    """
    A vehicle's way to its goal.

    :param reached_s: time at which a state first met the goal, since the run's start; None: never
        [s]
    :param last_distance: from the centre to the goal's area at the end; None: it has no area [m]
    :param least_distance: smallest such distance of the run [m]
    """

    reached_s: float | None
    last_distance: float | None
    least_distance: float | None

    def as_dict(self) -> dict[str, Any]:
        """Return the fields as a JSON-compatible dictionary."""
        return {'reached_s': self.reached_s, 'last_distance_m': self.last_distance,
                'least_distance_m': self.least_distance}


def plans_of_report(report: Mapping[str, Any] | None) -> dict[str, PlanRecord]:
    """
    Return the plan record of each AV from a timing report.

    :param report: from `recording.timing_report` or `offline_outcome`; None if there is none.
    """
    return {} if report is None else {
        av: PlanRecord({name: entry.get(name) for name in _COUNTS}, entry['fallback'],
                       entry['fallback_reasons'] or {}, entry['last_refusal'],
                       {name: entry[name] for name in ('latency_ms', 'plan_time_ms', 'age_ms')},
                       entry['worst_tracking_errors'])
        for av, entry in report['planners'].items()}


def plans_of_result(result: OfflineResult) -> dict[str, PlanRecord]:
    """Return the plan record of each AV from an offline run."""
    return plans_of_report({'planners': planner_entries(result)})


def find_goal(problem: PlanningProblem, states: Sequence[KSState], dt_s: float) -> GoalRecord:
    """
    Find when a drive reached its goal, and how near it came.

    :param states: states from time step 0 on.
    """
    step = goal_step(problem, list(states))
    points = shapely.points([state.position for state in states])
    areas = [_area(state.position) for state in problem.goal.state_list
             if getattr(state, 'position', None) is not None]
    away = np.min([shapely.distance(points, area) for area in areas], axis=0) if areas else None
    return GoalRecord(None if step is None else step * dt_s,
                      None if away is None else float(away[-1]),
                      None if away is None else float(away.min()))


def _area(position: Any) -> shapely.Geometry:
    return group_outline(position if isinstance(position, ShapeGroup) else ShapeGroup([position]))
