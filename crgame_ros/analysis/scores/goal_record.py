# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The record of how an AV reached its goal."""

from collections.abc import Sequence
from dataclasses import dataclass

from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.state import KSState
from crgame_ros.analysis.scores.driven_states import goal_step
from crgame_ros.scenario.exact_values import group_outline
import numpy as np
import shapely


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
    """
    Find when a drive reached its goal, and how near it came.

    :param states: states from time step 0 on.
    """
    step = goal_step(problem, list(states))
    points = shapely.points([state.position for state in states])
    areas = [group_outline(state.position) for state in problem.goal.state_list
             if getattr(state, 'position', None) is not None]
    away = np.min([shapely.distance(points, area) for area in areas], axis=0) if areas else None
    return GoalRecord(step, None if step is None else step * dt_s,
                      None if away is None else float(away[-1]),
                      None if away is None else float(away.min()))
